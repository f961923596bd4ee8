"""An autopilot's one estimator when it is wrong with itself: height, vertical speed and attitude
agree with each other and not with the world. What it does not make up - the pressure, the specific
force - goes on telling the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from chute_ros.sim.flight import GRAVITY, FlightModel
from chute_ros.sim.lies import Estimate

#: One that diverged is led back to its barometer within this, s.
_LED_BACK = 3.0
#: One that leans does not go beyond this, rad.
_MOST_LEAN = 1.66


@dataclass(frozen=True)
class EstimatorFault:
    """From begin to end (virtual s) one cause moves all that the estimator tells.

    how: diverges, with an error of strength m/s^2 downwards; leans, by strength rad/s, and sinks
    as what leans so would; hovers, whatever the vehicle does, but for its attitude.
    """

    how: str
    begin: float
    end: float
    strength: float = 0.0
    #: As the names of SensorFault: one fault of one origin.
    sensor: ClassVar[str] = "estimator"
    source: ClassVar[str] = ""

    def later(self, by: float) -> EstimatorFault:
        """The same at another time."""
        return replace(self, begin=self.begin + by, end=self.end + by)


class Estimator:
    """What it makes of the vehicle, before the noise of its sensors."""

    def __init__(self) -> None:
        self.faults: list[EstimatorFault] = []
        #: By each fault that hovers: where.
        self._kept: dict[EstimatorFault, float] = {}

    def tells_of_flight(self, now: float) -> bool:
        """It is wrong enough for its autopilot to take the vehicle for one in the air."""
        return any(one.begin <= now < one.end for one in self.faults)

    def picture(self, model: FlightModel, now: float) -> Estimate:
        """By now."""
        height, speed, roll = model.height, model.vertical_speed, model.roll
        for fault in self.faults:
            passed = now - fault.begin
            if passed < 0.0:
                continue
            if fault.how == "diverges":
                too_slow, too_low = _diverged(fault.strength, passed, fault.end - fault.begin)
                height, speed = height - too_low, speed - too_slow
            elif now < fault.end and fault.how == "leans":
                lean, too_slow, too_low = _leant(fault.strength, passed)
                height, speed, roll = height - too_low, speed - too_slow, roll + lean
            elif now < fault.end:
                height, speed = self._kept.setdefault(fault, height), 0.0
        return Estimate(height, speed, roll)


def _diverged(error: float, passed: float, lasts: float) -> tuple[float, float]:
    """m/s and m, downwards."""
    grows = min(passed, lasts)
    share = max(0.0, 1.0 - (passed - grows) / _LED_BACK)
    return share * error * grows, share * error * grows**2 / 2.0


def _leant(rate: float, passed: float) -> tuple[float, float, float]:
    """rad, and m/s and m downwards: what leans and is carried by 1 g falls by g (1 - cos)."""
    most = _MOST_LEAN / rate
    leans, stays = min(passed, most), max(0.0, passed - most)
    lean = rate * leans
    speed = GRAVITY * (leans - math.sin(lean) / rate)
    height = GRAVITY * (leans**2 / 2.0 + (math.cos(lean) - 1.0) / rate**2)
    push = GRAVITY * (1.0 - math.cos(lean))
    return lean, speed + push * stays, height + speed * stays + push * stays**2 / 2.0
