"""What is known of each link: never seen, ok, stale, lost, and regained are five different things.

NEVER_SEEN --heard--> OK --stale limit--> STALE --lost limit--> LOST
                      ^ ^                                        |
   heard for          | '------------------heard-----.           | heard
   regain_after s     |                              |           v
                      '----------------------------- REGAINED <--'

A device that never says anything is UNMONITORED in place of OK: its node alone is heard.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from chute_ros.model import LinkState, ParachuteStatus
from chute_ros.settings import Settings, parameter
from chute_ros.supervisor.inputs import LinkHeartbeat
from chute_ros.supervisor.quick_replace import replace

_NOTHING: MappingProxyType[str, ParachuteStatus] = MappingProxyType({})
#: Devices of one link that are remembered: made-up names must not grow us.
MOST_DEVICES = 16
#: Wall clocks are judged by the heartbeats of at least so long, s.
_CLOCK_SPELL = 1.0
#: A node that looks later at what its wire brings tells of what was, s.
MOST_BEHIND = 0.5
#: A count that another one broke goes on, if it is heard again within so long, s, and so many
#: heartbeats: that other one is of another node, and of none that restarted. Twice within this
#: time, s, it is no chance; and the last sign of it counts for so long, s.
_GOES_ON, _HEARTBEATS, _TWICE_WITHIN, TWO_FOR = 2.0, 200, 3.0, 5.0


class LinkJudgement(enum.IntEnum):
    """How the supervisor sees a link; numbers of chute_msgs/SafetyState.link_states."""

    NEVER_SEEN = 0
    OK = 1
    STALE = 2
    LOST = 3
    #: Heard again after LOST, not yet for long enough to be relied on.
    REGAINED = 4
    #: Its node is OK; of its device nothing can be known.
    UNMONITORED = 5


#: As which what a link says counts.
_HEARD = (LinkJudgement.OK, LinkJudgement.REGAINED, LinkJudgement.UNMONITORED)


@dataclass(frozen=True)
class LinkLimits(Settings):
    """Limits of one link."""

    stale_after: float = parameter(
        0.5, "silence of a node after which its link is STALE", 0.05, 600.0, "s"
    )
    lost_after: float = parameter(
        1.0, "silence of a node after which its link is LOST", 0.05, 600.0, "s"
    )
    regain_after: float = parameter(
        1.0,
        "a node whose link was LOST counts again once it was received for this long",
        0.0,
        60.0,
        "s",
    )
    startup_grace: float = parameter(
        10.0, "links may take this long to come up after the start", 0.0, 60.0, "s"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stale_after >= self.lost_after:
            why = "a link is STALE before it is LOST; need a smaller first or a larger second"
            raise self.contradiction(why, "stale_after", "lost_after")


@dataclass(frozen=True)
class LinkEvidence:
    """What is known of one link. heard: monotonic s of the newest heartbeat; NaN: never."""

    heard: float = math.nan
    reported: LinkState = LinkState.NEVER_SEEN
    device_healthy: bool = False
    #: Why not, as its node says it.
    reasons: tuple[str, ...] = ()
    #: What it says may be older by so much, s.
    behind: float = 0.0
    seq: int = 0
    #: The last of the count that another one broke, and when, monotonic s.
    broken: int = 0
    broken_at: float = math.nan
    #: When a broken count went on, monotonic s, and when it did so again: two nodes of one name.
    went_on_at: float = math.nan
    two_at: float = math.nan
    #: Monotonic s since when it was heard without a break, after it was lost; NaN: never lost.
    regained_at: float = math.nan
    lost_count: int = 0
    #: The wall clock here less that of the sender's newest heartbeat, s: the way and the
    #: difference of the clocks. NaN: not known.
    clock_difference: float = math.nan
    #: The smallest of these, of the spell since this monotonic s, and of the spell before it.
    clock_spell_since: float = math.nan
    clock_least: float = math.nan
    clock_least_before: float = math.nan
    #: When a device last said that it is released, monotonic s; NaN: never.
    released_at: float = math.nan
    #: The newest picture of each device on this link.
    devices: Mapping[str, ParachuteStatus] = field(default_factory=lambda: _NOTHING)

    @property
    def deployed(self) -> frozenset[str]:
        """The devices whose own status said released when they were last heard."""
        return frozenset(name for name, status in self.devices.items() if status.deployed)

    @property
    def clocks_differ_by(self) -> float:
        """By the heartbeats of a spell and more, s; NaN: not known. A message that is delayed can
        only look late, and clocks that differ show in all, so that the smallest counts."""
        unknown = math.isnan(self.clock_least_before)
        return math.nan if unknown else min(self.clock_least, self.clock_least_before)

    @property
    def looks_late(self) -> str:
        """That its node does not keep up, in words; empty: it does."""
        if not self.behind > MOST_BEHIND:
            return ""
        return (
            f"its node looks {self.behind:.2f} s late at what comes (limit {MOST_BEHIND:g} s): "
            "its computer's processor is short"
        )

    def goes_on(self, seq: int, now: float) -> bool:
        """A heartbeat of this number goes on with a count that another one broke."""
        lately = now <= self.broken_at + _GOES_ON
        return lately and seq != self.seq + 1 and 0 < seq - self.broken <= _HEARTBEATS

    def is_two(self, now: float) -> bool:
        """Two nodes of its name were heard lately."""
        return now < self.two_at + TWO_FOR

    def silent(self, limit: float, now: float) -> bool:
        """The node itself, not only its device, was not heard for limit s, or never.

        Compared as next_deadline says it, so that rounding never leaves a deadline unserved.
        """
        return not now < self.heard + limit

    def judged(self, limits: LinkLimits, now: float) -> LinkJudgement:
        """The worse of what the node says of its wire, and what its silence says of itself."""
        if math.isnan(self.heard):
            return LinkJudgement.NEVER_SEEN
        if self.silent(limits.lost_after, now):
            return LinkJudgement.LOST
        unmonitored = self.reported is LinkState.UNMONITORED
        if self.reported is not LinkState.OK and not unmonitored:
            return LinkJudgement(int(self.reported))
        if self.silent(limits.stale_after, now):
            return LinkJudgement.STALE
        if now < self.regained_at + limits.regain_after:
            return LinkJudgement.REGAINED
        return LinkJudgement.UNMONITORED if unmonitored else LinkJudgement.OK

    def is_heard(self, limits: LinkLimits, now: float) -> bool:
        """What it says counts now; what a lost one said last is not what it is."""
        return self.judged(limits, now) in _HEARD

    def with_heartbeat(self, one: LinkHeartbeat, limits: LinkLimits, now: float) -> LinkEvidence:
        """After a heartbeat. One lost, or stale while it was being regained, begins anew."""
        before = self.judged(limits, now)
        unsteady = now < self.regained_at + limits.regain_after
        regained_at, lost_count = self.regained_at, self.lost_count
        if before is LinkJudgement.LOST or (before is LinkJudgement.STALE and unsteady):
            regained_at = now
        newly_lost = one.link_state is LinkState.LOST and self.reported is not LinkState.LOST
        fell_silent = self.silent(limits.lost_after, now) and not math.isnan(self.heard)
        if newly_lost or fell_silent:
            lost_count += 1
        return replace(
            self._with_clock(one.clock_difference, now)._with_count(one.seq, now),
            heard=now,
            reported=one.link_state,
            device_healthy=one.device_healthy,
            reasons=one.reasons,
            behind=one.behind,
            seq=one.seq,
            regained_at=regained_at,
            lost_count=lost_count,
            clock_difference=one.clock_difference,
        )

    def _with_count(self, seq: int, now: float) -> LinkEvidence:
        goes_on = self.goes_on(seq, now)
        if not goes_on and (seq > self.seq or math.isnan(self.heard)):
            return self
        breaks = replace(self, broken=self.seq, broken_at=now)
        if not goes_on:
            return breaks
        twice = now <= self.went_on_at + _TWICE_WITHIN
        return replace(breaks, went_on_at=now, two_at=now if twice else self.two_at)

    def _with_clock(self, difference: float, now: float) -> LinkEvidence:
        if math.isnan(difference):
            return self
        passed = now - self.clock_spell_since
        if passed < _CLOCK_SPELL:
            return replace(self, clock_least=min(self.clock_least, difference))
        # What was heard before a long silence says nothing of now.
        before = self.clock_least if passed < 3 * _CLOCK_SPELL else math.nan
        return replace(
            self, clock_spell_since=now, clock_least=difference, clock_least_before=before
        )

    def with_status(self, status: ParachuteStatus, now: float) -> LinkEvidence:
        """After a device told its picture. A lost one's "released" is neither taken nor taken
        back, but for one that it has just said: by its own clock this picture is newer."""
        devices, said = dict(self.devices), status.deployed
        if status.link_state is not LinkState.OK:
            before = devices.get(status.device, ParachuteStatus(status.device))
            said = said and status.uptime > before.uptime
            status = replace(status, deployed=before.deployed or said)
        released_at = now if said else self.released_at
        if status.device not in devices and len(devices) >= MOST_DEVICES:
            return self
        devices[status.device] = status
        return replace(self, devices=MappingProxyType(devices), released_at=released_at)

    def deadlines(self, limits: LinkLimits) -> tuple[float, ...]:
        """When it is judged differently without anything being heard."""
        return (
            self.heard + limits.stale_after,
            self.heard + limits.lost_after,
            self.regained_at + limits.regain_after,
            self.released_at + limits.lost_after,
            self.two_at + TWO_FOR,
        )
