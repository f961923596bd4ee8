"""Events on their way from a link to the executor."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from chute_ros.transport.lateness import Lateness

#: Where more events than this wait, pictures are left out: the next one tells the same.
MOST_WAITING = 2000

#: Events taken at once, before the executor's other callbacks have their turn.
MOST_AT_ONCE = 100


class Inbox:
    """take: gets each event, in the executor; wake: has drain called there; pictures: the types of
    events that may be left out where the executor does not keep up; replaced: those of them that
    tell all that one before them told, which is left out if it still waits just ahead; unhurried:
    those that wake nobody, and wait for the next one that does."""

    def __init__(
        self,
        take: Callable[[Any], None],
        wake: Callable[[], None],
        pictures: tuple[type, ...],
        replaced: tuple[type, ...] = (),
        unhurried: tuple[type, ...] = (),
    ) -> None:
        self._take, self._wake, self._pictures = take, wake, pictures
        self._replaced, self._unhurried = replaced, unhurried
        self._waiting: deque[Any] = deque()
        # Between the look at the last one that waits and its replacement nobody may take it.
        self._lock = threading.Lock()
        #: Pictures that were left out.
        self.left_out = 0
        #: Of taking what waits, and since when something does, monotonic s.
        self.late = Lateness()
        self._since = math.nan

    def put(self, events: list[Any]) -> None:
        """In the link's turn: hand events to the executor."""
        hurried = not all(isinstance(event, self._unhurried) for event in events)
        if len(self._waiting) > MOST_WAITING:
            kept = [event for event in events if not isinstance(event, self._pictures)]
            self.left_out += len(events) - len(kept)
            events = kept
        with self._lock:
            for event in events:
                last = self._waiting[-1] if self._waiting else None
                if isinstance(event, self._replaced) and type(last) is type(event):
                    self._waiting[-1] = event
                else:
                    self._waiting.append(event)
        if hurried:
            if math.isnan(self._since):
                self._since = time.monotonic()
            self._wake()

    def left(self) -> list[Any]:
        """What waits, once nobody drains any more."""
        return list(self._waiting)

    def drain(self) -> None:
        """In the executor: take what is there. What comes meanwhile waits for its turn: a flood
        must not keep decisions from theirs."""
        now = time.monotonic()
        if not math.isnan(self._since):
            self.late.note(now - self._since, now)
        self._since = math.nan
        for _ in range(min(len(self._waiting), MOST_AT_ONCE)):
            with self._lock:
                event = self._waiting.popleft()
            self._take(event)
        if self._waiting:
            self._since = now
            self._wake()
