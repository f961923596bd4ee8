"""Signs other than HEARTBEAT that the motors stand still after a kill.

HEARTBEAT comes once a second on some autopilots. What an autopilot says of its outputs, its ESCs,
its landing or its disarming may come sooner. Such a sign counts only after the autopilot accepted
an order to stop, and only if it is a change: an aeroplane that glides has its motor off, and is
armed.

Sources: MAVLink common.xml, SERVO_OUTPUT_RAW (us), ESC_STATUS (rpm), EXTENDED_SYS_STATE,
STATUSTEXT; ardupilotmega.xml, ESC_TELEMETRY_1_TO_4 to 9_TO_12 (rpm); the texts: ArduCopter
AP_Arming_Copter.cpp, ArduPlane AP_Arming_Plane.cpp, PX4 Commander.cpp.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect

#: A motor's output while disarmed is its lowest; a control surface stands in the middle, us.
_HIGHEST_IDLE = 1150
#: Above its value when disarmed by this much a motor is driven, us.
_DRIVEN = 20
_OUTPUTS = 16
#: How the texts begin that autopilots send as they disarm.
_DISARMED_TEXTS = ("Disarming motors", "Throttle disarmed", "Disarmed by ")
#: Speed controllers are told of in groups.
_TELEMETRY = tuple(f"ESC_TELEMETRY_{first}_TO_{first + 3}" for first in range(1, 12, 4))
#: The orders whose acceptance may let a sign count.
_STOPPING = (dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_DO_FLIGHTTERMINATION)


class MotorSigns:
    """Follows the signs of one autopilot."""

    def __init__(self) -> None:
        self._accepted, self._accepted_command = -math.inf, 0
        self._stopped = -math.inf
        self._armed = False
        #: Output (port, number) -> its value while disarmed, us.
        self._idle: dict[tuple[int, int], int] = {}
        #: Those of them that were driven in the newest message before the acceptance.
        self._driven: set[tuple[int, int]] = set()
        #: Speed controllers, in groups as they are told of -> one of the group turns.
        self._turning: dict[int, bool] = {}
        self._was_in_air = False

    def armed(self, armed: bool) -> None:
        """By the newest heartbeat."""
        self._armed = armed

    def accepted(self, command: int, now: float) -> None:
        """The autopilot accepted a command of ours."""
        if command in _STOPPING:
            self._accepted, self._accepted_command = now, command
            self._stopped = -math.inf

    def stopped_since(self, ordered: float, stopping: frozenset[int]) -> bool:
        """A sign came after the autopilot accepted one of these commands, ordered then or later:
        what stops no motor of its is accepted all the same."""
        accepted = self._accepted >= ordered and self._accepted_command in stopping
        return accepted and self._stopped >= self._accepted

    def heard(self, message: Any, now: float) -> None:
        """Any message of the autopilot."""
        kind = message.get_type()
        if kind == "SERVO_OUTPUT_RAW":
            self._outputs(message, now)
        elif kind == "ESC_STATUS":
            self._escs(message.index, message.rpm, now)
        elif kind in _TELEMETRY:
            self._escs(_TELEMETRY.index(kind), message.rpm, now)
        elif kind == "EXTENDED_SYS_STATE":
            self._landed_state(message, now)
        elif kind == "STATUSTEXT" and message.text.startswith(_DISARMED_TEXTS):
            self._stopped = now

    def _outputs(self, message: Any, now: float) -> None:
        values = {
            (message.port, number): getattr(message, f"servo{number}_raw")
            for number in range(1, _OUTPUTS + 1)
        }
        if not self._armed:
            # The lowest: the outputs of one that was armed a moment ago are told of before that.
            for at, us in values.items():
                if 0 < us <= _HIGHEST_IDLE:
                    self._idle[at] = min(us, self._idle.get(at, us))
            return
        known = [at for at in values if at in self._idle]
        driven = {at for at in known if values[at] > self._idle[at] + _DRIVEN}
        turned = bool(self._driven)
        self._driven = {at for at in self._driven if at[0] != message.port} | driven
        if turned and not self._driven:
            self._stopped = now

    def _escs(self, group: int, rpm: Iterable[int], now: float) -> None:
        turned_before = any(self._turning.values())
        self._turning[group] = any(rpm)
        if turned_before and not any(self._turning.values()):
            self._stopped = now

    def _landed_state(self, message: Any, now: float) -> None:
        in_air = message.landed_state == dialect.MAV_LANDED_STATE_IN_AIR
        grounded = message.landed_state == dialect.MAV_LANDED_STATE_ON_GROUND
        if self._was_in_air and grounded:
            self._stopped = now
        self._was_in_air = in_air or (self._was_in_air and not grounded)
