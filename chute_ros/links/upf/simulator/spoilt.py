"""What is wrong with the frames of a request: for a controller that is wrong about one of it."""

from __future__ import annotations

from itertools import pairwise

from dronecan.dsdl import common

from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.protocol.dronecan.transfer import END, START, TOGGLE, Kind

#: Bits of an identifier: a service, and its request.
_SERVICE, _REQUEST = 0x80, 0x8000


class SpoiltRequests:
    """Follows the frames on a bus, of one sender."""

    def __init__(self, types: DataTypes) -> None:
        self._types = types
        #: Of a request of several frames: what has come so far, and what came of the last one.
        self._frames: list[CanFrame] = []
        self._ended: list[CanFrame] = []

    def observe(self, data: bytes) -> str:
        """What is wrong with what this frame ends, by the name of its clause; empty: nothing."""
        frame = unpack(data)
        if frame is None or not frame.extended or not frame.data:
            return "foreign-frames"
        if not frame.identifier & _SERVICE:
            number = frame.identifier >> 8 & 0xFFFF
            known = self._types.by_id(number, Kind.MESSAGE.value)
            return "" if known else "foreign-frames"
        if not frame.identifier & _REQUEST:
            return ""
        return self._follow(frame, frame.data[-1])

    def mended(self) -> list[bytes]:
        """The frames of the last request of several, with the right CRC."""
        first, *others = self._ended
        data_type = self._types.by_id(first.identifier >> 16 & 0xFF, Kind.REQUEST.value)
        assert data_type is not None  # the kit asks for what the controller has
        payload = b"".join(one.data[:-1] for one in self._ended)[2:]
        crc = common.crc16_from_bytes(payload, initial=data_type.base_crc)
        right = CanFrame(first.identifier, bytes((crc & 0xFF, crc >> 8)) + first.data[2:])
        return [pack(one) for one in (right, *others)]

    def _follow(self, frame: CanFrame, tail: int) -> str:
        if tail & START and self._frames != [frame]:
            cut = bool(self._frames)
            self._frames = [] if tail & END else [frame]
            return "cut-transfer" if cut else ""
        if not self._frames:
            return ""
        self._frames.append(frame)
        if not tail & END:
            return ""
        self._ended, self._frames = self._frames, []
        if any(one == other for one, other in pairwise(self._ended)):
            return "doubled-frames"
        toggles = [one.data[-1] & TOGGLE for one in self._ended]
        if stuck := sum(one == other for one, other in pairwise(toggles)):
            return "lost-frame" if stuck == 1 else "reordered-frames"
        return "" if self.mended()[0] == pack(self._ended[0]) else "wrong-crc"
