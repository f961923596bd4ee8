"""Events on their way from a link's thread to the executor."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

#: Where more events than this wait, pictures are left out: the next one tells the same.
MOST_WAITING = 2000

#: Events taken at once, before the executor's other callbacks have their turn.
MOST_AT_ONCE = 100


class Inbox:
    """take: gets each event, in the executor; wake: has drain called there; pictures: the types of
    events that may be left out where the executor does not keep up."""

    def __init__(
        self,
        take: Callable[[Any], None],
        wake: Callable[[], None],
        pictures: tuple[type, ...],
    ) -> None:
        self._take, self._wake, self._pictures = take, wake, pictures
        self._waiting: deque[Any] = deque()
        #: Pictures that were left out.
        self.left_out = 0

    def put(self, events: list[Any]) -> None:
        """In the link's thread: hand events to the executor."""
        if len(self._waiting) > MOST_WAITING:
            kept = [event for event in events if not isinstance(event, self._pictures)]
            self.left_out += len(events) - len(kept)
            events = kept
        self._waiting.extend(events)
        self._wake()

    def drain(self) -> None:
        """In the executor: take what is there. What comes meanwhile waits for its turn: a flood
        must not keep decisions from theirs."""
        for _ in range(min(len(self._waiting), MOST_AT_ONCE)):
            self._take(self._waiting.popleft())
        if self._waiting:
            self._wake()
