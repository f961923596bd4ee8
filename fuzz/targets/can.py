"""What carries CAN frames: packets of the UDP multicast, lines of a serial adapter (slcan)."""

from __future__ import annotations

import logging
import struct
from binascii import crc_hqx
from typing import Any

from can.interfaces.slcan import slcanBus

from chute_ros.protocol.dronecan.can_frame import unpack
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_bus import CanBusWire
from chute_ros.transport.can_multicast import CanMulticastWire
from fuzz.target import Target, WrongError

_HERE = "127.0.0.1"
#: Ends what was not a whole line, and a frame behind it.
_GOOD, _GOOD_FRAME = b"\r\rT0000000a1ff\r", b"\x0a\0\0\x80\x01"


class Multicast:
    """Packets, each with the right mark and CRC and then as it is."""

    def __init__(self) -> None:
        self._wire = CanMulticastWire(parse_can_address("mcast:0"))
        # What came from this host before is not asked for again.
        self._wire._here.add(_HERE)

    def held(self) -> object:
        return self._wire

    def feed(self, data: bytes) -> None:
        mended = struct.pack("<HH", 0x2934, crc_hqx(data, 0xFFFF)) + data
        for packet in (mended, data):
            before = sum(self._wire.counts.values())
            frame = self._wire._frame(packet, _HERE)
            dropped = sum(self._wire.counts.values()) - before
            if dropped != (frame is None):
                raise WrongError(f"{frame!r} came of it, and {dropped} packets were counted")
            if frame is not None and unpack(frame) is None:
                raise WrongError(f"{frame.hex()} is no CAN frame")


class Slcan:
    """Any bytes of an adapter; the first says in which pieces they come."""

    def __init__(self) -> None:
        self._wire = CanBusWire(parse_can_address("slcan:loop://"))
        # It would complain of each that is not shut down; there is nothing to shut down.
        logging.getLogger("can").setLevel(logging.CRITICAL)
        port = slcanBus("loop://", sleep_after_open=0.0, timeout=0.0)
        self._far: Any = port.serialPortOrig
        self._wire._bus = port
        self._empty()

    def held(self) -> object:
        return self._wire

    def feed(self, data: bytes) -> None:
        piece = data[0] + 1 if data else 1
        for start in range(1, len(data), piece):
            self._far.write(data[start : start + piece])
            self._take(_lines(data[start : start + piece]))
        # What was not a whole line must not hold back the next one.
        self._far.write(_GOOD)
        came = self._take(_lines(_GOOD))
        if not came or came[-1][:5] != _GOOD_FRAME:
            raise WrongError(f"a good line after it was not heard: {came!r}")

    def _take(self, lines: int) -> list[bytes]:
        """The frames that came; each look takes at most one line."""
        frames = [self._wire._take_one(0.0) for _ in range(lines)]
        if self._far.in_waiting:
            raise WrongError(f"{self._far.in_waiting} bytes were not taken in {lines} looks")
        for frame in frames:
            if frame and unpack(frame) is None:
                raise WrongError(f"{frame.hex()} is no CAN frame")
        return [frame for frame in frames if frame]

    def _empty(self) -> None:
        """What was written to open the channel came back."""
        self._far.reset_input_buffer()


def _lines(data: bytes) -> int:
    """The lines in data; one more that is not whole."""
    return data.count(b"\r") + data.count(b"\a") + 1


TARGETS = (
    Target(
        "can.multicast", "packets of CAN over UDP multicast, CRC mended", Multicast, longest=96
    ),
    Target("can.slcan", "lines of a serial CAN adapter", Slcan, longest=512),
)
