"""Is a device alive? Never seen, ok, stale and lost are four different things.

The table is the whole truth: a pair that it does not list raises.

    NEVER_SEEN --heard--> OK --stale limit--> STALE --lost limit--> LOST
                          ^ ^------heard--------'                     |
                          '--------------heard (regained)-------------'
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, MutableMapping
from dataclasses import dataclass
from typing import Protocol, TypeVar

from chute_ros.model import LinkState
from chute_ros.settings import Settings, parameter
from chute_ros.transitions import after


class LivenessEvent(enum.Enum):
    """What can happen to a link."""

    HEARD = "received"
    STALE_LIMIT = "stale limit passed"
    LOST_LIMIT = "lost limit passed"


TRANSITIONS: dict[tuple[LinkState, LivenessEvent], LinkState] = {
    (LinkState.NEVER_SEEN, LivenessEvent.HEARD): LinkState.OK,
    (LinkState.OK, LivenessEvent.HEARD): LinkState.OK,
    (LinkState.OK, LivenessEvent.STALE_LIMIT): LinkState.STALE,
    (LinkState.STALE, LivenessEvent.HEARD): LinkState.OK,
    (LinkState.STALE, LivenessEvent.LOST_LIMIT): LinkState.LOST,
    (LinkState.LOST, LivenessEvent.HEARD): LinkState.OK,
}


@dataclass(frozen=True)
class LivenessLimits(Settings):
    """Silence after which a link is stale, and lost."""

    stale_after: float = parameter(
        2.5, "silence of the device after which its link is STALE", 0.05, 600.0, "s"
    )
    lost_after: float = parameter(
        5.0, "silence of the device after which its link is LOST", 0.05, 600.0, "s"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stale_after >= self.lost_after:
            why = "a link is STALE before it is LOST; need a smaller first or a larger second"
            raise self.contradiction(why, "stale_after", "lost_after")


@dataclass(frozen=True)
class LinkChange:
    """A link changed its state at monotonic time at (s), after silence seconds of silence."""

    before: LinkState
    after: LinkState
    at: float
    silence: float

    @property
    def regained(self) -> bool:
        """The link was lost and is back."""
        return self.before is LinkState.LOST and self.after is LinkState.OK


class Liveness:
    """Follows one link. All times are monotonic seconds; NaN: has not happened."""

    def __init__(self, limits: LivenessLimits) -> None:
        self.limits = limits
        self.state = LinkState.NEVER_SEEN
        self.since = math.nan
        self.last_heard = math.nan
        self.first_heard = math.nan
        self.regained_at = math.nan
        self.lost_count = 0

    def heard(self, now: float) -> list[LinkChange]:
        """The device was heard at now; returns what changed, limits passed before included."""
        changes = self.update(now)
        silence = self.age(now)
        before = self.state
        changes += self._take(LivenessEvent.HEARD, now, silence)
        self.last_heard = now
        if before is LinkState.NEVER_SEEN:
            self.first_heard = now
        elif before is LinkState.LOST:
            self.regained_at = now
        return changes

    def update(self, now: float) -> list[LinkChange]:
        """Look at the clock; returns the limits that were passed, each with its time."""
        changes: list[LinkChange] = []
        silence = self.age(now)
        # Compared as next_deadline says it, so that rounding never leaves a deadline unserved.
        if self.state is LinkState.OK and now >= self.next_deadline():
            changes += self._take(LivenessEvent.STALE_LIMIT, now, silence)
        if self.state is LinkState.STALE and now >= self.next_deadline():
            changes += self._take(LivenessEvent.LOST_LIMIT, now, silence)
            self.lost_count += 1
        return changes

    def age(self, now: float) -> float:
        """Seconds since the device was last heard; NaN: never."""
        return now - self.last_heard

    def next_deadline(self) -> float:
        """When update has something to say if nothing is heard; infinity: never."""
        if self.state is LinkState.OK:
            return self.last_heard + self.limits.stale_after
        if self.state is LinkState.STALE:
            return self.last_heard + self.limits.lost_after
        return math.inf

    def _take(self, event: LivenessEvent, now: float, silence: float) -> list[LinkChange]:
        before = self.state
        self.state = after(TRANSITIONS, before, event)
        if self.state is before:
            return []
        self.since = now
        return [LinkChange(before, self.state, now, silence)]


class DeviceTracker:
    """A device with a heartbeat, or the like, and a status message of its own. timeout: the newest
    status is overdue when it is older, though the link may live, s."""

    def __init__(self, limits: LivenessLimits, timeout: float) -> None:
        self.liveness = Liveness(limits)
        self.status_received = math.nan
        self.status_interval = math.nan  # s, between the two newest
        self._timeout = timeout
        self._overdue = False

    @property
    def received(self) -> float:
        """When its newest data was received, monotonic s; NaN: never."""
        times = (self.liveness.last_heard, self.status_received)
        return max((one for one in times if not math.isnan(one)), default=math.nan)

    def status_came(self, now: float) -> None:
        """Its newest status."""
        self.status_interval, self.status_received = now - self.status_received, now
        self._overdue = False

    def overdue(self, now: float) -> bool:
        """The newest status is too old: the stream stopped."""
        # Compared as next_deadline says it, so that rounding never leaves a deadline unserved.
        return now >= self.status_received + self._timeout

    def update(self, now: float) -> tuple[list[LinkChange], bool]:
        """Look at the clock: (what changed of the link, whether the picture changed)."""
        changes = self.liveness.update(now)
        before, self._overdue = self._overdue, self.overdue(now)
        return changes, bool(changes) or self._overdue != before

    def next_deadline(self) -> float:
        """When the picture changes by itself; infinity: never."""
        overdue = self.status_received + self._timeout
        if self._overdue or math.isnan(overdue):
            overdue = math.inf
        return min(self.liveness.next_deadline(), overdue)


class Followed(Protocol):
    """A device whose link is followed."""

    @property
    def liveness(self) -> Liveness:
        """Its link."""


FollowedT = TypeVar("FollowedT", bound=Followed)


def first_alive(devices: Iterable[FollowedT]) -> FollowedT | None:
    """The first device that is not lost, or else the first; None: there is none."""
    known = list(devices)
    alive = (one for one in known if one.liveness.state is not LinkState.LOST)
    return next(alive, known[0] if known else None)


KeyT = TypeVar("KeyT")


def has_room(devices: MutableMapping[KeyT, FollowedT], most: int) -> bool:
    """One more can be followed: there are fewer than so many, or the one that was lost the longest
    ago is given up for it. Made-up ids must not keep the true device out for ever."""
    if len(devices) < most:
        return True
    lost = {
        key: one.liveness.last_heard
        for key, one in devices.items()
        if one.liveness.state is LinkState.LOST
    }
    if lost:
        del devices[min(lost, key=lambda key: lost[key])]
    return bool(lost)
