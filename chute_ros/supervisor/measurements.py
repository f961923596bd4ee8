"""Measurements of the vehicle by name: what each may be, and what is derived from which."""

from __future__ import annotations

import math
from dataclasses import dataclass

from chute_ros.errors import ParameterError

DEGREES = 180.0 / math.pi


@dataclass(frozen=True)
class Limits:
    """What a measurement may be: range, unit/s of change and unit that it may jump besides, age
    and how long it may stay the same to the last bit, s (0: for ever)."""

    minimum: float
    maximum: float
    rate: float
    jump: float
    max_age: float
    stuck_after: float

    def __post_init__(self) -> None:
        if not self.minimum < self.maximum:
            raise ParameterError(f"range {self.minimum} to {self.maximum}: need a larger second")
        for name in ("rate", "jump", "stuck_after"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ParameterError(f"{name} is {getattr(self, name)}: need 0 or more")
        if not 0.0 < self.max_age <= 60.0:
            raise ParameterError(f"max_age is {self.max_age}: need above 0, up to 60 s")


#: Every measurement by name, with limits for any vehicle; a profile may set others.
STANDARD_LIMITS: dict[str, Limits] = {
    # m above take-off, up positive
    "height": Limits(-500.0, 50_000.0, 400.0, 10.0, 1.0, 5.0),
    # m/s, up positive
    "vertical_speed": Limits(-400.0, 400.0, 200.0, 5.0, 1.0, 5.0),
    # m in the standard atmosphere, of the static pressure: only its changes are told
    "pressure_altitude": Limits(-2000.0, 80_000.0, 400.0, 10.0, 1.0, 1.0),
    # degrees between the vehicle's axis and the vertical, 0 upright to 180; pi as float32 is more
    "tilt_deg": Limits(0.0, 180.001, 2000.0, 60.0, 0.5, 5.0),
    # degrees between the vehicle's axis and the one that it was commanded
    "attitude_error": Limits(0.0, 180.001, 2000.0, 180.0, 0.5, 0.0),
    # m/s by which it sinks faster than it was commanded; it may change with the command at once
    "sink_beyond_target": Limits(-400.0, 400.0, 200.0, 100.0, 1.0, 0.0),
    # m/s^2, length of the specific force: 9.8 at rest, 0 in free fall
    "acceleration": Limits(0.0, 2000.0, 100_000.0, 200.0, 0.5, 5.0),
    # m over ground from where it took off
    "distance_from_home": Limits(0.0, 20_000_000.0, 400.0, 30.0, 2.0, 0.0),
    # V
    "battery_voltage": Limits(0.0, 1000.0, 100.0, 60.0, 10.0, 0.0),
    # remaining charge, 0 to 1
    "battery_remaining": Limits(0.0, 1.0, 0.5, 0.3, 10.0, 0.0),
}

HEIGHT, VERTICAL_SPEED = "height", "vertical_speed"
SINK_BEYOND_TARGET = "sink_beyond_target"
#: What tells of a fall whichever way up it is.
FALL_SIGNS = ("vertical_speed", "acceleration")
PRESSURE_ALTITUDE, ACCELERATION, TILT = "pressure_altitude", "acceleration", "tilt_deg"
#: From the barometer's heights of the last second (where it tells none from the estimator's), from
#: the vertical speeds of the last second, m/s^2, and from the accelerations of the last three
#: seconds, m/s. On these conditions can rest as on the measurements that tell them.
CLIMB_RATE, VERTICAL_ACCELERATION = "climb_rate", "vertical_acceleration"
FELT_DROP, FELT_FALL = "felt_drop", "felt_fall"
#: What others tell besides an estimator, over the last second: by how much a barometer's rate
#: differs from its vertical speed, m/s, and the force from what it needs, m/s^2.
SPEED_ERROR, FORCE_ERROR = "speed_error", "force_error"
DERIVED: dict[str, tuple[str, ...]] = {
    CLIMB_RATE: (HEIGHT, PRESSURE_ALTITUDE),
    VERTICAL_ACCELERATION: (VERTICAL_SPEED,),
    FELT_DROP: (ACCELERATION,),
    FELT_FALL: (ACCELERATION,),
    SPEED_ERROR: (PRESSURE_ALTITUDE, VERTICAL_SPEED),
    FORCE_ERROR: (ACCELERATION, VERTICAL_SPEED, TILT),
}


#: The unit of each, for people.
UNITS: dict[str, str] = {
    "height": "m above take-off",
    "vertical_speed": "m/s, up positive",
    "pressure_altitude": "m in the standard atmosphere",
    "tilt_deg": "degrees from upright, 0 to 180",
    "attitude_error": "degrees from the commanded attitude, 0 to 180",
    "sink_beyond_target": "m/s by which it sinks faster than commanded",
    "acceleration": "m/s^2, length of the specific force: 9.8 at rest, 0 in free fall",
    "distance_from_home": "m over ground from where it took off",
    "battery_voltage": "V",
    "battery_remaining": "remaining charge, 0 to 1",
}
