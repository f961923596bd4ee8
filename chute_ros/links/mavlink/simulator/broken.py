"""A parachute that is wrong in one thing: for each clause of the conformance kit one way."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.model import DeploymentTrigger, TriggerFlags
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import MAGIC_V1, MAGIC_V2, Frame, FrameEncoder
from chute_ros.protocol.mavlink.signing import (
    REPLAYED,
    UNSIGNED,
    WRONG_SIGNATURE,
    Signer,
    Verifier,
)
from chute_ros.sim.mavlink_device import Params

_BEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT
_STATUS = dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS
_INFORMATION = dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC
_REQUEST, _SET = dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAV_CMD_SET_MESSAGE_INTERVAL
_GET = dialect.MAV_CMD_GET_MESSAGE_INTERVAL
_ARM, _DO = dialect.MAV_CMD_SET_PARACHUTE_ARM, dialect.MAV_CMD_DO_PARACHUTE
_ACCEPTED = int(dialect.MAV_RESULT_ACCEPTED)
_BY_COMMAND = TriggerFlags.FC | TriggerFlags.OFFBOARD
#: Header of a MAVLink 2 frame, the parameters before the number of a COMMAND_LONG, its number.
_NUMBER = slice(10 + 28, 10 + 30)
#: One that is confused by a frame is deaf, or silent, for so long, s.
_AFTER_DOUBLED, _AFTER_LOST, _AFTER_NOISE, _AFTER_CUT, _AFTER_V1 = 0.9, 2.9, 3.0, 3.3, 4.1
#: It falls silent this long after its start, for so long, s.
_PAUSES_AT, _PAUSES_FOR = 50.0, 5.0


#: Clause -> the refusal of a frame that is overlooked.
_OVERLOOKED = {
    "unsigned-refused": UNSIGNED,
    "wrong-key-refused": WRONG_SIGNATURE,
    "replay-refused": REPLAYED,
}


class _Careless(Verifier):
    """A verifier that overlooks one cause to refuse a frame."""

    def __init__(self, right: Verifier, overlooks: str) -> None:
        self._right, self._overlooks = right, overlooks

    def refusal(self, raw: bytes, signed: bool, message_id: int, now: float) -> str:
        why = self._right.refusal(raw, signed, message_id, now)
        return "" if why == self._overlooks else why


class BrokenParachute(ParachuteDevice):
    """breaks: a name of BREAKS."""

    def __init__(
        self, settings: ParachuteSettings, script: list[tuple[float, str]], breaks: str
    ) -> None:
        super().__init__(settings, script)
        self._breaks = breaks
        self._deaf_until = self._dumb_until = -math.inf
        #: What came last, whether it was understood, and the number of the newest frame.
        self._last, self._understood, self._newest = b"", False, -1
        self._first_sender: tuple[int, int] | None = None
        #: What is sent later, and when.
        self._later: list[tuple[float, Any]] = []
        BREAKS[breaks](self)

    # -- what comes -----------------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        again, self._last, self._understood = data == self._last, data, False
        if self._breaks == "lost-frames" and self._misses(data):
            self._deaf_until = now + _AFTER_LOST
        if now >= self._deaf_until and not self._overtaken(data):
            super().receive(data, now, stream)
        mark = data[0] if data else 0
        if self._breaks == "doubled-frame" and again:
            self._deaf_until = now + _AFTER_DOUBLED
        elif self._breaks == "noise" and mark not in (MAGIC_V1, MAGIC_V2):
            self._deaf_until = now + _AFTER_NOISE
        elif self._breaks == "cut-frame" and mark == MAGIC_V2 and len(data) < 12 + data[1]:
            self._deaf_until = now + _AFTER_CUT
        elif self._breaks == "mavlink-1" and mark == MAGIC_V1:
            self._dumb_until = now + _AFTER_V1
        elif self._breaks == "damaged-frame" and not self._understood:
            self._answer_all_the_same(int.from_bytes(data[_NUMBER], "little"))

    def _answer_all_the_same(self, command: int) -> None:
        if command == _REQUEST:
            self.send(dialect.MAVLink_command_ack_message(command, _ACCEPTED))

    def _misses(self, data: bytes) -> bool:
        """Half of all numbers of frames are left out before this one of the first sender."""
        if data[:1] != bytes([MAGIC_V2]) or (data[5], data[6]) != self._first_sender:
            return False
        before, self._newest = self._newest, data[4]
        return before >= 0 and (data[4] - before) % 256 == 129

    def _overtaken(self, data: bytes) -> bool:
        if self._breaks != "reordered-frames" or data[:1] != bytes([MAGIC_V2]):
            return False
        before, self._newest = self._newest, data[4]
        return (before - data[4]) % 256 == 1

    def heard(self, frame: Frame) -> None:
        self._understood = True
        super().heard(frame)

    def is_meant(self, command: Any) -> bool:
        self._understood = True
        target = command.target_system, command.target_component
        if self._breaks == "other-component":
            return target[0] in (0, self.system_id)
        if self._breaks == "other-system":
            return target[1] in (0, self.component_id)
        if self._breaks == "to-all":
            return target == (self.system_id, self.component_id)
        return super().is_meant(command)

    def carry_out(self, command: Any) -> int:
        if self._breaks == "arm-nan" and math.isnan(command.param1):
            return _ACCEPTED
        return super().carry_out(command)

    # -- what is sent ---------------------------------------------------------------------------

    def acknowledge(self, frame: Frame, result: int) -> None:
        message, sender = frame.message, (frame.system_id, frame.component_id)
        self._first_sender = self._first_sender or sender
        silent = {
            "two-senders": sender != self._first_sender,
            "sent-again": getattr(message, "confirmation", 0) > 0,
            "command-int": message.get_type() == "COMMAND_INT",
        }
        if silent.get(self._breaks, False):
            return
        if self._breaks == "answer-addressed":
            self.send(dialect.MAVLink_command_ack_message(message.command, result))
            return
        unknown = result == dialect.MAV_RESULT_UNSUPPORTED
        if self._breaks == "unknown-command" and unknown:
            result = _ACCEPTED
        super().acknowledge(frame, result)
        if self._breaks == "one-answer":
            super().acknowledge(frame, int(dialect.MAV_RESULT_FAILED))

    def send(self, message: Any, version: int = 2) -> None:
        up = self.now - self.booted_at
        pauses = self._breaks == "soak" and _PAUSES_AT <= up < _PAUSES_AT + _PAUSES_FOR
        if self.now < self._dumb_until or pauses:
            return
        if self._breaks == "sequence":
            self.encoder = FrameEncoder(self.system_id, self.component_id)
        old = self._breaks == "mavlink-2" and message.get_msgId() == _BEAT
        super().send(message, 1 if old else version)

    def pause(self, message_id: int, paused: bool) -> None:
        """It does not come, or comes again from now on."""
        self._due[message_id] = math.inf if paused else self.now

    def send_later(self, after: float, message: Any) -> None:
        """So many s from now."""
        self._later.append((self.now + after, message))

    def step(self, now: float) -> None:
        due = [message for at, message in self._later if at <= now]
        self._later = [(at, message) for at, message in self._later if at > now]
        for message in due:
            self.send(message)

    def next_step(self) -> float:
        return min((at for at, _ in self._later), default=math.inf)

    def sign(self, signer: Signer, verifier: Verifier) -> None:
        encoder = self.encoder
        super().sign(signer, verifier)
        if self._breaks == "signed-answers":
            self.encoder = encoder
        elif self._breaks in _OVERLOOKED:
            self.verifier = _Careless(verifier, _OVERLOOKED[self._breaks])


def simulated_parachute(
    settings: ParachuteSettings, script: list[tuple[float, str]], breaks: str
) -> ParachuteDevice:
    """A simulated parachute. breaks: a name of BREAKS; empty: it is sound."""
    if breaks:
        return BrokenParachute(settings, script, breaks)
    return ParachuteDevice(settings, script)


# -- the ways -------------------------------------------------------------------------------------


def _rare(message_id: int, device: BrokenParachute) -> None:
    device.default_intervals[message_id] = 4.0


def _says(
    message_id: int, change: Callable[[BrokenParachute, Any], None], device: BrokenParachute
) -> None:
    """What it sends is another."""
    make = device.streams[message_id]

    def changed() -> Any:
        message = make()
        change(device, message)
        return message

    device.streams[message_id] = changed


def _field(message_id: int, name: str, value: Any) -> Callable[[BrokenParachute], None]:
    return partial(_says, message_id, lambda _, message: setattr(message, name, value))


def _bits(name: str, bits: int) -> Callable[[BrokenParachute], None]:
    """Set in a field of its status besides."""

    def change(_: BrokenParachute, message: Any) -> None:
        setattr(message, name, getattr(message, name) | bits)

    return partial(_says, _STATUS, change)


def _its_height(device: BrokenParachute, message: Any) -> None:
    message.ats_arm_altitude = device.boot_ms() // 1000 % 2


def _seconds(_: BrokenParachute, message: Any) -> None:
    message.time_boot_ms //= 1000


def _released_at_first(device: BrokenParachute, message: Any) -> None:
    if device.boot_ms() < 5000:
        message.deployment_status = 9


def _answers(
    command: int,
    when: Callable[[BrokenParachute, Params], bool],
    then: Callable[[BrokenParachute, Params], None],
    device: BrokenParachute,
) -> None:
    """A command is accepted, and something else is done."""
    right = device.commands[command]

    def handle(params: Params) -> int:
        if not when(device, params):
            return right(params)
        then(device, params)
        return _ACCEPTED

    device.commands[command] = handle


def _wrong(
    command: int,
    when: Callable[[BrokenParachute, Params], bool] = lambda device, params: True,
    then: Callable[[BrokenParachute, Params], None] = lambda device, params: None,
) -> Callable[[BrokenParachute], None]:
    return partial(_answers, command, when, then)


def _unknown_message(device: BrokenParachute, params: Params) -> bool:
    return int(params[0]) not in device.streams and int(params[0]) != 244


def _of_status(device: BrokenParachute, params: Params) -> bool:
    return int(params[0]) == int(_STATUS)


def _default_wanted(device: BrokenParachute, params: Params) -> bool:
    return _of_status(device, params) and not params[1]


def _late_information(device: BrokenParachute) -> None:
    """It comes so late that who asked has gone on."""

    def later(of: BrokenParachute, params: Params) -> None:
        of.send_later(0.6, of.streams[_INFORMATION]())

    _answers(_REQUEST, lambda of, params: int(params[0]) == _INFORMATION, later, device)


def _set_without_effect(device: BrokenParachute) -> None:
    """It tells the interval that was set, and goes on as before."""
    told: dict[int, float] = {}

    def keep(_: BrokenParachute, params: Params) -> None:
        told[int(params[0])] = params[1]

    def tell(of: BrokenParachute, params: Params) -> None:
        interval = int(told[_STATUS])
        of.after_acknowledgement.append(
            dialect.MAVLink_message_interval_message(_STATUS, interval)
        )

    _answers(_SET, lambda of, params: _of_status(of, params) and params[1] > 0, keep, device)
    _answers(_GET, lambda of, params: _STATUS in told, tell, device)


def _stops_all(device: BrokenParachute) -> None:
    """An interval of -1 stops the heartbeat, too, until another one is set."""
    right = device.commands[_SET]

    def handle(params: Params) -> int:
        device.pause(_BEAT, params[1] == -1)
        return right(params)

    device.commands[_SET] = handle


def _another_interval(of: BrokenParachute, params: Params) -> None:
    of.after_acknowledgement.append(dialect.MAVLink_message_interval_message(_STATUS, 1_000_000))


def _arms(device: BrokenParachute, mask: float) -> None:
    device.armed = TriggerFlags(int(mask))


def _keeps_the_controllers(device: BrokenParachute, _: Params) -> None:
    device.armed &= TriggerFlags.FC


def _is_autopilot(device: BrokenParachute) -> None:
    device.component_id = dialect.MAV_COMP_ID_AUTOPILOT1
    device.encoder = FrameEncoder(device.system_id, device.component_id)


def _forgets(device: BrokenParachute) -> None:
    """What was released, as it is disarmed."""
    right = device.commands[_ARM]

    def handle(params: Params) -> int:
        if not params[0]:
            device.deployment = DeploymentTrigger.NONE
        return right(params)

    device.commands[_ARM] = handle


def _releases_anyway(of: BrokenParachute, params: Params) -> None:
    of.deploy(DeploymentTrigger.MAVLINK)


def _release_wanted(device: BrokenParachute, params: Params) -> bool:
    return int(params[0]) == int(dialect.PARACHUTE_RELEASE)


def _disarmed(device: BrokenParachute, params: Params) -> bool:
    return _release_wanted(device, params) and not device.armed


def _armed(device: BrokenParachute, params: Params) -> bool:
    return _release_wanted(device, params) and bool(device.armed & _BY_COMMAND)


def _armed_otherwise(device: BrokenParachute, params: Params) -> bool:
    return _release_wanted(device, params) and device.armed == TriggerFlags.ATS


def _in_itself(_: BrokenParachute) -> None:
    """By its name, in the methods above."""


#: Clause -> what makes a sound device break it.
BREAKS: dict[str, Callable[[BrokenParachute], None]] = {
    "heartbeat-rate": partial(_rare, _BEAT),
    "heartbeat-constant": _stops_all,
    "heartbeat-type": _field(_BEAT, "type", dialect.MAV_TYPE_ONBOARD_CONTROLLER),
    "heartbeat-fields": _field(_BEAT, "autopilot", dialect.MAV_AUTOPILOT_GENERIC),
    "component-id": _is_autopilot,
    "request-status": _wrong(_REQUEST, _of_status),
    "request-information": _late_information,
    "information-texts": _field(_INFORMATION, "_vendor_name_raw", b""),
    "information-serial": _field(_INFORMATION, "_serial_number_raw", b"\x01\x02"),
    "information-date": _field(_INFORMATION, "time_manufacture_s", 20_250_615),
    "information-time": _field(_INFORMATION, "time_boot_ms", 0),
    "request-unknown": _wrong(_REQUEST, _unknown_message),
    "status-rate": partial(_rare, _STATUS),
    "set-interval": _set_without_effect,
    "interval-told": _wrong(_GET, _of_status, _another_interval),
    "interval-default": _wrong(_SET, _default_wanted),
    "interval-stop": _wrong(_SET, lambda device, params: params[1] == -1),
    "interval-unknown": _wrong(_SET, _unknown_message),
    "boot-time": partial(_says, _STATUS, _seconds),
    "error-flags": _bits("error_status", 1 << 14),
    "deployment-value": partial(_says, _STATUS, _released_at_first),
    "safety-flags": _bits("safety_status", 1 << 3),
    "ground-flags": _bits("safety_status", 0b11),
    "arm-altitude": partial(_says, _STATUS, _its_height),
    "packed-date": _field(_STATUS, "_parachute_packed_date_raw", b"19.06.2026"),
    **dict.fromkeys(
        (
            "unknown-command",
            "other-component",
            "other-system",
            "to-all",
            "answer-addressed",
            "two-senders",
            "command-int",
            "one-answer",
            "sent-again",
            "doubled-frame",
            "lost-frames",
            "reordered-frames",
            "noise",
            "damaged-frame",
            "cut-frame",
            "mavlink-2",
            "mavlink-1",
            "sequence",
            "unsigned-refused",
            "wrong-key-refused",
            "replay-refused",
            "signed-answers",
            "soak",
            "arm-nan",
        ),
        _in_itself,
    ),
    "arm-sources": _wrong(
        _ARM, lambda device, params: params[:2] == (TriggerFlags.GEOFENCE, TriggerFlags.GEOFENCE)
    ),
    "arm-mask": _wrong(
        _ARM,
        lambda device, params: 0 < params[1] < 256 and 0 <= params[0] < 256,
        lambda device, params: _arms(device, params[0]),
    ),
    "arm-nothing": _wrong(
        _ARM,
        lambda device, params: not params[1],
        lambda device, params: _arms(device, params[0]),
    ),
    "arm-unknown": _wrong(_ARM, lambda device, params: params[0] > 255),
    "disarm-all": _wrong(
        _ARM, lambda device, params: params[:2] == (0, 255), _keeps_the_controllers
    ),
    "automatic-release": _wrong(_DO, lambda device, params: params[0] == dialect.PARACHUTE_ENABLE),
    "wrong-action": _wrong(_DO, lambda device, params: params[0] > 2),
    "release-disarmed": _wrong(_DO, _disarmed, _releases_anyway),
    "release-other-source": _wrong(_DO, _armed_otherwise, _releases_anyway),
    "release-near-ground": _wrong(_DO, _armed, _releases_anyway),
    "release": _wrong(_DO, _armed),
    "released-stays": _forgets,
}
