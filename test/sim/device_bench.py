"""A simulated device without any wire: what a ground station would see, in a time of our own."""

from __future__ import annotations

from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame, FrameDecoder, FrameEncoder

COMPUTER = (1, 191)


def crc(data: bytes) -> int:
    """CRC-16/MCRF4XX, bit by bit, independent of the library."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
    return value


class Station:
    """Sends to a device and keeps what it sends. now: s, moves only by run."""

    def __init__(self, device: Any) -> None:
        self.device = device
        self.now = 1000.0
        self.frames: list[Frame] = []
        self.raw: list[bytes] = []
        self.log: list[str] = []
        self._decoder = FrameDecoder()
        self.run(0.0)

    def run(self, seconds: float, step: float = 0.01) -> None:
        """Let time pass."""
        end = self.now + seconds
        while True:
            self.device.update(self.now)
            self._collect()
            if self.now >= end:
                return
            self.now = min(end, self.now + step)

    def send(self, message: Any, sender: tuple[int, int] = COMPUTER) -> None:
        """The device receives message."""
        self.device.receive(FrameEncoder(*sender).encode(message, self.now), self.now)
        self._collect()

    def command(self, number: int, *params: float, to: tuple[int, int] | None = None) -> list[int]:
        """Send COMMAND_LONG; the results of the acknowledgements that came at once."""
        target = to or (self.device.system_id, self.device.component_id)
        values = [*params, *[0.0] * (7 - len(params))]
        before = len(self.frames)
        self.send(dialect.MAVLink_command_long_message(*target, number, 0, *values))
        acks = [f.message for f in self.frames[before:] if kind(f) == "COMMAND_ACK"]
        assert all(ack.command == number for ack in acks)
        return [ack.result for ack in acks]

    def messages(self, name: str) -> list[Any]:
        """All messages of this name so far."""
        return [frame.message for frame in self.frames if kind(frame) == name]

    def newest(self, name: str) -> Any:
        """The newest of them."""
        return self.messages(name)[-1]

    def forget(self) -> None:
        """Begin to collect anew."""
        self.frames.clear()
        self.raw.clear()

    def _collect(self) -> None:
        for raw in self.device.take_output():
            self.raw.append(raw)
            self.frames += self._decoder.feed_datagram(raw, self.now)
        self.log += self.device.take_events()
        assert not any(self._decoder.counts.values()), "a device sends nothing but whole frames"


def kind(frame: Frame) -> str:
    """The name of a frame's message."""
    return str(frame.message.get_type())


def position(height: float, sink: float = 0.0) -> Any:
    """What an autopilot tells of its height (m) and how fast it falls (m/s)."""
    return dialect.MAVLink_global_position_int_message(
        0, 0, 0, 0, int(height * 1000), 0, 0, int(sink * 100), 0xFFFF
    )


def parachute_status(deployed: int) -> Any:
    """What a parachute tells of itself."""
    return dialect.MAVLink_parachute_status_message(0, 0, 0, deployed, 0, 50, b"2026-06-19")
