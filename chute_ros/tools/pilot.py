"""The pilot of simulated flights: arms, takes off, lands, breaks a motor, over MAVLink."""

from __future__ import annotations

import time

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame, FrameDecoder, FrameEncoder
from chute_ros.transport.address import parse_address
from chute_ros.transport.udp import UdpWire

_GROUND_STATION = (255, 190)


class Pilot:
    """Speaks to one autopilot (system_id/1) at connection."""

    def __init__(self, connection: str, system_id: int) -> None:
        self._wire = UdpWire(parse_address(connection))
        self._wire.open()
        self._system_id = system_id
        self._encoder = FrameEncoder(*_GROUND_STATION)
        self._decoder = FrameDecoder()
        self.results: dict[int, int] = {}

    def arm(self) -> None:
        """Arm the motors."""
        self._command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def disarm(self) -> None:
        """Stop the motors, on the ground."""
        self._command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)

    def land(self) -> None:
        """Come down, and stop the motors."""
        self._command(dialect.MAV_CMD_NAV_LAND)

    def take_off(self, height: float) -> None:
        """Climb to height, m."""
        self._command(dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height)

    def fail_motor(self) -> None:
        """Let a motor fail (MAV_CMD_INJECT_FAILURE)."""
        motor, off = dialect.FAILURE_UNIT_SYSTEM_MOTOR, dialect.FAILURE_TYPE_OFF
        self._command(dialect.MAV_CMD_INJECT_FAILURE, float(motor), float(off))

    def accepted(self, command: int) -> bool:
        """The autopilot has accepted this MAV_CMD since it was last sent."""
        self._read()
        return bool(self.results.get(command) == dialect.MAV_RESULT_ACCEPTED)

    def _read(self) -> None:
        now = time.monotonic()
        for file in self._wire.files():
            while datagrams := self._wire.read(file):
                for data, _ in datagrams:
                    self._hear(self._decoder.feed_datagram(data, now))

    def _hear(self, frames: list[Frame]) -> None:
        for frame in frames:
            if frame.message.get_type() == "COMMAND_ACK":
                self.results[frame.message.command] = frame.message.result

    def close(self) -> None:
        """Close the socket."""
        self._wire.close()

    def _command(self, number: int, *params: float) -> None:
        # Telemetry that nobody reads between two orders leaves no room for the answer.
        self._read()
        self.results.pop(number, None)
        values = [*params, *[0.0] * (7 - len(params))]
        message = dialect.MAVLink_command_long_message(self._system_id, 1, number, 0, *values)
        self._wire.write(self._encoder.encode(message, time.monotonic()))
