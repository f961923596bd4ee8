"""Virtual time: parts that wake at their deadlines, and mail that takes its time."""

from __future__ import annotations

import functools
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
        self._due: list[tuple[float, int, Callable[[float], None]]] = []
        self._order = itertools.count()
        #: Part -> its deadline, and the earliest moment at which it will be looked at.
        self._deadlines: dict[Part, float] = {}
        self._alarms: dict[Part, float] = {}

    def post(self, when: float, deliver: Callable[[float], None]) -> None:
        """Have deliver(now) called then; of two at the same time the one posted first."""
        heapq.heappush(self._due, (max(when, self.now), next(self._order), deliver))

    def add(self, part: Part) -> None:
        """It lives here from now on. Whoever gives it something to do calls stir."""
        self._alarms[part] = math.inf
        self.stir(part)

    def stir(self, part: Part) -> None:
        """Something has happened to it: its next deadline may be another one."""
        self._deadlines[part] = deadline = part.next_deadline()
        # What is due already has its turn a moment later, as every loop takes its time.
        alarm = max(deadline, self.now + _TURN)
        if alarm < self._alarms[part]:
            self._alarms[part] = alarm
            self.post(alarm, functools.partial(self._ring, part))

    def _ring(self, part: Part, now: float) -> None:
        if now < self._alarms[part]:
            return  # it has been looked at meanwhile
        self._alarms[part] = math.inf
        if self._deadlines[part] <= now:
            part.update(now)
        self.stir(part)

    def run(self, until: float, over: Callable[[], bool]) -> None:
        """Live on until then, or until it is over."""
        while not over():
            if not self._due or self._due[0][0] > until:
                self.now = until
                return
            self.now, _, deliver = heapq.heappop(self._due)
            deliver(self.now)
