"""What so many flights say about all others, whatever the distribution is.

Source: order statistics as distribution-free tolerance bounds (Wilks 1941), and the one-sided
interval of Clopper and Pearson (1934) for a share.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

#: Of all statements here.
CONFIDENCE = 0.95
_HALVINGS = 60


def flights_needed(share: float) -> int:
    """How many flights it takes until their largest value bounds this share of all (0 to 1)."""
    return math.ceil(math.log(1.0 - CONFIDENCE) / math.log(share))


def upper_bound(values: Sequence[float], share: float) -> float | None:
    """The value that at least this share of all (0 to 1) does not exceed, with CONFIDENCE: the
    smallest of values that can be it; None: they are too few to say."""
    ordered = sorted(values)
    below = 0.0
    for rank, value in enumerate(ordered):
        # That so many of them lie in the share, and no more.
        below += _likelihood(rank, len(ordered), share)
        if below >= CONFIDENCE:
            return value
    return None


def share_at_least(good: int, flights: int) -> float:
    """The least share of all that goes well, with CONFIDENCE, if so many of the flights did."""
    if good == 0:
        return 0.0
    low, high = 0.0, good / flights
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        as_many = sum(_likelihood(n, flights, middle) for n in range(good, flights + 1))
        low, high = (middle, high) if as_many < 1.0 - CONFIDENCE else (low, middle)
    return low


def _likelihood(hits: int, flights: int, share: float) -> float:
    """Of so many hits, if each flight hits with this chance."""
    if share in (0.0, 1.0):
        return float(hits == flights * share)
    return math.exp(
        math.lgamma(flights + 1)
        - math.lgamma(hits + 1)
        - math.lgamma(flights - hits + 1)
        + hits * math.log(share)
        + (flights - hits) * math.log1p(-share)
    )
