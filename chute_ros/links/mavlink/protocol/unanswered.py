"""Which sends of a command may still be answered?

COMMAND_ACK names only the number of the command, so an answer to an earlier command of the same
number could be taken for one to a later command. Each send is answered at most once, in any order
and at most window seconds after it (or after the newest IN_PROGRESS). So where N earlier sends may
still be answered, only more than N answers with the same result prove that one of them is ours.
Sends of one family (the tries of one goal) ask for the same and may answer for each other.
"""

from __future__ import annotations

from collections import deque

#: Sends to remember; more are under way only if a device misbehaves.
MOST_SENDS = 64


class UnansweredSends:
    """The sends of one command number to one component that may still be answered."""

    def __init__(self, window: float) -> None:
        self._window = window
        self._sends: deque[tuple[float, int]] = deque()  # (time, family), oldest first
        self._answered = 0  # of them; which ones is not known

    def add(self, family: int, now: float) -> None:
        """One more was sent."""
        self._lapse(now)
        self._sends.append((now, family))
        if len(self._sends) > MOST_SENDS:
            self._drop_oldest()

    def answer(self, now: float) -> bool:
        """A final answer came; False: to nothing that we sent."""
        self._lapse(now)
        if self._answered >= len(self._sends):
            return False
        self._answered += 1
        return True

    def in_progress(self, now: float, longer: float) -> None:
        """One of them is being carried out: its final answer may take this much longer."""
        self._lapse(now)
        self._sends = deque((now + longer, family) for _, family in self._sends)

    def of_others(self, family: int, now: float) -> int:
        """How many at most, besides those of family, may still be answered."""
        self._lapse(now)
        others = sum(other != family for _, other in self._sends)
        return min(others, len(self._sends) - self._answered)

    def _lapse(self, now: float) -> None:
        while self._sends and now - self._sends[0][0] > self._window:
            self._drop_oldest()

    def _drop_oldest(self) -> None:
        self._sends.popleft()
        self._answered = max(0, self._answered - 1)
