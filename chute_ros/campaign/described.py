"""A user's vehicle, as its description file gives it (description.py reads the file)."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from chute_ros.campaign.shipped import Shipped
from chute_ros.protocol.vehicle_merge import VEHICLE_STATE
from chute_ros.sim.air import air_at
from chute_ros.sim.flight import GRAVITY


class Range(NamedTuple):
    """From least to most; both are the same where there is no spread."""

    least: float
    most: float

    def draw(self, chance: random.Random) -> float:
        """Any number in it, each as likely."""
        return chance.uniform(self.least, self.most)

    def __str__(self) -> str:
        ends = [f"{one:g}" for one in dict.fromkeys(self)]
        return " to ".join(ends)


@dataclass(frozen=True)
class DescribedVehicle:
    """SI units; description.FIELDS says what each field means.

    profile: name of a shipped profile, or the path of a file. sinks: by the name of a Descent.
    """

    name: str
    kind: str
    mass: float
    drag_area: Range
    descent_rate: float
    opening_time: Range
    soft_landing: float
    heights: Range
    profile: str | Path
    descent_speed: float = 0.0
    wind: float = 8.0
    parachute: str = "mavlink"
    autopilot: str = "px4"
    self_release: bool = False
    vehicle_sources: tuple[str, ...] = (VEHICLE_STATE,)
    sinks: tuple[tuple[str, Range], ...] = ()

    @property
    def fall_speed(self) -> Range:
        """Speed at which it falls without a canopy in the air of the sea level, m/s."""
        slow, fast = (self._fall_speed(area) for area in reversed(self.drag_area))
        return Range(slow, fast)

    def draw_fall_speed(self, chance: random.Random) -> float:
        """m/s; each drag area is as likely."""
        return self._fall_speed(self.drag_area.draw(chance))

    def _fall_speed(self, area: float) -> float:
        return math.sqrt(2.0 * self.mass * GRAVITY / (air_at(0.0).density * area))

    def energy(self, speed: float) -> float:
        """Of its mass at this speed, J."""
        return 0.5 * self.mass * speed**2


class OwnShipped(Shipped):
    """The shipped settings, and the profile of a described vehicle."""

    def __init__(self, folder: Path, profile: str | Path) -> None:
        super().__init__(folder)
        self._profile = profile

    def profile_file(self, kind: str) -> Path:
        if isinstance(self._profile, Path):
            return self._profile
        return super().profile_file(self._profile)
