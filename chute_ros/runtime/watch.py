"""A device node's view of the supervisor: is it there, and how old are its messages?

A supervisor that was heard and falls silent is lost: then the node does what its parameter
on_supervisor_lost says. Of several supervisors one leads, and only that one counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chute_ros.runtime.topics import SafetyPicture, SupervisorBeat
from chute_ros.supervisor.clock_steps import ClockSteps
from chute_ros.supervisor.epochs import RANKS

#: Of our heartbeats so many are remembered: those of 5 s at the highest rate.
_MOST_SENT = 500


@dataclass(frozen=True)
class WatchPicture:
    """State of the supervisor, for diagnostics. Times are s; NaN: never received."""

    silence: float
    lost: bool
    #: How old its newest heartbeat seems to be; 0: as old as it may be.
    delay: float
    #: How far a wall clock was set, or the two differ.
    offset: float
    times_lost: int


class SupervisorWatch:
    """limit: oldest decision that is acted on, s; lost_after: s. difference: the wall clock here
    less the stamp of what came, s; now: monotonic s."""

    def __init__(self, limit: float, lost_after: float) -> None:
        self._limit, self._lost_after = limit, lost_after
        self._heard = math.nan
        self._delay = math.nan
        self._lost = False
        self._times_lost = 0
        #: Of each supervisor, also of one that only looks on: it may lead next.
        self._clocks: dict[str, ClockSteps] = {}
        #: When each of these was heard.
        self._heard_at: dict[str, float] = {}
        self._clock = ClockSteps(limit / 2)
        #: When each of our newest heartbeats left, by its stamp (ns).
        self._sent: dict[int, float] = {}

    def sent(self, stamp: int, now: float) -> None:
        """Our own heartbeat left, with this stamp."""
        self._sent[stamp] = now
        while len(self._sent) > _MOST_SENT:
            del self._sent[next(iter(self._sent))]

    def picture(self, one: SafetyPicture, link: str, difference: float, now: float) -> None:
        """safety/state came. It says which heartbeat of ours (link) was the newest, and answers
        that one. A picture from before our start, or of a recording, answers none."""
        clock = self._clocks.get(one.supervisor)
        left = self._sent.get(one.stamps.get(link, -1))
        if clock is not None and left is not None:
            clock.answered(difference, now - left, now)

    def heartbeat(self, beat: SupervisorBeat, difference: float, now: float) -> None:
        """A supervisor's came. One that only looks on does not count."""
        if beat.name not in self._clocks and len(self._clocks) >= RANKS:
            silent = min(self._heard_at, key=self._heard_at.__getitem__)
            if now - self._heard_at[silent] <= self._lost_after:
                return  # made-up names must not push out one that is there
            del self._clocks[silent], self._heard_at[silent]
        self._heard_at[beat.name] = now
        clock = self._clocks.setdefault(beat.name, ClockSteps(self._limit / 2))
        clock.heard(difference, now)
        if beat.leading:
            self._heard, self._clock, self._delay = now, clock, clock.age(difference)

    def age(self, difference: float) -> float:
        """How old a decision is, s. That a wall clock was set, here or there, made it no older."""
        return self._clock.age(difference)

    def look(self, now: float) -> bool | None:
        """True: it has just been lost; False: it is back; None: nothing has changed."""
        lost = now - self._heard > self._lost_after
        if lost is self._lost:
            return None
        self._lost = lost
        self._times_lost += int(lost)
        return lost

    def tell(self, now: float) -> WatchPicture:
        """How it is."""
        silence = now - self._heard
        return WatchPicture(
            silence,
            silence > self._lost_after,
            self._delay if abs(self._delay) > self._limit / 2 else 0.0,
            self._clock.offset,
            self._times_lost,
        )
