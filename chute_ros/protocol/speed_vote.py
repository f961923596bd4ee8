"""Whose vertical speed is outvoted: by a barometer and by another source, both of which tell the
same, and another speed than it does.

A barometer is an origin of its own, and so is another source's estimator: two origins stand
against one. It needs two sources that tell a vertical speed; of one alone the supervisor holds the
barometer against it (supervisor/contradictions.py, whose limits these are).
"""

from __future__ import annotations

import math
from collections import deque
from statistics import fmean, linear_regression

from chute_ros.model import pressure_altitude

#: What is compared is that of so long, s, of which this must be told at least, s, by so many
#: words.
_OVER, _AT_LEAST, _FEWEST = 1.0, 0.7, 4
#: A speed is the barometer's rate if it differs by no more than this, m/s, or this part of it
#: (supervisor/contradictions.py has the same two, which this package cannot import).
_DIFFERS, _OF_RATE = 2.0, 0.5
#: Two sources whose speeds differ by less than this, m/s, may both be right.
APART = 5.0
#: It is outvoted once that was so for this long, s, and until it was not so for this long, s.
_HELD_FOR, _OVER_AFTER = 0.3, 1.0

_Words = deque[tuple[float, float]]


class SpeedVote:
    """Times are monotonic s. outvoted: source -> why; confirmed: those that the barometer agrees
    with meanwhile, or while several do: what one of them told before puts them in no doubt."""

    def __init__(self) -> None:
        self._heights: _Words = deque()
        self._speeds: dict[str, _Words] = {}
        #: Source -> since when it is against the other two, and when it last was, s.
        self._against: dict[str, tuple[float, float]] = {}
        self.outvoted: dict[str, str] = {}
        self.confirmed: frozenset[str] = frozenset()

    def hear_pressure(self, pressure: float, received: float) -> None:
        """The barometer told this, Pa."""
        height = pressure_altitude(pressure)
        if not math.isnan(height):
            _add(self._heights, height, received)

    def hear_speed(self, source: str, speed: float, received: float) -> None:
        """A source told its vertical speed, m/s, up positive."""
        if math.isnan(speed):
            return
        _add(self._speeds.setdefault(source, deque()), speed, received)
        if len(self._speeds) > 1:
            self._vote(received)

    def _vote(self, now: float) -> None:
        rate = _rate(self._heights, now)
        if math.isnan(rate):
            told, right = {}, []
        else:
            told = {
                one: mean for one in self._speeds if (mean := self._mean(one, now)) is not None
            }
            most = max(_DIFFERS, _OF_RATE * abs(rate))
            right = [one for one in told if abs(told[one] - rate) <= most]
        for one, mean in told.items():
            against = one not in right and any(abs(told[each] - mean) >= APART for each in right)
            if against:
                since, _ = self._against.get(one, (now, now))
                self._against[one] = since, now
                if now - since >= _HELD_FOR:
                    self.outvoted[one] = _why(
                        one, mean, {each: told[each] for each in right}, rate
                    )
        for one, (_, newest) in [*self._against.items()]:
            if now - newest > _OVER_AFTER:
                del self._against[one]
                self.outvoted.pop(one, None)
        agree = [told[one] for one in right]
        several = len(agree) > 1 and max(agree) - min(agree) < APART
        self.confirmed = frozenset(right) if self.outvoted or several else frozenset()

    def _mean(self, source: str, now: float) -> float | None:
        """Over the time of the barometer's rate."""
        begin = self._heights[0][0]
        words = [speed for at, speed in self._speeds[source] if begin <= at <= now]
        return fmean(words) if len(words) >= _FEWEST else None


def _add(words: _Words, value: float, received: float) -> None:
    if words and received <= words[-1][0]:
        return  # told again, or overtaken
    words.append((received, value))
    while received - words[0][0] > _OVER:
        words.popleft()


def _rate(heights: _Words, now: float) -> float:
    """m/s; NaN: it tells too little, or always the same."""
    if len(heights) < _FEWEST or now - heights[-1][0] > _OVER - _AT_LEAST:
        return math.nan
    times, values = zip(*heights, strict=True)
    if times[-1] - times[0] < _AT_LEAST or max(values) == min(values):
        return math.nan
    return linear_regression(times, values).slope


def _why(source: str, speed: float, others: dict[str, float], rate: float) -> str:
    each = ", ".join(f"{one} {other:+.1f}" for one, other in others.items())
    return (
        f"{source} reports a vertical speed of {speed:+.1f} m/s against two origins: {each}, the "
        f"barometer {rate:+.1f} m/s: its speed and attitude are not used"
    )
