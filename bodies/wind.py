"""Wind with turbulence for a body whose package has none that this environment can run (RotorPy's
Dryden wind needs torch)."""

from __future__ import annotations

import math
import random
from typing import Any

import numpy as np

#: First-order turbulence with these times along and up, s: Dryden's lengths below 100 m at 10 m/s.
_TIMES = np.array([4.0, 4.0, 1.5])
_STEP = 0.01


class Wind:
    """Its strength is drawn: still air, a breeze, or near what multirotors stand."""

    def __init__(self, chance: random.Random) -> None:
        speed = chance.choice((0.0, chance.uniform(1.0, 6.0), chance.uniform(6.0, 12.0)))
        heading = chance.uniform(0.0, math.tau)
        share = chance.uniform(0.1, 0.25)
        self.told = f"{speed:.1f} m/s, turbulence {share * speed:.1f} m/s"
        self._mean = speed * np.array([math.cos(heading), math.sin(heading), 0.0])
        self._strength = share * speed * np.array([1.0, 1.0, 0.5])
        self._chance = np.random.default_rng(chance.randrange(2**32))
        self._gust = np.zeros(3)

    def at(self, height: float) -> Any:
        """The next one, m/s; less near the ground (a power of 1/7 from 20 m)."""
        push = self._chance.normal(size=3) * self._strength * np.sqrt(2.0 * _STEP / _TIMES)
        self._gust += push - self._gust * _STEP / _TIMES
        less = min(1.3, (max(1.0, height) / 20.0) ** (1.0 / 7.0))
        return self._mean * less + self._gust
