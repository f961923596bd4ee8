"""Where the lines of a grid stand, what is written at them, and how many points are enough."""

from __future__ import annotations

import math
from collections.abc import Sequence

#: Steps of an axis of time that is longer than two minutes, s.
_LONG_STEPS = (30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 21600, 86400)
#: Lines over the whole width.
_MOST_LINES = 11
#: Of a curve not more than the lowest and the highest of each of so many parts is drawn.
_PARTS = 900


def nice_steps(low: float, high: float, about: int) -> list[float]:
    """Round numbers from low or below to high or above, about so many; at least two."""
    span = high - low or 1.0
    raw = span / about
    size = 10.0 ** math.floor(math.log10(raw))
    step = next(size * factor for factor in (1, 2, 5, 10) if size * factor >= raw * 0.999)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [number * step for number in range(first, max(last, first + 1) + 1)]


def label_of(value: float, steps: Sequence[float]) -> str:
    """A number of an axis with as many digits as its steps need."""
    step = steps[1] - steps[0]
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{value + 0.0:.{digits}f}" if value else "0"


def is_long(span: float) -> bool:
    """An axis of this length (s) is in minutes and seconds."""
    return span > 120.0


def time_steps(start: float, end: float) -> list[float]:
    """Moments (s) for the lines of an axis of time."""
    span = end - start
    if not is_long(span):
        return [one for one in nice_steps(start, end, _MOST_LINES) if start <= one <= end]
    step = next((one for one in _LONG_STEPS if span / one <= _MOST_LINES), _LONG_STEPS[-1])
    first = math.ceil(start / step)
    return [float(number * step) for number in range(first, math.floor(end / step) + 1)]


def time_label(at: float, span: float) -> str:
    """A moment (s) on an axis of this length (s)."""
    if is_long(span):
        minutes, seconds = divmod(round(at), 60)
        return f"{minutes}:{seconds:02d}"
    return f"{at:.6g}"


def thinned(
    points: Sequence[tuple[float, float]], start: float, end: float
) -> list[tuple[float, float]]:
    """No more points than can be seen: of each part the first, lowest, highest and last, and
    every value that is not known."""
    if len(points) <= 4 * _PARTS:
        return list(points)
    parts: dict[int, list[tuple[float, float]]] = {}
    for point in points:
        parts.setdefault(int((point[0] - start) / (end - start) * _PARTS), []).append(point)
    kept: list[tuple[float, float]] = []
    for part in parts.values():
        known = [point for point in part if math.isfinite(point[1])]
        chosen = {part[0], part[-1]}
        if known:
            chosen |= {min(known, key=lambda p: p[1]), max(known, key=lambda p: p[1])}
        kept += sorted(chosen, key=lambda point: point[0])
    return kept


def within(
    points: Sequence[tuple[float, float]], start: float, end: float, steps: bool = False
) -> list[tuple[float, float]]:
    """Those from start to end, and where the way to their neighbours crosses these two. steps: a
    value stays until the next."""
    kept: list[tuple[float, float]] = []
    for number, (at, value) in enumerate(points):
        if number:
            before, old = points[number - 1]
            for edge in (start, end):
                if before < edge < at:
                    share = 0.0 if steps else (edge - before) / (at - before)
                    kept.append((edge, old + share * (value - old)))
        if start <= at <= end:
            kept.append((at, value))
    return kept
