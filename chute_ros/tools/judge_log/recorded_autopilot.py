"""An autopilot that says what a log has of it, whatever it is told."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from functools import partial
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame
from chute_ros.sim.autopilot_kinds import GENERIC
from chute_ros.sim.autopilot_parameters import ParameterServer
from chute_ros.sim.mavlink_device import MavlinkDevice, Params
from chute_ros.tools.judge_log.flight_log import FlightLog

#: Before the log begins it stands there as the log first has it, s: a supervisor runs for longer
#: than that before a vehicle takes off, and many logs begin as it is armed.
LEAD = 8.0
#: What of the log is known as it begins, s; and how often it is told in the lead, s.
_BEGINNING, _TOLD_EVERY = 1.0, 0.1
#: A log whose first vertical speed is higher begins in flight, m/s.
_STANDS = 1.0
_ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED
_COMMANDS = (
    dialect.MAV_CMD_COMPONENT_ARM_DISARM,
    dialect.MAV_CMD_DO_FLIGHTTERMINATION,
)
_HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT


class RecordedAutopilot(MavlinkDevice):
    """Its time 0 is LEAD before the log begins."""

    def __init__(self, log: FlightLog) -> None:
        super().__init__(1, 1, [])
        self._log, self._next = log, 0
        self.begins_in_flight = _begins_in_flight(log)
        kind = replace(
            GENERIC,
            parameters=log.parameters,
            bytewise=log.autopilot == dialect.MAV_AUTOPILOT_PX4,
        )
        self._parameters = ParameterServer(kind)
        self._newest: dict[int, Any] = {}
        for at, message in log.messages:
            if at <= _BEGINNING:
                self._newest.setdefault(message.get_msgId(), message)
        kinds = {message.get_msgId() for _, message in log.messages}
        # Who asks for a kind gets it as often as it asks, if the log has it so often.
        self.streams = {one: partial(self._say, one) for one in sorted(kinds)}
        self.default_intervals = {one: 1.0 if one == _HEARTBEAT else math.inf for one in kinds}
        # What became of the vehicle is known, whatever it is ordered.
        self.commands |= dict.fromkeys(_COMMANDS, self._ordered)
        self._sent: dict[int, float] = {}
        self._tell_at = 0.0

    @property
    def ended(self) -> bool:
        """The log has no more."""
        return self._next >= len(self._log.messages)

    def update(self, now: float) -> None:
        """Say what is due."""
        self.now = now
        if math.isnan(self._started_at):
            self._started_at = now
            self.reboot()
        if now < LEAD:
            if now >= self._tell_at:
                self._tell_at = now + _TOLD_EVERY
                for message in self._newest.values():
                    self._send_if_due(self._standing(message))
            return
        messages = self._log.messages
        while not self.ended and messages[self._next][0] + LEAD <= now:
            message = messages[self._next][1]
            self._next += 1
            self._newest[message.get_msgId()] = message
            if self._log.as_sent:
                self.send(message)
            else:
                self._send_if_due(self._stamped(message))

    def next_deadline(self) -> float:
        if math.isnan(self._started_at):
            return 0.0
        if self.now < LEAD:
            return min(self._tell_at, LEAD)
        return math.inf if self.ended else self._log.messages[self._next][0] + LEAD

    def heard(self, frame: Frame) -> None:
        message = frame.message
        if message.get_type() not in ("PARAM_REQUEST_READ", "PARAM_SET"):
            return
        if self._log.parameters and message.target_system in (0, self.system_id):
            asking = (frame.system_id, frame.component_id)
            self.send(self._parameters.answer(message, asking))

    def _ordered(self, params: Params) -> int:
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _say(self, message_id: int) -> Any:
        return self._stamped(self._newest.get(message_id, self._first(message_id)))

    def _first(self, message_id: int) -> Any:
        messages = self._log.messages
        return next(one for _, one in messages if one.get_msgId() == message_id)

    def _send_if_due(self, message: Any) -> None:
        number = message.get_msgId()
        # A changed heartbeat goes out at once, as autopilots send it.
        interval = self._intervals[number] if number != _HEARTBEAT else 0.0
        if self.now - self._sent.get(number, -math.inf) >= interval * 0.9:
            self._sent[number] = self.now
            self.send(message)

    def _stamped(self, message: Any) -> Any:
        if self._log.as_sent:
            return message
        stamped = copy.copy(message)
        if hasattr(stamped, "time_boot_ms"):
            stamped.time_boot_ms = self.boot_ms()
        return stamped

    def _standing(self, message: Any) -> Any:
        """The same while it stood there before the log."""
        earlier = copy.copy(message)
        if hasattr(earlier, "time_boot_ms"):
            first = message.time_boot_ms if self._log.as_sent else round(LEAD * 1000.0)
            earlier.time_boot_ms = max(0, first - round((LEAD - self.now) * 1000.0))
        if message.get_msgId() == _HEARTBEAT and not self.begins_in_flight:
            earlier.base_mode &= ~_ARMED
            earlier.system_status = dialect.MAV_STATE_STANDBY
        return earlier


def _begins_in_flight(log: FlightLog) -> bool:
    for at, message in log.messages:
        if at > _BEGINNING:
            break
        kind = message.get_type()
        if kind == "EXTENDED_SYS_STATE":
            return bool(message.landed_state == dialect.MAV_LANDED_STATE_IN_AIR)
        if kind == "GLOBAL_POSITION_INT" and abs(message.vz) > _STANDS * 100.0:
            return True
    return False
