"""The outbound queue of a simulated flight computer: short, and what does not fit is cut."""

from __future__ import annotations

import math
import random
from collections import deque

CHUNK = 64  # bytes, a USB packet
CAPACITY = 32  # chunks


class OutboundQueue:
    """Lines go in as chunks, chunks go out at a rate. cut, garbage: probabilities for a line."""

    def __init__(self, packet_rate: float, cut: float, garbage: float, seed: int) -> None:
        self._interval = 1.0 / packet_rate
        self._cut, self._garbage = cut, garbage
        self._random = random.Random(seed)
        self._chunks: deque[bytes] = deque()
        self._next_at = -math.inf

    @property
    def room(self) -> int:
        """How many chunks fit."""
        return CAPACITY - len(self._chunks)

    def put_line(self, text: str, now: float) -> None:
        """Send a line with its end, as much of it as fits."""
        data = f"{text}\n".encode()
        if self._random.random() < self._cut:
            data = data[: self._random.randrange(len(data))]
        if self._random.random() < self._garbage:
            data += self._random.randbytes(self._random.randrange(1, 21))
        for start in range(0, len(data), CHUNK):
            if not self.room:
                return
            self.put_chunk(data[start : start + CHUNK], now)

    def put_chunk(self, chunk: bytes, now: float) -> None:
        """Send a chunk for which there is room."""
        if not self._chunks:
            self._next_at = max(self._next_at, now)
        self._chunks.append(chunk)

    def clear(self) -> None:
        """Forget what has not gone out."""
        self._chunks.clear()

    def take(self, now: float) -> list[bytes]:
        """The chunks that have gone out until now."""
        gone = []
        while self._chunks and self._next_at <= now:
            gone.append(self._chunks.popleft())
            self._next_at += self._interval
        return gone

    def next_deadline(self) -> float:
        """When the next chunk goes out."""
        return self._next_at if self._chunks else math.inf
