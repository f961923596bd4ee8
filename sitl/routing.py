"""Which end of a MAVLink network gets a frame.

As mavlink-router does it: what is addressed goes where its addressee was heard, what is not goes
to all; never back to where it came from.
"""

from __future__ import annotations

import functools
import re
import struct
from collections import defaultdict
from collections.abc import Hashable, Iterable, Iterator
from typing import Generic, TypeVar

from chute_ros.protocol.mavlink.dialect import dialect

_MAGIC_V1, _MAGIC_V2 = 0xFE, 0xFD
_SIGNED = 0x01
_LONGEST = 10 + 255 + 2 + 13
End = TypeVar("End", bound=Hashable)


class FrameSplitter:
    """Whole frames out of a stream of bytes, as they are: a router changes nothing."""

    def __init__(self) -> None:
        self._buffer = b""

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The frames that data completes. What is no frame is passed over."""
        self._buffer += data
        position = 0
        while position < len(self._buffer):
            length = _length(self._buffer, position)
            if length == 0 or position + length > len(self._buffer):
                break
            if length > 0:
                yield self._buffer[position : position + length]
            position += abs(length)
        self._buffer = self._buffer[position:][-_LONGEST:]


def _length(data: bytes, position: int) -> int:
    """Of the frame that starts there; 0: too few bytes to tell; -1: none does."""
    have = len(data) - position
    if data[position] == _MAGIC_V1:
        return 6 + data[position + 1] + 2 if have >= 6 else 0
    if data[position] != _MAGIC_V2:
        return -1
    if have < 10:
        return 0
    return 10 + data[position + 1] + 2 + (13 if data[position + 2] & _SIGNED else 0)


def sender(frame: bytes) -> tuple[int, int]:
    """System and component."""
    start = 5 if frame[0] == _MAGIC_V2 else 3
    return frame[start], frame[start + 1]


def message_id(frame: bytes) -> int:
    """Of the message in it."""
    return int.from_bytes(frame[7:10], "little") if frame[0] == _MAGIC_V2 else frame[5]


def target(frame: bytes) -> tuple[int, int]:
    """System and component that it is addressed to; 0: all."""
    payload = frame[10 : 10 + frame[1]] if frame[0] == _MAGIC_V2 else frame[6 : 6 + frame[1]]
    # MAVLink 2 leaves out zeros at the end.
    system, component = (
        payload[place] if 0 <= place < len(payload) else 0 for place in _places(message_id(frame))
    )
    return system, component


@functools.cache
def _places(number: int) -> tuple[int, int]:
    """Where target_system and target_component are in a payload; -1: not in it."""
    kind = dialect.mavlink_map.get(number)
    if kind is None:
        return -1, -1
    places = {}
    layout = kind.unpacker.format
    before = ""
    tokens = re.findall(r"\d*[a-zA-Z]", layout)
    for name, token in zip(kind.ordered_fieldnames, tokens, strict=True):
        places[name] = struct.calcsize("<" + before)
        before += token
    return places.get("target_system", -1), places.get("target_component", -1)


class Routes(Generic[End]):
    """Who was heard on which end."""

    def __init__(self) -> None:
        self._heard: defaultdict[End, set[tuple[int, int]]] = defaultdict(set)

    def hear(self, end: End, frame: bytes) -> None:
        """A frame came from there."""
        self._heard[end].add(sender(frame))

    def ways(self, source: End, frame: bytes, ends: Iterable[End]) -> list[End]:
        """Of these ends, those that this frame goes to."""
        system, component = target(frame)
        return [end for end in ends if end != source and self._wants(end, system, component)]

    def _wants(self, end: End, system: int, component: int) -> bool:
        if not system:
            return True
        if component:
            return (system, component) in self._heard[end]
        return any(one == system for one, _ in self._heard[end])
