"""Virtual time: parts that wake at their deadlines, and mail that takes its time."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable
from typing import Protocol

#: A turn of a loop, s.
_TURN = 1e-6


class Part(Protocol):
    """Something that lives in the world. Times are virtual s."""

    def update(self, now: float) -> None:
        """Look at the clock."""

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""


class World:
    """Nobody sleeps: from one moment at which something happens to the next."""

    def __init__(self) -> None:
        self.now = 0.0
        self.parts: list[Part] = []
        self._mail: list[tuple[float, int, Callable[[float], None]]] = []
        self._order = itertools.count()

    def post(self, when: float, deliver: Callable[[float], None]) -> None:
        """Have deliver(now) called then; of two at the same time the one posted first."""
        heapq.heappush(self._mail, (max(when, self.now), next(self._order), deliver))

    def run(self, until: float, over: Callable[[], bool]) -> None:
        """Live on until then, or until it is over."""
        while not over():
            deadlines = [part.next_deadline() for part in self.parts]
            wake = min(deadlines, default=math.inf)
            if self._mail:
                wake = min(wake, self._mail[0][0])
            if wake > until or math.isinf(wake):
                self.now = until
                return
            # What is still due has its turn a moment later, as every loop takes its time.
            self.now = max(self.now + _TURN, wake)
            while self._mail and self._mail[0][0] <= self.now:
                heapq.heappop(self._mail)[2](self.now)
            # One that the mail has just given something to do has its turn a moment later.
            for part, deadline in zip(self.parts, deadlines, strict=True):
                if deadline <= self.now:
                    part.update(self.now)
