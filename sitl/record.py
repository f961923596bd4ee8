"""The record of a run: every frame that the router saw, with the time and the port it came to."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chute_ros.protocol.mavlink.frames import FrameDecoder
from sitl.routing import message_id

#: Monotonic time s, port, length of the frame that follows.
_HEAD = struct.Struct("<dHH")


class Recorder:
    """Writes a record."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb", buffering=0)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, now: float, port: int, frame: bytes) -> None:
        """One frame."""
        self._file.write(_HEAD.pack(now, port, len(frame)) + frame)


@dataclass(frozen=True)
class Seen:
    """A message that the router passed on."""

    at: float
    port: int
    system: int
    component: int
    name: str
    message: Any


def read(path: Path, since: float, numbers: frozenset[int]) -> Iterator[Seen]:
    """The messages of these numbers since then, in their order."""
    data = path.read_bytes()
    decoder = FrameDecoder()
    position = 0
    while position + _HEAD.size <= len(data):
        at, port, length = _HEAD.unpack_from(data, position)
        position += _HEAD.size
        raw = data[position : position + length]
        position += length
        if at < since or len(raw) < length or message_id(raw) not in numbers:
            continue
        for frame in decoder.feed_datagram(raw, at):
            name = frame.message.get_type()
            yield Seen(at, port, frame.system_id, frame.component_id, name, frame.message)
