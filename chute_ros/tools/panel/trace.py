"""Height and vertical speed over time, with the decisions on them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

#: How far back it goes, s; and the shortest time between two points of it, s.
SPAN, STEP = 300.0, 0.2
#: Points that are drawn at most: a phone, and the radio to it, have enough of them.
MOST_DRAWN = 300
MOST_MARKS = 20
#: Points further apart say nothing of what lay between, s.
GAP = 2.0
#: Rows for the names of decisions; more in one place have none, and their line stands for them.
LANES = 4
#: Of the width of the curves on a phone: a letter, and the sign before a name.
_LETTER, _SIGN = 0.024, 0.03


@dataclass(frozen=True)
class MotionPoint:
    """at: Unix s, as the page's own clock; m above take-off; m/s, up positive; NaN: not known."""

    at: float
    height: float
    vertical_speed: float


@dataclass(frozen=True)
class DecisionMark:
    """A decision. text: its action."""

    at: float
    text: str


@dataclass(frozen=True)
class PlacedMark:
    """A decision on the curves. lane: the row of its name, -1: none is free; leftwards: its name
    stands left of it."""

    mark: DecisionMark
    lane: int
    leftwards: bool


def placed(marks: Iterable[DecisionMark], start: float, end: float) -> list[PlacedMark]:
    """Those from start to end (Unix s), so that no name stands on another, nor past the end."""
    span = max(end - start, 1e-3)
    taken: list[list[tuple[float, float]]] = [[] for _ in range(LANES)]
    found = []
    for mark in marks:
        at = (mark.at - start) / span
        if not 0.0 <= at <= 1.0:
            continue
        wide = len(mark.text) * _LETTER + _SIGN
        leftwards = at + wide > 1.0
        left, right = (at - wide, at + _SIGN) if leftwards else (at - _SIGN, at + wide)
        free = (
            lane
            for lane, spans in enumerate(taken)
            if all(right <= begin or left >= over for begin, over in spans)
        )
        lane = next(free, -1)
        if lane >= 0:
            taken[lane].append((left, right))
        found.append(PlacedMark(mark, lane, leftwards))
    return found


@dataclass
class Trace:
    """What was received of one vehicle since somebody looks."""

    points: deque[MotionPoint] = field(default_factory=deque)
    marks: deque[DecisionMark] = field(default_factory=lambda: deque(maxlen=MOST_MARKS))

    def add(self, point: MotionPoint) -> None:
        """The newest; one that comes too soon after the last is left out."""
        if self.points and 0.0 <= point.at - self.points[-1].at < STEP:
            return
        if self.points and point.at < self.points[-1].at:
            # The clock was set: what was before is not on the same axis.
            self.points.clear()
            self.marks.clear()
        if self.points and point.at - self.points[-1].at > GAP:
            # What nobody received is no straight line.
            self.points.append(MotionPoint(self.points[-1].at + STEP, math.nan, math.nan))
        self.points.append(point)
        while self.points[0].at < point.at - SPAN:
            self.points.popleft()

    def mark(self, at: float, text: str) -> None:
        """A decision that came now."""
        self.marks.append(DecisionMark(at, text))

    def drawn(self) -> list[MotionPoint]:
        """At most MOST_DRAWN: of each part of the time the lowest, the highest and one that is not
        known, so that no peak is lost, and no gap."""
        points = list(self.points)
        size = -(-len(points) // (MOST_DRAWN // 3))
        if size <= 3:
            return points
        kept: list[MotionPoint] = []
        for start in range(0, len(points), size):
            part = points[start : start + size]
            unknown = [one for one in part if math.isnan(one.height)]
            known = [one for one in part if not math.isnan(one.height)] or part
            low = min(known, key=lambda one: one.height)
            high = max(known, key=lambda one: one.height)
            kept += sorted({low, high, *unknown[:1]}, key=lambda one: one.at)
        return kept
