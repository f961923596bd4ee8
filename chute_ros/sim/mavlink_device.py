"""What every simulated MAVLink device does: streams at set intervals, commands, acknowledgements.

Pure like the protocols: it is run by the same loop and knows neither sockets nor the clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame, FrameDecoder, FrameEncoder
from chute_ros.protocol.mavlink.signing import Signer, Verifier
from chute_ros.sim.acting import Actor, Script

Params = tuple[float, float, float, float, float, float, float]


class MavlinkDevice(Actor):
    """A component with streams and commands. The subclass fills streams, commands and actions."""

    def __init__(self, system_id: int, component_id: int, script: list[tuple[float, str]]) -> None:
        super().__init__()
        self.system_id, self.component_id = system_id, component_id
        self.now = 0.0
        self.booted_at = math.nan
        #: The device reads, but answers no command.
        self.mute = False
        #: The device sends nothing at all.
        self.silent = False
        #: Message id -> how it is made.
        self.streams: dict[int, Callable[[], Any]] = {}
        #: Message id -> interval as delivered, s; infinity: only on request.
        self.default_intervals: dict[int, float] = {}
        #: MAV_CMD -> what it does; returns a MAV_RESULT.
        self.commands: dict[int, Callable[[Params], int]] = {
            dialect.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            dialect.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_message_interval,
        }
        self.actions = {
            "mute": lambda _: setattr(self, "mute", True),
            "unmute": lambda _: setattr(self, "mute", False),
            "silent": lambda _: setattr(self, "silent", True),
            "speak": lambda _: setattr(self, "silent", False),
            "reboot": lambda _: self.reboot(),
        }
        self._script = Script(script)
        self._started_at = math.nan
        self._intervals: dict[int, float] = {}
        self._due: dict[int, float] = {}
        self.encoder = FrameEncoder(system_id, component_id)
        self.verifier: Verifier | None = None
        self._decoders: dict[Hashable, FrameDecoder] = {}
        self.after_acknowledgement: list[Any] = []
        self._output: list[bytes] = []

    # -- as the loop wants it -------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        if math.isnan(self._started_at):
            self.update(now)
        self.now = now
        decoder = self._decoders.setdefault(stream, FrameDecoder(self.verifier))
        frames = decoder.feed_datagram(data, now) if stream is None else decoder.feed(data, now)
        for frame in frames:
            if frame.message.get_type() not in ("COMMAND_LONG", "COMMAND_INT"):
                self.heard(frame)
            elif self.is_meant(frame.message):
                self._command(frame)

    def stream_ended(self, stream: Hashable) -> None:
        if stream is None:
            self._decoders.clear()
        else:
            self._decoders.pop(stream, None)

    def update(self, now: float) -> None:
        self.now = now
        if math.isnan(self._started_at):
            self._started_at = now
            self.reboot()
        for action in self._script.take_due(now):
            self.act(action)
        self.step(now)
        for message_id, due in list(self._due.items()):
            if now >= due:
                self.send(self.streams[message_id]())
                self._due[message_id] = max(due + self._intervals[message_id], now)

    def next_deadline(self) -> float:
        if math.isnan(self._started_at):
            return 0.0
        return min([self._script.next_deadline(), self.next_step(), *self._due.values()])

    def take_output(self) -> list[bytes]:
        output, self._output = self._output, []
        return output

    def sign(self, signer: Signer, verifier: Verifier) -> None:
        """From now on sign what is sent, and accept only signed frames."""
        self.encoder = FrameEncoder(self.system_id, self.component_id, signer)
        self.verifier = verifier
        self._decoders.clear()

    # -- for the subclass -----------------------------------------------------------------------

    def step(self, now: float) -> None:
        """Move the device's own world on to now."""

    def next_step(self) -> float:
        """When step has something to do."""
        return math.inf

    def heard(self, frame: Frame) -> None:
        """A message that is no command came."""

    def reboot(self) -> None:
        """Start anew: clock, streams and what the subclass adds."""
        self.booted_at = self.now
        self.mute = self.silent = False
        self._intervals = dict(self.default_intervals)
        self._due = {i: self.now for i, every in self._intervals.items() if every < math.inf}
        self.say("started")

    def boot_ms(self) -> int:
        """Time since start, ms, as uint32."""
        return int((self.now - self.booted_at) * 1000.0) % 2**32

    def send(self, message: Any, version: int = 2) -> None:
        """Send a message, unless silent. version: of MAVLink."""
        if not self.silent:
            self._output.append(self.encoder.encode(message, self.now, version))

    # -- commands -------------------------------------------------------------------------------

    def is_meant(self, command: Any) -> bool:
        """Whether a command is for this component."""
        systems, components = (0, self.system_id), (0, self.component_id)
        return command.target_system in systems and command.target_component in components

    def _command(self, frame: Frame) -> None:
        if self.mute:
            return
        self.acknowledge(frame, self.carry_out(frame.message))
        for later in self.after_acknowledgement:
            self.send(later)
        self.after_acknowledgement.clear()

    def carry_out(self, command: Any) -> int:
        """Do what a command for this component says; a MAV_RESULT."""
        handler = self.commands.get(command.command)
        if handler is None:
            return int(dialect.MAV_RESULT_UNSUPPORTED)
        if command.get_type() == "COMMAND_INT":
            return int(dialect.MAV_RESULT_COMMAND_LONG_ONLY)
        if not math.isfinite(command.param1) or not math.isfinite(command.param2):
            return int(dialect.MAV_RESULT_DENIED)
        params: Any = tuple(getattr(command, f"param{number}") for number in range(1, 8))
        return handler(params)

    def acknowledge(self, frame: Frame, result: int) -> None:
        """Answer a command with this MAV_RESULT, unless mute."""
        if self.mute:
            return
        self.send(
            dialect.MAVLink_command_ack_message(
                frame.message.command,
                result,
                target_system=frame.system_id,
                target_component=frame.component_id,
            )
        )

    def _request_message(self, params: Params) -> int:
        message_id = int(params[0])
        if message_id == dialect.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            return self._get_message_interval((params[1], *params[1:]))
        if message_id not in self.streams:
            return int(dialect.MAV_RESULT_DENIED)
        self.after_acknowledgement.append(self.streams[message_id]())
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _set_message_interval(self, params: Params) -> int:
        message_id, interval_us = int(params[0]), params[1]
        if message_id not in self.streams or interval_us < -1:
            return int(dialect.MAV_RESULT_DENIED)
        if message_id == dialect.MAVLINK_MSG_ID_HEARTBEAT and interval_us == -1:
            return int(dialect.MAV_RESULT_DENIED)  # it flows constantly
        self._due.pop(message_id, None)
        if interval_us == -1:
            self._intervals[message_id] = math.inf
            return int(dialect.MAV_RESULT_ACCEPTED)
        default = self.default_intervals[message_id]
        interval = default if interval_us == 0 else max(interval_us / 1e6, 0.005)
        self._intervals[message_id] = interval
        if interval < math.inf:
            self._due[message_id] = self.now + interval
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _get_message_interval(self, params: Params) -> int:
        message_id = int(params[0])
        if message_id not in self.streams:
            return int(dialect.MAV_RESULT_DENIED)
        interval = self._intervals.get(message_id, math.inf)
        interval_us = -1 if interval == math.inf else int(interval * 1e6)
        self.after_acknowledgement.append(
            dialect.MAVLink_message_interval_message(message_id, interval_us)
        )
        return int(dialect.MAV_RESULT_ACCEPTED)
