"""What a device node knows of the supervisor: is it there, and do the clocks agree?"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

from chute_msgs.msg import LinkHeartbeat
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock

from chute_ros.nodes import diagnostics, messages

#: A supervisor that is silent for longer (s) is an error; it beats ten times a second.
_SILENCE = 1.0


class SupervisorWatch:
    """limit: oldest decision that is acted on, s; wall: the clock of stamps."""

    def __init__(self, limit: float, wall: Clock) -> None:
        self._limit, self._wall = limit, wall
        self._heard = math.nan
        self._delay = math.nan

    def heartbeat(self, message: LinkHeartbeat) -> None:
        """Anybody's heartbeat came."""
        if message.supervisor:
            self._heard = time.monotonic()
            sent = messages.seconds(message.header.stamp)
            self._delay = messages.seconds(self._wall.now().to_msg()) - sent

    def task(self, name: str, values: Mapping[str, object]) -> DiagnosticStatus:
        """For diagnostics, with values beside."""
        age = time.monotonic() - self._heard
        level, text = diagnostics.OK, "heard"
        if math.isnan(age):
            level, text = diagnostics.STALE, "never heard"
        elif age > _SILENCE:
            level, text = diagnostics.ERROR, f"silent for {age:.1f} s"
        elif abs(self._delay) > self._limit / 2:
            level = diagnostics.ERROR
            text = f"clocks differ: its heartbeat seems {self._delay:.3f} s old"
        every = {"heartbeat age (s)": age, **values}
        return diagnostics.status(name, "supervisor", level, text, every, "")
