"""What a device node knows of the supervisor: is it there, and how old is what it says?

A supervisor that was heard and falls silent is lost: then the node does what its parameter
on_supervisor_lost says. Of several supervisors one leads, and only that one counts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

from builtin_interfaces.msg import Time
from chute_msgs.msg import LinkHeartbeat, SafetyState
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock

from chute_ros.nodes import diagnostics, messages
from chute_ros.nodes.parameters import Parameter
from chute_ros.supervisor.clock_steps import ClockSteps
from chute_ros.supervisor.epochs import RANKS

HOLD, BLOCK_FLIGHT = "hold", "block_flight"
WATCH_PARAMETERS = (
    Parameter(
        "supervisor_lost_after",
        1.0,
        "a supervisor that was heard and is silent for this long is lost, s",
        0.2,
        60.0,
    ),
    Parameter(
        "on_supervisor_lost",
        BLOCK_FLIGHT,
        "what then: hold goes on with what was decided last; block_flight keeps a vehicle that "
        "stands on the ground there, and does nothing to one that flies; upf_can has nothing to "
        "keep it with",
        choices=(HOLD, BLOCK_FLIGHT),
    ),
)
#: Of our heartbeats so many are remembered: those of 5 s at the highest rate.
_MOST_SENT = 500


class SupervisorWatch:
    """limit: oldest decision that is acted on, s; lost_after: s; wall: the clock of stamps."""

    def __init__(self, limit: float, lost_after: float, wall: Clock) -> None:
        self._limit, self._lost_after, self._wall = limit, lost_after, wall
        self._heard = math.nan
        self._delay = math.nan
        self._lost = False
        self._times_lost = 0
        #: Of each supervisor, also of one that only looks on: it may lead next.
        self._clocks: dict[str, ClockSteps] = {}
        #: When each of these was heard, s.
        self._heard_at: dict[str, float] = {}
        self._clock = ClockSteps(limit / 2)
        #: When each of our newest heartbeats left, by its stamp (s, ns).
        self._sent: dict[tuple[int, int], float] = {}

    def beat(self, stamp: Time) -> None:
        """Our own heartbeat leaves, with this stamp."""
        self._sent[stamp.sec, stamp.nanosec] = time.monotonic()
        while len(self._sent) > _MOST_SENT:
            del self._sent[next(iter(self._sent))]

    def picture(self, message: SafetyState, link: str) -> None:
        """safety/state came. It says which heartbeat of ours (link) was the newest, and answers
        that one. A picture from before our start, or of a recording, answers none."""
        clock = self._clocks.get(message.supervisor)
        heard = dict(zip(message.links, message.link_stamps, strict=False)).get(link)
        if clock is None or heard is None:
            return
        left = self._sent.get((heard.sec, heard.nanosec))
        if left is not None:
            now, difference = time.monotonic(), self._difference(message.header.stamp)
            clock.answered(difference, now - left, now)

    def heartbeat(self, message: LinkHeartbeat) -> None:
        """Anybody's heartbeat came. A supervisor that only looks on does not say healthy."""
        if not message.supervisor:
            return
        now, difference = time.monotonic(), self._difference(message.header.stamp)
        if message.link not in self._clocks and len(self._clocks) >= RANKS:
            silent = min(self._heard_at, key=self._heard_at.__getitem__)
            if now - self._heard_at[silent] <= self._lost_after:
                return  # made-up names must not push out one that is there
            del self._clocks[silent], self._heard_at[silent]
        self._heard_at[message.link] = now
        clock = self._clocks.setdefault(message.link, ClockSteps(self._limit / 2))
        clock.heard(difference, now)
        if message.device_healthy:
            self._heard, self._clock, self._delay = now, clock, clock.age(difference)

    def age(self, stamp: Time) -> float:
        """How old a decision with this stamp is, s. That a wall clock was set, here or there, made
        it no older."""
        return self._clock.age(self._difference(stamp))

    def _difference(self, stamp: Time) -> float:
        return messages.seconds(self._wall.now().to_msg()) - messages.seconds(stamp)

    def look(self) -> bool | None:
        """True: it has just been lost; False: it is back; None: nothing has changed."""
        lost = time.monotonic() - self._heard > self._lost_after
        if lost is self._lost:
            return None
        self._lost = lost
        self._times_lost += int(lost)
        return lost

    def task(self, name: str, values: Mapping[str, object]) -> DiagnosticStatus:
        """For diagnostics, with values beside."""
        age = time.monotonic() - self._heard
        level, text = diagnostics.OK, "heard"
        if math.isnan(age):
            level, text = diagnostics.STALE, "never heard"
        elif age > self._lost_after:
            level, text = diagnostics.ERROR, f"silent for {age:.1f} s"
        elif abs(self._delay) > self._limit / 2:
            level = diagnostics.ERROR
            text = f"clocks differ: its heartbeat seems {self._delay:.3f} s old"
        elif self._clock.offset:
            level = diagnostics.WARN
            text = f"heard; a wall clock was set, or differs, by {self._clock.offset:.3f} s"
        every = {
            "heartbeat age (s)": age,
            "times lost": self._times_lost,
            "clock set by (s)": self._clock.offset,
            **values,
        }
        return diagnostics.status(name, "supervisor", level, text, every, "")
