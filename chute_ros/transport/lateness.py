"""Delay in handling received data: if the processor is short, evidence is older than it
seems."""

from __future__ import annotations

import math

#: Told for so long, s.
TOLD_FOR = 5.0


class Lateness:
    """The most of the last seconds. All times are monotonic s."""

    def __init__(self) -> None:
        self._most, self._at = 0.0, -math.inf

    def note(self, seconds: float, now: float) -> None:
        """Something may have waited for so long."""
        if seconds >= self.most(now):
            self._most, self._at = seconds, now

    def most(self, now: float) -> float:
        """s."""
        return self._most if now < self._at + TOLD_FOR else 0.0
