"""Rate of a stream of messages."""

from __future__ import annotations

import math

#: What the newest gap counts in the average.
_WEIGHT = 0.2


class StreamRate:
    """Follows the average gap between the messages of one stream."""

    def __init__(self) -> None:
        #: When the newest one came, monotonic s.
        self.newest = -math.inf
        self._gap = math.nan

    def heard(self, now: float) -> None:
        """One came."""
        gap = now - self.newest
        self.newest = now
        if math.isnan(self._gap):
            self._gap = gap if math.isfinite(gap) else math.nan
        else:
            self._gap += _WEIGHT * (gap - self._gap)

    @property
    def average(self) -> float:
        """Hz while it comes; NaN: fewer than two came."""
        return 1.0 / self._gap if self._gap > 0.0 else math.inf if self._gap == 0.0 else math.nan

    def rate(self, now: float) -> float:
        """Hz; of one that pauses for longer than its average gap no more than that shows; NaN:
        fewer than two came."""
        pause = now - self.newest
        return min(self.average, 1.0 / pause) if pause > 0.0 else self.average
