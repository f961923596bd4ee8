"""The newest value of each part of an autopilot's picture of the vehicle, with its time."""

from __future__ import annotations

import math
from collections.abc import Callable

from chute_ros.model import Reading

_NEVER = Reading()


class Readings:
    """Part of the picture -> its newest reading. heard is told each part that came."""

    def __init__(self, heard: Callable[[str, float], None]) -> None:
        self._heard = heard
        self._newest: dict[str, Reading] = {}

    def set(self, part: str, value: float, now: float) -> None:
        """A value came now (monotonic s); one that is not finite leaves the one before it."""
        if math.isfinite(value):
            self._newest[part] = Reading(float(value), now)
            self._heard(part, now)

    def forget(self, *parts: str) -> None:
        """What was said of them describes a vehicle that its autopilot no longer knows."""
        for part in parts:
            self._newest.pop(part, None)

    def get(self, part: str) -> Reading:
        """The newest value with its time; NaN: none came."""
        return self._newest.get(part, _NEVER)

    def value(self, part: str) -> float:
        """The newest value; NaN: none came."""
        return self._newest.get(part, _NEVER).value

    def age(self, part: str, now: float) -> float:
        """Seconds since it came; NaN: never."""
        return self._newest.get(part, _NEVER).age(now)

    def fresh(self, part: str, most: float, now: float) -> float:
        """The newest value if it is at most so old (s), else NaN."""
        return self.value(part) if self.age(part, now) <= most else math.nan
