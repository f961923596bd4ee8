"""Sensors that lie: what an autopilot, a flight computer or a second source tells in place of what
is so."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace

#: The noise of one that is whole, standard deviation: m, m/s, rad, m/s^2, m.
_NOISE = {"height": 0.15, "speed": 0.08, "tilt": 0.01, "force": 0.15, "pressure": 0.3}
#: How much each is wrong: m, m/s, rad, m/s^2, m.
_SCALES = {"height": 30.0, "speed": 15.0, "tilt": math.pi, "force": 20.0, "pressure": 30.0}


@dataclass(frozen=True)
class SensorFault:
    """From begin to end (virtual s) a part of what is told is wrong.

    how: sticks, drifts, jumps, noise, zero, gone (not a number); of what is no number: lies.
    source: whose sensor, as in vehicle_sources; empty: the autopilot's or flight computer's.
    """

    sensor: str
    how: str
    begin: float
    end: float
    source: str = ""

    def later(self, by: float) -> SensorFault:
        """The same at another time."""
        return replace(self, begin=self.begin + by, end=self.end + by)


class Sensors:
    """All of one source."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self.faults: list[SensorFault] = []
        self._stuck: dict[SensorFault, float] = {}

    def lies(self, sensor: str, now: float) -> bool:
        """It tells what is not so."""
        return any(f.sensor == sensor and f.begin <= now < f.end for f in self.faults)

    def read(self, sensor: str, value: float, now: float) -> float:
        """What it says where value is so."""
        value += self._chance.gauss(0.0, _NOISE[sensor])
        for fault in self.faults:
            if fault.sensor == sensor and fault.begin <= now < fault.end:
                value = self._wrong(fault, value, now)
        return value

    def _wrong(self, fault: SensorFault, value: float, now: float) -> float:
        scale = _SCALES[fault.sensor]
        if fault.how == "sticks":
            return self._stuck.setdefault(fault, value)
        if fault.how == "drifts":
            return value - 0.1 * scale * (now - fault.begin)
        if fault.how == "jumps":
            return value - scale
        if fault.how == "noise":
            return value + self._chance.uniform(-scale, scale)
        return 0.0 if fault.how == "zero" else math.nan
