"""Vertical motion of a small aircraft: climb, hover, motor failure, fall, descent under canopy.

A point mass with quadratic drag. Not an aerodynamic model: enough for heights, speeds and times to
mean something. What comes down otherwise than as a tumbling multirotor has a Descent. SI units, up
positive, time in s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

GRAVITY = 9.80665  # m/s^2
#: The most that a descent turns to its tilt, rad/s.
_TURN_RATE = 1.6


@dataclass(frozen=True)
class Descent:
    """How something comes down that does not tumble: partial thrust, a glide, a spin.

    sink: m/s downwards in the end; settles: time constant to it, s; tilt: rad; force: specific
    force in the end, m/s^2.
    """

    name: str
    sink: float
    settles: float = 1.0
    tilt: float = 0.0
    force: float = GRAVITY


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
    #: By which the air pushes it upwards, m/s^2: it moves by that, and feels it.
    push: float = 0.0
    #: The ground under it, m above where it took off: negative beside a roof, over a valley.
    ground: float = 0.0
    #: How it comes down once its motors have failed while it is armed, and once it is disarmed;
    #: None: it falls and tumbles.
    descent: Descent | None = None
    unheld: Descent | None = None

    @property
    def on_ground(self) -> bool:
        """It stands."""
        return self.height <= self.ground

    @property
    def clearance(self) -> float:
        """Above the ground under it, m."""
        return self.height - self.ground

    @property
    def controlled(self) -> bool:
        """It does what it is told to."""
        return self.armed and not self.motors_failed and not self.on_ground

    @property
    def way_down(self) -> Descent | None:
        """Of one in the air that nothing carries; None: it is carried, or falls and tumbles."""
        if self.on_ground or self.controlled or self.canopy > 0.0:
            return None
        return self.descent if self.armed else self.unheld

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

    def release_another(self, canopy_speed: float) -> None:
        """A second parachute leaves its pod; m/s under its canopy."""
        self.canopy_speed, self.released_for = canopy_speed, 0.0

    def mend(self) -> None:
        """Put it whole on the ground, disarmed, with its parachute packed."""
        self.height, self.vertical_speed, self.roll = self.ground, 0.0, 0.0
        self.armed = self.motors_failed = False
        self.target_height, self.released_for = 0.0, math.nan
        self.acceleration = GRAVITY

    def step(self, dt: float) -> None:
        """Move on by dt, 0 to 0.1 s."""
        if not math.isnan(self.released_for):
            self.released_for += dt
        way = self.way_down
        if way is None:
            carried = self._thrust(dt) + self._drag() + self.push
            gained, self.acceleration = carried - GRAVITY, abs(carried)
        else:
            # What settles slowly follows the air slowly: a gust is no wind that carries it along.
            gained = (-way.sink - self.vertical_speed) / max(way.settles, dt)
            gained += self.push / max(way.settles, 1.0)
            # Upwards it is carried by what it does not gain downwards, whichever way it leans.
            leans = math.cos(way.tilt) / max(math.cos(self.roll), math.cos(way.tilt))
            self.acceleration = way.force * leans * max(0.0, 1.0 + gained / GRAVITY)
        self.vertical_speed += gained * dt
        self.height += self.vertical_speed * dt
        if self.height <= self.ground:
            self.height, self.vertical_speed = self.ground, max(0.0, self.vertical_speed)
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
        if self.on_ground and self.target_height <= self.ground:
            return 0.0
        wanted = self.target_height - self.height
        speed = max(-2.0, min(self.climb_speed, wanted))
        return max(0.0, min(2.0 * GRAVITY, GRAVITY + 3.0 * (speed - self.vertical_speed)))

    def _turn(self, dt: float) -> None:
        way = self.way_down
        if self.on_ground or (self.armed and not self.motors_failed):
            self.roll = 0.0
        elif way is not None:
            most = _TURN_RATE * dt
            self.roll += max(-most, min(most, way.tilt - self.roll))
        elif self.canopy > 0.0:
            self.roll = math.copysign(max(0.0, abs(self.roll) - 2.0 * dt), self.roll)
        else:
            self.roll = min(2.5, self.roll + self.tumble_rate * dt)
