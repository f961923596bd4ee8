"""Height and vertical speed over time, with the decisions on them."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

#: How far back it goes, s; and the shortest time between two points of it, s.
SPAN, STEP = 300.0, 0.2
#: Points that are drawn at most: a phone, and the radio to it, have enough of them.
MOST_DRAWN = 300
MOST_MARKS = 20


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
        self.points.append(point)
        while self.points[0].at < point.at - SPAN:
            self.points.popleft()

    def mark(self, at: float, text: str) -> None:
        """A decision that came now."""
        self.marks.append(DecisionMark(at, text))

    def drawn(self) -> list[MotionPoint]:
        """At most MOST_DRAWN: of each part of the time the lowest and the highest, so that no peak
        is lost."""
        points = list(self.points)
        size = -(-len(points) // (MOST_DRAWN // 2))
        if size <= 2:
            return points
        kept: list[MotionPoint] = []
        for start in range(0, len(points), size):
            part = points[start : start + size]
            known = [one for one in part if not math.isnan(one.height)] or part
            low = min(known, key=lambda one: one.height)
            high = max(known, key=lambda one: one.height)
            kept += sorted({low, high}, key=lambda one: one.at)
        return kept
