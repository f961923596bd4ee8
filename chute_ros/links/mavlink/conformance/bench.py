"""The other end of a parachute's MAVLink network: sends commands, and remembers all that comes."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from chute_ros.conformance.bench import ReceivedPacket, RecordingBench, first_of, in_words
from chute_ros.conformance.clause import DecidedError, Packet, Risk, Trial, Wait, failed
from chute_ros.links.mavlink.protocol.parachute import component_information
from chute_ros.model import TriggerFlags
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame, FrameDecoder, FrameEncoder
from chute_ros.protocol.mavlink.signing import Signer, Verifier

#: Heartbeats of our own, s: without them a router passes nothing on, and a device may stay silent.
_BEAT = 1.0
#: A device is found within this, or is not there, s.
_FOUND_WITHIN = 10.0
#: An answer comes within this, s; a command is sent so often before it counts as not answered.
ANSWER = 1.0
TRIES = 3
#: The result follows an answer IN_PROGRESS within this, s.
RESULT_WITHIN = 5.0
#: An answer that comes twice does so within this, s: it is none to the next command.
_AGAIN = 0.05
#: A status comes by its stream at the latest, s.
STATUS_WITHIN = 3.0
#: A status is streamed at nominally 1 Hz, us.
_NOMINAL = 1_000_000
_STATUS = dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS
#: Whose commands these are: an onboard computer.
US = 191
_ACTIONS = (dialect.PARACHUTE_DISABLE, dialect.PARACHUTE_ENABLE)
ARM = dialect.MAV_CMD_SET_PARACHUTE_ARM
#: Each trigger source.
EVERY = int(sum(TriggerFlags))


@dataclass(frozen=True)
class ReceivedFrame(ReceivedPacket):
    """A frame of the device. refused: why its signature is none of the device's key."""

    frame: Frame
    refused: str

    @property
    def message(self) -> Any:
        """What it says."""
        return self.frame.message


class MavlinkBench(RecordingBench[ReceivedFrame]):
    """Commands are sent as component US of the device's own system. risk: the highest that the
    person allows; nothing above it is ever sent. component: of the device, where several are on
    the network; key: signs and verifies, None: nothing is signed; soak: how long it is watched in
    the end, s."""

    def __init__(
        self,
        risk: Risk = Risk.NONE,
        component: int | None = None,
        key: tuple[Signer, Verifier] | None = None,
        soak: float = 0.0,
    ) -> None:
        super().__init__(risk)
        self.soak = soak
        self.system = self.component = 0
        self._wanted, self._key = component, key
        self._every: list[ReceivedFrame] = []
        self._decoders: dict[Hashable, FrameDecoder] = {}
        #: Of each sender, that signs or does not.
        self._encoders: dict[tuple[int, int, bool], FrameEncoder] = {}
        self._output: list[bytes] = []
        self._beat_at = -math.inf
        #: It was told to send its status otherwise than it does by itself.
        self._other_interval = False
        #: From which of heard on it was told to release; negative: it was not, or did not.
        self.released_from = -1

    # -- as the session wants it ------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        self.at(now)
        decoder = self._decoders.setdefault(stream, FrameDecoder())
        frames = decoder.feed_datagram(data, now) if stream is None else decoder.feed(data, now)
        for frame in frames:
            raw = bytes(frame.message.get_msgbuf())
            packet = self._noted(frame.message, frame.device, False, raw)
            one = ReceivedFrame(now, packet.name, packet, frame, self._refusal(frame, raw))
            self._every.append(one)
            if (frame.system_id, frame.component_id) == (self.system, self.component):
                self.heard.append(one)
                self.heard_at = now
                if one.kind == "PARACHUTE_STATUS":
                    self.device_is_up(one.message.time_boot_ms, 2.0**32)

    def _refusal(self, frame: Frame, raw: bytes) -> str:
        if self._key is None:
            return ""
        return self._key[1].refusal(raw, frame.signed, frame.message.get_msgId(), self.now)

    def stream_ended(self, stream: Hashable) -> None:
        self._decoders.pop(stream, None)

    def update(self, now: float) -> None:
        self.at(now)
        if now >= self._beat_at:
            self._beat_at = now + _BEAT
            kind = dialect.MAV_TYPE_ONBOARD_CONTROLLER
            beat = dialect.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3)
            self._output.append(self._packed(beat, (self.system or 1, US)))

    def next_deadline(self) -> float:
        return self._beat_at

    def take_output(self) -> list[bytes]:
        output, self._output = self._output, []
        return output

    # -- what is sent ---------------------------------------------------------------------------

    def send(
        self,
        message: Any,
        sender: int = US,
        version: int = 2,
        change: Callable[[bytes], Iterable[bytes]] = lambda frame: (frame,),
        signed: bool = True,
    ) -> None:
        """Send a message as this component. change: what becomes of its frame on the way."""
        self.takes(_risk_of(message), str(message))
        frame = self._packed(message, (self.system, sender), version, signed)
        for piece in change(frame):
            self._noted(message, f"{self.system}/{sender}", True, piece)
            self._output.append(piece)

    def send_bytes(self, data: bytes, what: str) -> None:
        """Send what is no frame. It must hold none."""
        self.noted(True, "", what, "", data)
        self._output.append(data)

    def command_long(
        self,
        command: int,
        *params: float,
        target: tuple[int, int] | None = None,
        confirmation: int = 0,
    ) -> Any:
        """COMMAND_LONG to the device, or to this target."""
        system, component = target or (self.system, self.component)
        padded = (*params, *[0.0] * (7 - len(params)))
        return dialect.MAVLink_command_long_message(
            system, component, command, confirmation, *padded
        )

    def command_int(self, command: int, *params: float) -> Any:
        """COMMAND_INT to the device."""
        padded = (*params, *[0.0] * (4 - len(params)))
        return dialect.MAVLink_command_int_message(
            self.system, self.component, 0, command, 0, 0, *padded, 0, 0, 0.0
        )

    def _packed(
        self, message: Any, sender: tuple[int, int], version: int = 2, signed: bool = True
    ) -> bytes:
        signer = self._key[0] if self._key is not None and signed else None
        encoder = self._encoders.get((sender[0], sender[1], signed))
        if encoder is None:
            encoder = FrameEncoder(*sender, signer)
            self._encoders[(sender[0], sender[1], signed)] = encoder
        return encoder.encode(message, self.now, version)

    @property
    def signs(self) -> bool:
        """The device has a key that is known here."""
        return self._key is not None

    def _noted(self, message: Any, sender: str, sent: bool, raw: bytes) -> Packet:
        fields = message.to_dict()
        name = fields.pop("mavpackettype")
        return self.noted(sent, sender, name, in_words(fields), bytes(raw))

    # -- steps of trials ------------------------------------------------------------------------

    def find(self) -> Trial:
        """Who says that it is a parachute, or reports as one."""
        began = self.now
        yield Wait(began + _FOUND_WITHIN, lambda: self._device() is not None)
        device = self._device()
        if device is None:
            others = ", ".join(sorted({one.frame.device for one in self._every})) or "nobody"
            raise failed(
                f"no parachute is received within {_FOUND_WITHIN:g} s (received from: {others}): "
                "check the connection, and name the device with --component if it calls itself "
                "something else"
            )
        self.system, self.component = device
        self.heard = [
            one for one in self._every if (one.frame.system_id, one.frame.component_id) == device
        ]
        self.heard_at = self.now
        # For each report, whichever clauses are tried.
        information = dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC
        answer = yield from self.command(dialect.MAV_CMD_REQUEST_MESSAGE, information, tries=1)
        if answer is not None and answer.message.result == dialect.MAV_RESULT_ACCEPTED:
            yield from self.wait_for("COMPONENT_INFORMATION_BASIC", ANSWER)
        return f"{self.system}/{self.component}"

    def _device(self) -> tuple[int, int] | None:
        for one in self._every:
            ids = one.frame.system_id, one.frame.component_id
            if self._wanted is not None:
                if ids[1] == self._wanted:
                    return ids
                continue
            beat = one.kind == "HEARTBEAT" and one.message.type == dialect.MAV_TYPE_PARACHUTE
            if beat or one.kind == "PARACHUTE_STATUS":
                return ids
        return None

    def identity(self) -> Mapping[str, str]:
        """Of its last COMPONENT_INFORMATION_BASIC and PARACHUTE_STATUS."""
        told: dict[str, str] = {}
        for one in self.heard:
            if one.kind == "COMPONENT_INFORMATION_BASIC":
                told |= asdict(component_information(one.message))
            elif one.kind == "PARACHUTE_STATUS":
                told["packed"] = one.message.parachute_packed_date
        return {name.replace("_", " "): str(text) for name, text in told.items() if text}

    def leave(self) -> Trial:
        """Its status comes as before; each trigger is disarmed, and its status says so."""
        yield from self.status_as_before()
        if self.done is Risk.NONE:
            return "nothing was armed"
        yield from self.command(ARM, 0, EVERY)
        left = yield from self._armed_sources()
        if left:
            yield from self.disarm_each()
            left = yield from self._armed_sources()
        if left is None:
            raise failed("the device: it may be LEFT ARMED: no PARACHUTE_STATUS shows it")
        if left:
            raise failed(f"the device is LEFT ARMED: arm_status is {left} after all was disarmed")
        return "disarmed"

    def _armed_sources(self) -> Any:
        """arm_status of now; None: no PARACHUTE_STATUS came."""
        try:
            status = yield from self.status()
        except DecidedError:
            return None
        return int(status.message.arm_status)

    def status_every(self, interval: int) -> Any:
        """The answer (ReceivedFrame) as PARACHUTE_STATUS is to come each so many us (-1: never,
        0: as delivered); None: none came."""
        # Until its answer has been looked at, it may have done so.
        before, self._other_interval = self._other_interval, True
        answer = yield from self.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, _STATUS, interval)
        taken = answer is not None and answer.message.result == dialect.MAV_RESULT_ACCEPTED
        self._other_interval = interval != 0 if taken else before
        return answer

    def status_as_before(self) -> Trial:
        """PARACHUTE_STATUS comes as it did before it was set otherwise here, or at 1 Hz."""
        if self._other_interval:
            answer = yield from self.status_every(0)
            taken = answer is not None and answer.message.result == dialect.MAV_RESULT_ACCEPTED
            came = yield from self.wait_for("PARACHUTE_STATUS", STATUS_WITHIN if taken else 0.0)
            if came is None:
                yield from self.status_every(_NOMINAL)
            self._other_interval = False
        return ""

    def disarm_each(self) -> Trial:
        """Each source by a command of its own: not every device takes several at once."""
        for source in TriggerFlags:
            yield from self.command(ARM, 0, int(source))
        return ""

    def command(
        self, command: int, *params: float, tries: int = TRIES, confirmation: int = 0
    ) -> Any:
        """The ReceivedFrame of its answer, sent again where none comes; None: none came."""
        for number in range(tries):
            self.send(self.command_long(command, *params, confirmation=confirmation + number))
            answer = yield from self.answer(command)
            if answer is not None:
                return answer
        return None

    def answer(self, command: int, within: float = ANSWER) -> Any:
        """The next result of this command, or IN_PROGRESS where none follows it; None: no answer
        came."""

        def answers(one: ReceivedFrame) -> bool:
            return one.kind == "COMMAND_ACK" and one.message.command == command

        since = len(self.heard)
        first = first_of(self.heard, since, answers)
        yield Wait(self.now + within, first)
        if (answer := first()) is None:
            return None
        if in_progress(answer):
            # The result may have come together with it.
            result = first_of(self.heard, since, lambda one: answers(one) and not in_progress(one))
            yield Wait(self.now + RESULT_WITHIN, result)
            answer = result() or answer
        yield from self.watch_on(_AGAIN)
        return answer

    def accepted(self, command: int, *params: float) -> Any:
        """The same; it must be accepted."""
        answer = yield from self.command(command, *params)
        if answer is None:
            raise failed(f"{entry_name('MAV_CMD', command)} is not answered, {TRIES} times")
        if answer.message.result != dialect.MAV_RESULT_ACCEPTED:
            name = entry_name("MAV_CMD", command)
            raise failed(f"{name} is answered with {result_of(answer)}")
        return answer

    def status(self) -> Any:
        """A PARACHUTE_STATUS of now (ReceivedFrame), asked for, or as it is streamed."""
        self.send(self.command_long(dialect.MAV_CMD_REQUEST_MESSAGE, _STATUS))
        status = yield from self.wait_for("PARACHUTE_STATUS", STATUS_WITHIN)
        if status is None:
            raise failed(f"no PARACHUTE_STATUS within {STATUS_WITHIN:g} s")
        return status


def _risk_of(message: Any) -> Risk:
    """What a device may do that gets it."""
    if message.get_type() not in ("COMMAND_LONG", "COMMAND_INT"):
        return Risk.NONE
    if message.command == dialect.MAV_CMD_DO_PARACHUTE:
        return Risk.ARMS if message.param1 in _ACTIONS else Risk.FIRES
    return Risk.ARMS if message.command == ARM else Risk.NONE


def entry_name(enumeration: str, number: int) -> str:
    """An entry of an enumeration of MAVLink by its name."""
    known = dialect.enums[enumeration].get(number)
    return known.name if known else f"{enumeration} {number}"


def in_progress(answer: ReceivedFrame) -> bool:
    """The result is still to come."""
    return bool(answer.message.result == dialect.MAV_RESULT_IN_PROGRESS)


def result_of(answer: ReceivedFrame) -> str:
    """The result of an answer by its name."""
    name = entry_name("MAV_RESULT", answer.message.result)
    return f"{name}, and no result within {RESULT_WITHIN:g} s" if in_progress(answer) else name


def refused(answer: ReceivedFrame | None, what: str, besides: str = "") -> str:
    """How what must not be accepted is answered. besides: told of one that is accepted."""
    if answer is None:
        raise failed(f"{what} is not answered")
    if answer.message.result == dialect.MAV_RESULT_ACCEPTED:
        raise failed(f"{what} is ACCEPTED{besides}")
    if in_progress(answer):
        raise failed(f"{what} is answered with {result_of(answer)}")
    return f"answered with {result_of(answer)}"
