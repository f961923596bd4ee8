"""Which of several supervisors leads: one holds a lease and renews it; when it falls silent, or
hears fewer links than another, that one takes over; when two lead after a split, one yields.

The table is the whole truth: a pair that it does not list raises.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from chute_ros.settings import Settings, parameter
from chute_ros.supervisor.epochs import LARGEST_EPOCH, RANKS, epoch_above
from chute_ros.supervisor.quick_replace import replace
from chute_ros.transitions import after

#: One whose decisions a device refused as older does not lead for so long, s.
_STAND_BACK = 5.0


class Role(enum.Enum):
    """What a supervisor does with its decisions."""

    LEADING = "leading"  # sends them
    FOLLOWING = "following"  # looks on, with the leader's state


class LeaseEvent(enum.Enum):
    """What can happen to the lease."""

    SILENCE = "no leader's heartbeat was received for the lease's time"
    HEARS_MORE = "the leader receives fewer links than this one"
    KNOWS_MORE = "the leader knows of no flight, and this one does"
    OUTRANKED = "another leads with the better claim"
    OVERSLEPT = "this one did not look for longer than the lease's time"
    REFUSED = "a device has seen a newer leader"
    OVERTAKES = "another leads with a higher epoch and the weaker claim"


TRANSITIONS: dict[tuple[Role, LeaseEvent], Role] = {
    (Role.FOLLOWING, LeaseEvent.SILENCE): Role.LEADING,
    (Role.FOLLOWING, LeaseEvent.HEARS_MORE): Role.LEADING,
    (Role.FOLLOWING, LeaseEvent.KNOWS_MORE): Role.LEADING,
    (Role.LEADING, LeaseEvent.OUTRANKED): Role.FOLLOWING,
    (Role.LEADING, LeaseEvent.OVERSLEPT): Role.FOLLOWING,
    (Role.LEADING, LeaseEvent.REFUSED): Role.FOLLOWING,
    (Role.LEADING, LeaseEvent.OVERTAKES): Role.LEADING,
}


@dataclass(frozen=True)
class LeaseConfig(Settings):
    """name: of the node; deaf_after: one that has heard no link for so long hears nothing, s."""

    name: str = ""
    rank: int = parameter(
        0, "rank of this supervisor, of several each its own; 0: the first choice", 0, RANKS - 1
    )
    standby: bool = parameter(
        False, "a second supervisor may run; a lease says which one leads", name="hot_standby"
    )
    timeout: float = parameter(
        0.5,
        "a leading supervisor loses the lease after this silence",
        0.15,
        60.0,
        "s",
        name="lease_timeout",
    )
    #: Finding each other on the network takes its time.
    listen: float = parameter(
        4.0,
        "a supervisor that starts looks for a leader this long before it leads, with hot_standby",
        0.0,
        60.0,
        "s",
        name="lease_listen",
    )
    deaf_after: float = 1.0


@dataclass(frozen=True)
class Claim:
    """What a supervisor says of itself, ten times a second."""

    name: str
    rank: int
    epoch: int
    leading: bool
    #: It leads since its start without having taken anything over, and has seen no flight.
    empty: bool
    #: Links whose nodes it hears: one that hears none decides nothing, however well it is heard.
    links_heard: int = 0

    def implausible(self, rank: int) -> str:
        """Why no supervisor says this; empty: one may. rank: of the one that hears it."""
        if not 0 <= self.rank < RANKS:
            return f"rank {self.rank} (0 to {RANKS - 1})"
        if self.leading and self.epoch % RANKS != self.rank:
            return f"epoch {self.epoch}, which is none of rank {self.rank}"
        if epoch_above(self.epoch, rank) > LARGEST_EPOCH:
            return f"epoch {self.epoch}, above which there is none"
        return ""

    @property
    def strength(self) -> tuple[bool, int]:
        """Of two that lead the stronger goes on: who knows of a flight, then who came later."""
        return not self.empty, self.epoch


@dataclass(frozen=True)
class Lease:
    """Times are monotonic s; NaN: has not happened."""

    role: Role
    #: Since when a leader is looked for.
    waiting_since: float
    looked_at: float = math.nan
    leader: str = ""
    leader_heard: float = math.nan
    #: Since when the leader receives fewer links than this one.
    hears_more_since: float = math.nan
    #: The highest epoch of any claim.
    highest: int = 0
    stand_back_until: float = -math.inf

    @classmethod
    def begin(cls, config: LeaseConfig, now: float) -> Lease:
        """One that is alone leads at once; one of several looks for a leader first."""
        role = Role.FOLLOWING if config.standby else Role.LEADING
        return cls(role, now + config.listen if config.standby else now)

    def deadline(self, config: LeaseConfig) -> float:
        """When a follower takes over if all stays as it is, monotonic s; infinity: it leads."""
        if self.role is Role.LEADING:
            return math.inf
        if not math.isnan(self.hears_more_since):
            return max(self.hears_more_since + self._wait(config), self.stand_back_until)
        return max(self._silent_since() + self._wait(config), self.stand_back_until)

    def looked(
        self, config: LeaseConfig, now: float, link_heard: float = math.nan
    ) -> tuple[Lease, LeaseEvent | None]:
        """Look at the clock; what happened, if anything. link_heard: when any link was last
        heard, monotonic s; NaN: never, which says nothing."""
        overslept = now - self.looked_at > config.timeout
        lease = replace(self, looked_at=now)
        if self.role is Role.LEADING:
            if config.standby and overslept:
                return lease._moved(LeaseEvent.OVERSLEPT, now), LeaseEvent.OVERSLEPT
            return lease, None
        if overslept or now - link_heard > config.deaf_after:
            # What a leader said meanwhile is still to be read: it was not silent, we were deaf.
            waiting = max(self.waiting_since, now)
            lease = replace(lease, waiting_since=waiting, leader_heard=math.nan)
            return replace(lease, hears_more_since=math.nan), None
        if now < self.deadline(config):
            return lease, None
        if not math.isnan(self.hears_more_since):
            return lease._moved(LeaseEvent.HEARS_MORE, now), LeaseEvent.HEARS_MORE
        # Where nobody else was heard since, the network is gone, not the leader.
        if link_heard < self._silent_since() + self._wait(config) / 2:
            return lease, None
        return lease._moved(LeaseEvent.SILENCE, now), LeaseEvent.SILENCE

    def _wait(self, config: LeaseConfig) -> float:
        """Of several followers the first in rank takes over first."""
        return config.timeout * (1 + config.rank)

    def _silent_since(self) -> float:
        """Since when no leader is heard."""
        return self.waiting_since if math.isnan(self.leader_heard) else self.leader_heard

    def heard(self, own: Claim, other: Claim, now: float) -> tuple[Lease, LeaseEvent | None]:
        """Another supervisor's claim came."""
        lease = replace(self, highest=max(self.highest, other.epoch))
        if not other.leading:
            return lease, None
        if self.role is Role.FOLLOWING:
            # One that it has followed knows all that it knows; a reset makes that nothing.
            if other.empty and not own.empty and self.leader != other.name:
                if own.links_heard >= other.links_heard and now >= self.stand_back_until:
                    return lease._moved(LeaseEvent.KNOWS_MORE, now), LeaseEvent.KNOWS_MORE
                if now < self.waiting_since:
                    return lease, None  # it has just begun, and may come to hear as many
            since = math.nan
            if own.links_heard > other.links_heard:
                since = now if math.isnan(self.hears_more_since) else self.hears_more_since
            lease = replace(lease, leader=other.name, leader_heard=now, hears_more_since=since)
            return lease, None
        if other.strength > own.strength:
            lease = replace(lease._moved(LeaseEvent.OUTRANKED, now), leader=other.name)
            return replace(lease, leader_heard=now), LeaseEvent.OUTRANKED
        if other.epoch > own.epoch:
            # It will yield; but devices have perhaps seen its numbers.
            return lease, LeaseEvent.OVERTAKES
        return lease, None

    def refused(self, newest_epoch: int, now: float) -> tuple[Lease, LeaseEvent]:
        """A device has seen a higher epoch of another rank: somebody leads whom we do not hear."""
        lease = replace(self, highest=max(self.highest, newest_epoch))
        lease = lease._moved(LeaseEvent.REFUSED, now)
        return replace(lease, stand_back_until=now + _STAND_BACK), LeaseEvent.REFUSED

    def next_epoch(self, config: LeaseConfig, own: int) -> int:
        """For one that takes over: above every epoch that it knows of."""
        return epoch_above(max(self.highest, own), config.rank)

    def _moved(self, event: LeaseEvent, now: float) -> Lease:
        role = after(TRANSITIONS, self.role, event)
        lease = replace(self, role=role, waiting_since=now, leader="", leader_heard=math.nan)
        return replace(lease, hears_more_since=math.nan)
