"""How often a stream of messages comes, and whether that is less than the rules need."""

from __future__ import annotations

import math

#: What the newest gap counts in the average.
_WEIGHT = 0.2
#: An average so much below a rate is no shortfall.
TOLERANCE = 1.1
#: A rate below what is needed for so long, s, is said.
SAID_AFTER = 2.0


class StreamRate:
    """Follows the average gap between the messages of one stream. needed: Hz; 0: any rate will
    do."""

    def __init__(self, needed: float = 0.0) -> None:
        #: When the newest one came, monotonic s.
        self.newest = -math.inf
        self._gap = math.nan
        self._least, self._short_since = needed / TOLERANCE, math.inf

    def heard(self, now: float) -> None:
        """One came."""
        gap = now - self.newest
        self.newest = now
        if math.isnan(self._gap):
            self._gap = gap if math.isfinite(gap) else math.nan
        else:
            self._gap += _WEIGHT * (gap - self._gap)
        self._short_since = min(self._short_since, now) if self.average < self._least else math.inf

    @property
    def average(self) -> float:
        """Hz while it comes; NaN: fewer than two came."""
        return 1.0 / self._gap if self._gap > 0.0 else math.inf if self._gap == 0.0 else math.nan

    def rate(self, now: float) -> float:
        """Hz; of one that pauses for longer than its average gap no more than that shows; NaN:
        fewer than two came."""
        pause = now - self.newest
        return min(self.average, 1.0 / pause) if pause > 0.0 else self.average

    def too_slow(self, now: float) -> bool:
        """It comes more seldom than needed, and did so for SAID_AFTER."""
        short = now - min(self._short_since, self.newest) >= SAID_AFTER
        return short and self.rate(now) < self._least
