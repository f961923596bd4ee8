"""Vertical flight of a rocket: burn, coast, apogee, descent under drogue and main, landing.

A point mass with quadratic drag that drifts with the wind. Not an aerodynamic model: enough for
heights, speeds, pressures and times to mean something. SI units, up positive, time in s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chute_ros.sim.air import Air, air_at

GRAVITY = 9.80665  # m/s^2
#: Longest step of the integration, s; a longer one is divided.
_STEP = 0.02
_METRES_PER_DEGREE = 111_320.0
_SEA_LEVEL_DENSITY = air_at(0.0).density


@dataclass
class Rocket:
    """State of the rocket; step moves it on. The defaults fly to about 3000 m (10 000 ft)."""

    #: Without and of propellant, kg.
    dry_mass: float = 36.0
    propellant_mass: float = 9.0
    thrust: float = 2180.0  # N
    burn_time: float = 6.0  # s
    #: Drag coefficient times cross section, without canopies, m^2.
    drag_area: float = 0.0095
    #: Speeds at which it sinks in the air of the sea level, m/s.
    drogue_speed: float = 25.0
    main_speed: float = 6.5
    #: From release to a full canopy, s.
    drogue_opening_time: float = 0.6
    main_opening_time: float = 1.8
    #: The wind that carries it as soon as it flies, m/s.
    wind_north: float = 1.0
    wind_east: float = 3.0
    #: The launch site, degrees and m above the sea.
    site_latitude: float = 42.4419
    site_longitude: float = -76.4878
    site_altitude: float = 0.0

    #: Above the launch site, m.
    height: float = 0.0
    vertical_speed: float = 0.0
    #: Position from the launch site, m.
    north: float = 0.0
    east: float = 0.0
    #: Since the ignition, s; NaN: not ignited.
    burned_for: float = math.nan
    #: Since the release, s; NaN: not released.
    drogue_out_for: float = math.nan
    main_out_for: float = math.nan
    #: What an accelerometer along the axis measures, m/s^2.
    specific_force: float = GRAVITY
    #: The greatest height so far, m.
    apogee: float = 0.0

    @property
    def on_ground(self) -> bool:
        """It stands or lies."""
        return self.height <= 0.0

    @property
    def burning(self) -> bool:
        """The motor pushes."""
        return self.burned_for < self.burn_time

    @property
    def mass(self) -> float:
        """With what is left of the propellant, kg."""
        burned = 0.0 if math.isnan(self.burned_for) else min(1.0, self.burned_for / self.burn_time)
        return self.dry_mass + self.propellant_mass * (1.0 - burned)

    @property
    def air(self) -> Air:
        """The air around it."""
        return air_at(self.altitude)

    @property
    def altitude(self) -> float:
        """Above the sea, m."""
        return self.site_altitude + self.height

    @property
    def latitude(self) -> float:
        """Degrees."""
        return self.site_latitude + self.north / _METRES_PER_DEGREE

    @property
    def longitude(self) -> float:
        """Degrees."""
        scale = _METRES_PER_DEGREE * math.cos(math.radians(self.site_latitude))
        return self.site_longitude + self.east / scale

    @property
    def speed_north(self) -> float:
        """Over the ground, m/s."""
        return 0.0 if self.on_ground else self.wind_north

    @property
    def speed_east(self) -> float:
        """Over the ground, m/s."""
        return 0.0 if self.on_ground else self.wind_east

    def ignite(self) -> None:
        """Light the motor; one that is spent stays so."""
        if math.isnan(self.burned_for):
            self.burned_for = 0.0

    def release_drogue(self) -> None:
        """The drogue comes out."""
        if math.isnan(self.drogue_out_for):
            self.drogue_out_for = 0.0

    def release_main(self) -> None:
        """The main canopy comes out."""
        if math.isnan(self.main_out_for):
            self.main_out_for = 0.0

    def land(self) -> None:
        """Put it on the ground, where it is."""
        self.height = self.vertical_speed = 0.0
        self.specific_force = GRAVITY

    def step(self, dt: float) -> None:
        """Move on by dt, s."""
        steps = max(1, math.ceil(dt / _STEP - 1e-9))
        for _ in range(steps):
            self._step(dt / steps)

    def _step(self, dt: float) -> None:
        push = self.thrust / self.mass if self.burning else 0.0
        drag = 0.5 * self.air.density * self._area() / self.mass  # 1/m
        self.burned_for += dt
        self.drogue_out_for += dt
        self.main_out_for += dt
        before = self.vertical_speed
        # The drag is taken at the end of the step: a canopy that opens at a high speed brakes
        # hard, and taken at the beginning it would throw the rocket back.
        without_gravity = (before + push * dt) / (1.0 + drag * abs(before) * dt)
        self.vertical_speed = without_gravity - GRAVITY * dt
        self.specific_force = (without_gravity - before) / dt
        self.height += self.vertical_speed * dt
        if self.height <= 0.0:
            self.height = 0.0
            self.vertical_speed = max(0.0, self.vertical_speed)
            self.specific_force = max(GRAVITY, push)
        self.apogee = max(self.apogee, self.height)
        self.north += self.speed_north * dt
        self.east += self.speed_east * dt

    def _area(self) -> float:
        """Drag area with the canopies as far as they are open, m^2."""
        area = self.drag_area
        for released_for, opening_time, speed in (
            (self.drogue_out_for, self.drogue_opening_time, self.drogue_speed),
            (self.main_out_for, self.main_opening_time, self.main_speed),
        ):
            if not math.isnan(released_for):
                full = 2.0 * self.dry_mass * GRAVITY / (_SEA_LEVEL_DENSITY * speed**2)
                area += full * min(1.0, released_for / opening_time) ** 2
        return area
