"""Whether what a process holds stays flat: a robust line through samples, and its limit."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

#: The first samples after a start are of a process that is still filling its caches.
_WARM_UP = 5
#: A line through fewer than this says nothing.
ENOUGH = 15
#: Through so many its slope alone is believed.
_SURE = 40


@dataclass(frozen=True)
class Limit:
    """A growth that is a finding: by more than per_hundred, and where the samples are few by more
    than total as well."""

    #: In the unit of the measure, over all the loops that were measured.
    total: float
    #: For each hundred loops.
    per_hundred: float


#: MB, descriptors, threads. Memory: the allocator's arenas still settle within some MB; what leaks
#: in each loop goes past both. Descriptors and threads come and go with peers by ones and twos.
LIMITS = {
    "memory": Limit(8.0, 4.0),
    "descriptors": Limit(4.0, 3.0),
    "threads": Limit(2.0, 2.0),
}


@dataclass(frozen=True)
class Growth:
    """Of one measure of one life of a process."""

    first: float
    last: float
    per_hundred: float
    samples: int

    def too_much(self, limit: Limit) -> bool:
        """It does not stay flat."""
        grown = self.last - self.first
        sure = self.samples >= _SURE or grown > limit.total
        return sure and self.per_hundred > limit.per_hundred


def slope(points: Sequence[tuple[float, float]]) -> float:
    """The median of the slopes of all pairs (Theil and Sen): single peaks do not move it."""
    slopes = [
        (high - low) / (right - left)
        for number, (left, low) in enumerate(points)
        for right, high in points[number + 1 :]
        if right > left
    ]
    return statistics.median(slopes) if slopes else 0.0


def growth(points: Sequence[tuple[float, float]]) -> Growth | None:
    """Of (loop, value), in the order of loops; None: too few to say."""
    some = points[_WARM_UP:]
    if len(some) < ENOUGH:
        return None
    third = max(1, len(some) // 3)
    first = statistics.median(value for _, value in some[:third])
    last = statistics.median(value for _, value in some[-third:])
    return Growth(first, last, slope(some) * 100.0, len(some))
