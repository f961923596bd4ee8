"""Was one of two hosts' wall clocks set? Told from the heartbeats that one sends to the other.

A message's way can become slower by no more than the time that has passed, and faster by no more
than it took before. A difference between stamp and arrival that changes by more is a clock that
was set, which makes no message older than it is. Nothing arrives before it was sent either: a
heartbeat from the future was stamped by a clock that is ahead, as that of another host may be when
one of the two is started anew; or the one that showed a step had waited for us, as all do that
come while this host hangs. A clock that is behind looks like a way that is slow, until an answer
to what we have sent comes, which cannot be older than that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class ClockSteps:
    """margin: what is never taken for a step, s. All times are s."""

    margin: float
    #: How much of the difference between the two clocks is due to steps: ours less theirs.
    offset: float = 0.0
    _heard: float = math.nan
    _difference: float = math.nan

    def heard(self, difference: float, now: float) -> float:
        """A heartbeat came. difference: the wall clock here less its stamp; now: monotonic.
        Returns the step that this shows; 0: none."""
        change, passed = difference - self._difference, now - self._heard
        took = max(0.0, self.age(self._difference))
        self._heard, self._difference = now, difference
        # NaN, for the first, is within no bounds and beyond none.
        if change > passed + self.margin or change < -took - self.margin:
            self.offset += change
            return change
        if (early := self.age(difference)) < -self.margin:
            self.offset = difference
            return early
        return 0.0

    def answered(self, difference: float, passed: float, now: float) -> float:
        """An answer came to what left here passed s ago. Returns the step that it shows; 0: none.

        The age is then taken to be what it is at most: nothing becomes younger than it is. Answers
        come on another way than heartbeats, and may be overtaken by them."""
        step = self.age(difference) - passed
        if not step > self.margin:
            return 0.0
        self.offset += step
        # The next heartbeat shows the same step.
        self._heard, self._difference = now, difference
        return step

    def age(self, difference: float) -> float:
        """How old a message is whose stamp differs so much from the wall clock here."""
        return difference - self.offset
