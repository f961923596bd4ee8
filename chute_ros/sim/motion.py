"""Motion of the simulated vehicle, as a device on it feels it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Motion:
    """What a controller feels: m above take-off, m/s up positive, rad, m/s^2."""

    height: float = 0.0
    vertical_speed: float = 0.0
    tilt: float = 0.0
    acceleration: float = 9.80665

    @property
    def at_rest(self) -> bool:
        """Nothing moves."""
        return abs(self.vertical_speed) < 0.2 and abs(self.acceleration - 9.80665) < 1.5
