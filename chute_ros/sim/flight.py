"""Vertical motion of a small multirotor: climb, hover, motor failure, fall, descent under canopy.

A point mass with quadratic drag. Not an aerodynamic model: enough for heights, speeds and times to
mean something. SI units, up positive, time in s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

GRAVITY = 9.80665  # m/s^2


@dataclass
class FlightModel:
    """State of the vehicle; step moves it on."""

    #: Speed at which it falls without a canopy, and sinks under an open one, m/s.
    fall_speed: float = 25.0
    canopy_speed: float = 5.0
    #: From release to a full canopy, s.
    canopy_opening_time: float = 1.2
    climb_speed: float = 6.0
    #: Turn rate of the tumble after a motor failure, rad/s.
    tumble_rate: float = 1.6

    height: float = 0.0
    vertical_speed: float = 0.0
    roll: float = 0.0
    armed: bool = False
    motors_failed: bool = False
    #: Height to fly to; 0: land.
    target_height: float = 0.0
    #: Since the release, s; NaN: not released.
    released_for: float = math.nan
    #: Specific force (what an accelerometer measures), m/s^2.
    acceleration: float = GRAVITY

    @property
    def on_ground(self) -> bool:
        """It stands."""
        return self.height <= 0.0

    @property
    def canopy(self) -> float:
        """How far the canopy is open, 0 to 1."""
        if math.isnan(self.released_for):
            return 0.0
        return min(1.0, self.released_for / self.canopy_opening_time)

    def release(self) -> None:
        """The parachute leaves its pod."""
        if math.isnan(self.released_for):
            self.released_for = 0.0

    def step(self, dt: float) -> None:
        """Move on by dt, 0 to 0.1 s."""
        if not math.isnan(self.released_for):
            self.released_for += dt
        thrust = self._thrust(dt)
        drag = self._drag()
        self.vertical_speed += (thrust + drag - GRAVITY) * dt
        self.height += self.vertical_speed * dt
        self.acceleration = abs(thrust + drag)
        if self.height <= 0.0:
            self.height, self.vertical_speed = 0.0, max(0.0, self.vertical_speed)
            self.acceleration = GRAVITY
        self._turn(dt)

    def _drag(self) -> float:
        free = GRAVITY / self.fall_speed**2
        full = GRAVITY / self.canopy_speed**2
        coefficient = free + self.canopy**2 * (full - free)
        return -coefficient * self.vertical_speed * abs(self.vertical_speed)

    def _thrust(self, dt: float) -> float:
        """Acceleration by the motors: fly to the target height at the climb speed."""
        if not self.armed or self.motors_failed:
            return 0.0
        if self.on_ground and self.target_height <= 0.0:
            return 0.0
        wanted = self.target_height - self.height
        speed = max(-2.0, min(self.climb_speed, wanted))
        return max(0.0, min(2.0 * GRAVITY, GRAVITY + 3.0 * (speed - self.vertical_speed)))

    def _turn(self, dt: float) -> None:
        if self.on_ground or (self.armed and not self.motors_failed):
            self.roll = 0.0
        elif self.canopy > 0.0:
            self.roll = math.copysign(max(0.0, abs(self.roll) - 2.0 * dt), self.roll)
        else:
            self.roll = min(2.5, self.roll + self.tumble_rate * dt)
