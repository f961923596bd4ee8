"""Faults between a device and its wire: packets lost, delayed, doubled, corrupted. Seeded."""

from __future__ import annotations

import heapq
import random
from collections.abc import Hashable
from dataclasses import dataclass
from itertools import count
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.transport.loop import ProtocolLink


@dataclass(frozen=True)
class FaultKnobs:
    """Probabilities, 0 to 1 a packet and direction, and the longest random delay in s."""

    loss: float = 0.0
    duplicate: float = 0.0
    corrupt: float = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            highest, need = (60.0, "0 to 60 s") if name == "delay" else (1.0, "0 to 1")
            if not 0.0 <= value <= highest:
                raise ParameterError(f"{name} is {value}: need {need}")


def flip_a_byte(data: bytes, chance: random.Random) -> bytes:
    """data, 1 byte or more, with one byte that is another."""
    copy = bytearray(data)
    copy[chance.randrange(len(copy))] ^= chance.randrange(1, 256)
    return bytes(copy)


class FaultyLink:
    """Stands between a loop and a device's link, and spoils what passes in both directions."""

    def __init__(self, link: ProtocolLink, knobs: FaultKnobs, seed: int) -> None:
        self._link, self._knobs = link, knobs
        self._random = random.Random(seed)
        self._order = count()
        self._now = 0.0
        self._incoming: list[tuple[float, int, bytes, Hashable]] = []
        self._outgoing: list[tuple[float, int, bytes]] = []

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        self._now = now
        for when, spoiled in self._spoil(data, now):
            heapq.heappush(self._incoming, (when, next(self._order), spoiled, stream))
        self._pass_in(now)

    def stream_ended(self, stream: Hashable) -> None:
        self._link.stream_ended(stream)

    def update(self, now: float) -> None:
        self._now = now
        self._pass_in(now)
        self._link.update(now)
        for frame in self._link.take_output():
            for when, spoiled in self._spoil(frame, now):
                heapq.heappush(self._outgoing, (when, next(self._order), spoiled))

    def next_deadline(self) -> float:
        waiting = [heap[0][0] for heap in (self._incoming, self._outgoing) if heap]
        return min([self._link.next_deadline(), *waiting])

    def take_output(self) -> list[bytes]:
        frames = []
        while self._outgoing and self._outgoing[0][0] <= self._now:
            frames.append(heapq.heappop(self._outgoing)[2])
        return frames

    def take_events(self) -> list[Any]:
        return self._link.take_events()

    def _pass_in(self, now: float) -> None:
        while self._incoming and self._incoming[0][0] <= now:
            _, _, data, stream = heapq.heappop(self._incoming)
            self._link.receive(data, now, stream)

    def _spoil(self, data: bytes, now: float) -> list[tuple[float, bytes]]:
        knobs, chance = self._knobs, self._random.random
        if chance() < knobs.loss:
            return []
        copies = 2 if chance() < knobs.duplicate else 1
        spoiled = []
        for _ in range(copies):
            copy = data
            if data and chance() < knobs.corrupt:
                copy = flip_a_byte(data, self._random)
            spoiled.append((now + chance() * knobs.delay, copy))
        return spoiled
