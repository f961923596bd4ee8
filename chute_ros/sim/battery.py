"""The battery of a simulated vehicle: four LiPo cells, whose voltage shows their charge."""

from __future__ import annotations

import math
from itertools import pairwise

_CELLS = 4
#: Remaining charge, 0 to 1, by the voltage of a cell at rest, V.
_CURVE = ((3.3, 0.0), (3.5, 0.1), (3.7, 0.35), (3.95, 0.87), (4.2, 1.0))
#: How fast it drains, V/s: much faster than a real one, so that nobody has to wait.
_DRAIN = 0.5


class Battery:
    """As delivered: 15.8 V and 87 %. Times are monotonic s."""

    def __init__(self) -> None:
        self._from = self._to = 15.8
        self._since = -math.inf

    def drain_to(self, volts: float, now: float) -> None:
        """From now on it drains to volts; more than it has: it is another battery."""
        self._from, self._to = max(volts, self.voltage(now)), volts
        self._since = now

    def voltage(self, now: float) -> float:
        """V."""
        return max(self._to, self._from - _DRAIN * (now - self._since))

    def remaining(self, now: float) -> float:
        """The charge that is left, 0 to 1."""
        cell = self.voltage(now) / _CELLS
        for (low, low_charge), (high, high_charge) in pairwise(_CURVE):
            if cell <= high:
                share = max(0.0, (cell - low) / (high - low))
                return low_charge + share * (high_charge - low_charge)
        return 1.0
