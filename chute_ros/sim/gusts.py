"""The flight model in gusts, which lift, drop and tilt what is in the air."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from chute_ros.sim.flight import FlightModel

#: Gusts change within about this time, s.
_GUST_TIME = 1.0
#: Tilt by each m/s^2 of a gust, rad.
_SWAY = math.radians(3.0)


@dataclass
class GustyModel(FlightModel):
    """gusts: their usual strength, m/s^2 up and down."""

    gusts: float = 0.0
    chance: random.Random = field(default_factory=random.Random)
    _sway: float = 0.0

    def step(self, dt: float) -> None:
        """Move on by dt, 0 to 0.1 s."""
        if self.on_ground:
            self.push = 0.0
        elif self.gusts:
            share = dt / _GUST_TIME
            change = self.chance.gauss(0.0, self.gusts * math.sqrt(2.0 * share))
            self.push += change - self.push * share
            self._sway = _SWAY * self.push
        super().step(dt)

    def calm(self) -> None:
        """The gusts end."""
        self.gusts = self.push = self._sway = 0.0

    def _turn(self, dt: float) -> None:
        super()._turn(dt)
        if self.armed and not self.motors_failed and not self.on_ground:
            self.roll = self._sway
