"""Every measurement in a VehicleState."""

from __future__ import annotations

import math
from collections.abc import Mapping

from chute_ros.model import VehicleState, pressure_altitude
from chute_ros.supervisor.measured import Sample
from chute_ros.supervisor.measurements import DEGREES

_EARTH_RADIUS = 6_371_000.0  # m
#: A commanded height is missed if the vehicle is lower by more than this, m: at half of its climb
#: speed a controller is as far behind.
_MISSES_TARGET = 1.5


def samples_of(
    vehicle: VehicleState,
    received: float,
    home: tuple[float, float] | None,
    home_altitude: float = math.nan,
) -> Mapping[str, Sample]:
    """Every measurement in a VehicleState. received: monotonic s; home: degrees; home_altitude: m
    above mean sea level of what heights are above, wherever home is now; NaN: of home."""
    above = vehicle.altitude - home_altitude
    height = (vehicle.height, vehicle.height_age)
    told = {
        "height": height if math.isnan(above) else (above, vehicle.altitude_age),
        "pressure_altitude": (pressure_altitude(vehicle.pressure), vehicle.pressure_age),
        "vertical_speed": (vehicle.vertical_speed, vehicle.vertical_speed_age),
        "tilt_deg": (vehicle.tilt * DEGREES, vehicle.attitude_age),
        "attitude_error": (vehicle.attitude_error * DEGREES, vehicle.attitude_error_age),
        "sink_beyond_target": _sink_beyond_target(vehicle),
        "acceleration": (vehicle.acceleration, vehicle.acceleration_age),
        "battery_voltage": (vehicle.battery_voltage, vehicle.battery_age),
        "battery_remaining": (vehicle.battery_remaining, vehicle.battery_age),
    }
    if home is not None:
        here = (vehicle.latitude, vehicle.longitude)
        told["distance_from_home"] = (distance_between(home, here), vehicle.position_age)
    return {name: Sample(value, received - age) for name, (value, age) in told.items()}


def _sink_beyond_target(vehicle: VehicleState) -> tuple[float, float]:
    """m/s, and how old it is, s. Of one that is lower than it was commanded no sink was. A height
    below it commands none: ArduCopter tells 0 m in a hover, after a take-off in GUIDED."""
    value = vehicle.target_vertical_speed - vehicle.vertical_speed
    if math.isnan(vehicle.target_vertical_speed):
        missed = vehicle.below_target > _MISSES_TARGET
        value = -vehicle.vertical_speed if missed else math.nan
    return value, max(vehicle.target_age, vehicle.vertical_speed_age)


def distance_between(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Way over ground between two (latitude, longitude) in degrees, m (haversine formula); NaN:
    one is no place on earth."""
    if not (on_earth(*one) and on_earth(*other)):
        return math.nan
    latitude_1, longitude_1, latitude_2, longitude_2 = (
        math.radians(angle) for angle in (*one, *other)
    )
    half = (
        math.sin((latitude_2 - latitude_1) / 2) ** 2
        + math.cos(latitude_1)
        * math.cos(latitude_2)
        * math.sin((longitude_2 - longitude_1) / 2) ** 2
    )
    # Rounding must not leave the domain of asin.
    return 2.0 * _EARTH_RADIUS * math.asin(min(1.0, math.sqrt(half)))


def on_earth(latitude: float, longitude: float) -> bool:
    """Is it a place? Degrees."""
    return abs(latitude) <= 90.0 and abs(longitude) <= 360.0  # NaN is not
