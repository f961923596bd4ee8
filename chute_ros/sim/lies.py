"""What a simulated autopilot's estimator makes of the vehicle when it is wrong: height, vertical
speed and attitude agree with each other, and not with the world. Barometer and accelerometer go on
telling the truth."""

from __future__ import annotations

import math
from typing import NamedTuple

from chute_ros.sim.flight import FlightModel

#: Kind -> the vertical speed that it makes up, m/s.
_RUNS_AWAY = {"climb": 3.0, "fall": -3.0}
#: It makes up more and more of that for so long, s.
_GROWS = 2.0
STUCK, TRUTH = "stuck", "truth"
#: All kinds; TRUTH: it is right.
LIES = (*_RUNS_AWAY, STUCK, TRUTH)


class Estimate(NamedTuple):
    """m above take-off, m/s up, rad."""

    height: float
    vertical_speed: float
    roll: float


class LyingEstimator:
    """Right until it is told otherwise. Times are monotonic s."""

    def __init__(self) -> None:
        self._kind, self._since = TRUTH, math.nan
        #: What it repeats.
        self._kept = Estimate(0.0, 0.0, 0.0)

    def lie(self, kind: str, model: FlightModel, now: float) -> None:
        """From now on in this way, one of LIES."""
        self._kept = self.belief(model, now)
        self._kind, self._since = kind, now

    def belief(self, model: FlightModel, now: float) -> Estimate:
        """By now."""
        if self._kind == STUCK:
            return self._kept
        made_up, passed = _RUNS_AWAY.get(self._kind, 0.0), now - self._since
        if not made_up:
            return Estimate(model.height, model.vertical_speed, model.roll)
        grows = min(passed, _GROWS)
        speed = made_up * grows / _GROWS
        height = speed * grows / 2.0 + made_up * (passed - grows)
        return Estimate(model.height + height, model.vertical_speed + speed, model.roll)
