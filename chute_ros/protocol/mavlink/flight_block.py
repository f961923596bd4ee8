"""While flight is blocked, arming on the ground is undone: when to disarm, and when not.

An autopilot refuses a plain disarm in flight, but nothing is staked on that: it is sent only on a
fresh word of the autopilot that it stands on the ground. One that refuses for ever is asked again
at a set pace, and a person is told once.
"""

from __future__ import annotations

import math

from chute_ros.model import Armed
from chute_ros.protocol.mavlink.autopilot import AutopilotTracker

#: Seconds from one disarm to the next, while the autopilot stays armed.
DISARM_INTERVAL = 2.0


class FlightBlock:
    """The block, and the disarming under it."""

    def __init__(self) -> None:
        self.reason = ""
        self._disarm_at = -math.inf
        self._told = False

    def set(self, reason: str) -> None:
        """Block for reason, or release (empty)."""
        news = bool(reason) != bool(self.reason)
        self.reason = reason
        if news:
            self._disarm_at, self._told = -math.inf, False

    def stands(self, autopilot: AutopilotTracker, now: float) -> bool:
        """Flight is blocked and the autopilot says, now, that it is on the ground."""
        return bool(self.reason) and autopilot.on_ground(now)

    def disarm_due(self, autopilot: AutopilotTracker, now: float) -> bool:
        """The autopilot is to be disarmed now; if it stays armed, the next time is set."""
        if autopilot.armed is not Armed.ARMED:
            self._disarm_at, self._told = -math.inf, False
            return False
        if now < self._disarm_at or not self.stands(autopilot, now):
            return False
        self._disarm_at = now + DISARM_INTERVAL
        return True

    def worth_telling(self) -> bool:
        """True the first time since the autopilot was armed."""
        first, self._told = not self._told, True
        return first
