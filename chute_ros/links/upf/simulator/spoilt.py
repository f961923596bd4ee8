"""What is wrong with the frames of a request: for a node that is wrong about one of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from chute_ros.protocol.dronecan.can_frame import CanFrame, unpack
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.protocol.dronecan.transfer import (
    END,
    START,
    TOGGLE,
    TransferKind,
    frames_of,
    head_of,
)

#: The names of the clauses.
WIRE_BREAKS = (
    *("lost-frame", "reordered-frames", "doubled-frames"),
    *("cut-transfer", "wrong-crc", "foreign-frames"),
)


class SpoiltRequests:
    """Follows the frames on a bus, each sender's by themselves."""

    def __init__(self, types: DataTypes) -> None:
        self._types = types
        #: Of a request of several frames: what has come so far of each sender, and what came of
        #: the last one.
        self._under_way: dict[int, list[CanFrame]] = {}
        self._ended: list[CanFrame] = []

    def observe(self, data: bytes, node: int) -> str:
        """What is wrong with what this frame ends, by the name of its clause; empty: nothing, or
        it is a request to another node."""
        frame = unpack(data)
        if frame is None or not frame.extended or not frame.data:
            return "foreign-frames"
        head = head_of(frame)
        if head.kind is TransferKind.MESSAGE:
            known = self._types.by_id(head.type_id, head.kind.value)
            return "" if known else "foreign-frames"
        to_it = head.kind is TransferKind.REQUEST and head.destination == node
        return self._follow(head.source, frame, frame.data[-1]) if to_it else ""

    def mended(self) -> list[CanFrame]:
        """The frames of the last request of several, with the right CRC."""
        head = head_of(self._ended[0])
        data_type = self._types.by_id(head.type_id, head.kind.value)
        assert data_type is not None  # the kit asks for what the controller has
        payload = b"".join(one.data[:-1] for one in self._ended)[2:]
        return frames_of(replace(head, payload=payload), data_type.base_crc)

    def _follow(self, source: int, frame: CanFrame, tail: int) -> str:
        frames = self._under_way.get(source, [])
        if tail & START and frames != [frame]:
            self._under_way[source] = [] if tail & END else [frame]
            return "cut-transfer" if frames else ""
        if not frames:
            return ""
        frames.append(frame)
        if not tail & END:
            return ""
        self._ended, self._under_way[source] = frames, []
        if any(one == other for one, other in pairwise(self._ended)):
            return "doubled-frames"
        toggles = [one.data[-1] & TOGGLE for one in self._ended]
        if stuck := sum(one == other for one, other in pairwise(toggles)):
            return "lost-frame" if stuck == 1 else "reordered-frames"
        return "" if self.mended() == self._ended else "wrong-crc"
