"""An instant of the monotonic clock, by the wall clock."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

#: Both clocks were read at one moment if the monotonic one went on by less between, s.
_ONE_MOMENT = 1e-4
#: So often they are read for it; of processors that are that busy, the best reading is taken.
_MOST_TRIES = 10


def wall_at(
    instant: float,
    monotonic: Callable[[], float] = time.monotonic,
    wall: Callable[[], int] = time.time_ns,
) -> int:
    """Unix nanoseconds at an instant of the monotonic clock (s), never below 0; NaN, never: 0.
    wall gives Unix nanoseconds."""
    if math.isnan(instant):
        return 0
    # A processor may take this thread away between two readings, for as long as it likes.
    apart, found = math.inf, 0
    for _ in range(_MOST_TRIES):
        before, now, after = monotonic(), wall(), monotonic()
        if after - before < apart:
            apart = after - before
            found = now - round(((before + after) / 2 - instant) * 1e9)
        if apart < _ONE_MOMENT:
            break
    return max(0, found)
