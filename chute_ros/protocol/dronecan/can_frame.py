"""A CAN frame as bytes: Linux's struct can_frame, so that a bus is a byte wire like any other.

Sixteen bytes, little endian: uint32 identifier with flags, uint8 length, three zeros, eight bytes
of data. Source: Linux, Documentation/networking/can.rst and include/uapi/linux/can.h.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from chute_ros.errors import MessageError

EXTENDED_FLAG = 0x80000000
REMOTE_FLAG = 0x40000000
ERROR_FLAG = 0x20000000
EXTENDED_MASK = 0x1FFFFFFF
STANDARD_MASK = 0x7FF
#: Classes of an error frame, in its identifier (include/uapi/linux/can/error.h).
ERROR_BUS_OFF = 0x40
ERROR_RESTARTED = 0x100

SIZE = 16
LAYOUT = struct.Struct("<IB3x8s")
MOST_DATA = 8


@dataclass(frozen=True)
class CanFrame:
    """One frame. identifier: 29 bits if extended, else 11; of an error frame, its classes."""

    identifier: int
    data: bytes
    extended: bool = True
    remote: bool = False
    error: bool = False

    def __post_init__(self) -> None:
        highest = EXTENDED_MASK if self.extended or self.error else STANDARD_MASK
        if not 0 <= self.identifier <= highest:
            raise MessageError(f"CAN identifier {self.identifier:#x}: need 0 to {highest:#x}")
        if len(self.data) > MOST_DATA:
            raise MessageError(f"{len(self.data)} bytes of CAN data: need at most {MOST_DATA}")


def pack(frame: CanFrame) -> bytes:
    """The sixteen bytes of frame."""
    identifier = frame.identifier
    identifier |= EXTENDED_FLAG if frame.extended else 0
    identifier |= REMOTE_FLAG if frame.remote else 0
    identifier |= ERROR_FLAG if frame.error else 0
    return LAYOUT.pack(identifier, len(frame.data), frame.data)


def unpack(data: bytes) -> CanFrame | None:
    """The frame in data; None if that is none."""
    if len(data) != SIZE:
        return None
    identifier, length, payload = LAYOUT.unpack(data)
    if length > MOST_DATA:
        return None
    extended, error = bool(identifier & EXTENDED_FLAG), bool(identifier & ERROR_FLAG)
    number = identifier & EXTENDED_MASK
    if number > STANDARD_MASK and not (extended or error):
        return None
    return CanFrame(number, payload[:length], extended, bool(identifier & REMOTE_FLAG), error)
