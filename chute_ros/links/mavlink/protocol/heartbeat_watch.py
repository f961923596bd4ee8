"""The autopilot's HEARTBEAT, which says armed, more often than once a second.

It is asked for at a higher rate (SET_MESSAGE_INTERVAL), but of PX4, which by its source ignores
that. While flight is blocked a heartbeat that is old is asked for one by one: an arming
that is seen a second later has taken off.
"""

from __future__ import annotations

import math

from chute_ros.links.mavlink.protocol.autopilot import AutopilotTracker
from chute_ros.links.mavlink.protocol.commands import Command
from chute_ros.links.mavlink.protocol.firmware import Firmware
from chute_ros.protocol.mavlink.dialect import dialect

#: Wanted between two heartbeats, s.
INTERVAL = 0.2
#: Older than this it is asked for while flight is blocked, and not more often, s.
_OLD = 0.3
#: The interval is asked for again after so long, s, so often at most for each autopilot.
_ASK_AGAIN, _MOST_ASKED = 2.0, 3


class HeartbeatWatch:
    """What to ask an autopilot for, to have its heartbeats sooner."""

    def __init__(self) -> None:
        self._asked = self._polled = -math.inf
        #: Which start of which autopilot.
        self._asked_of = ("", 0)
        self._times_asked = 0

    def due(
        self, autopilot: AutopilotTracker, rate_too: bool, blocked: bool, now: float
    ) -> list[Command]:
        """Commands to send once now. rate_too: other intervals may be asked for."""
        this_start = (autopilot.device, autopilot.reboot_count)
        if this_start != self._asked_of:
            self._asked_of, self._times_asked, self._asked = this_start, 0, -math.inf
        due: list[Command] = []
        if autopilot.liveness.age(now) <= _OLD:
            return due
        obeys = autopilot.settings.firmware is not Firmware.PX4
        again = self._times_asked < _MOST_ASKED and now >= self._asked + _ASK_AGAIN
        if rate_too and obeys and again:
            self._asked, self._times_asked = now, self._times_asked + 1
            due.append(self._interval(autopilot))
        if blocked and now >= self._polled + _OLD:
            self._polled = now
            due.append(self._one(autopilot))
        return due

    def _interval(self, autopilot: AutopilotTracker) -> Command:
        return self._command(autopilot, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, INTERVAL * 1e6)

    def _one(self, autopilot: AutopilotTracker) -> Command:
        return self._command(autopilot, dialect.MAV_CMD_REQUEST_MESSAGE, 0.0)

    def _command(self, autopilot: AutopilotTracker, number: int, param2: float) -> Command:
        params = (float(dialect.MAVLINK_MSG_ID_HEARTBEAT), param2, 0.0, 0.0, 0.0, 0.0, 0.0)
        return Command(autopilot.system_id, autopilot.component_id, number, params)
