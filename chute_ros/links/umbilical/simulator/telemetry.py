"""The $TELEM lines of a simulated flight computer, in any layout, printed as Rust prints."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_DOWN, Context, Decimal
from functools import lru_cache

from chute_ros.links.umbilical.protocol.fields import FieldType
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.simulator.settings import ComputerMode
from chute_ros.sim.rocket import GRAVITY, Rocket

_F32 = struct.Struct("<f")
_BOTH_WAYS = (ROUND_FLOOR, ROUND_CEILING)
#: To the nearest decimal of so many digits.
_NEAREST = {digits: Context(digits, ROUND_HALF_DOWN) for digits in range(1, 10)}


def rust_text(value: float, bits: int) -> str:
    """A float of 32 or 64 bits as Rust's {} prints it: shortest, and never with an exponent."""
    if bits == 32:
        return _text_of_f32(_f32(value))
    return _signed_text(value, lambda size: Decimal(repr(size)))


# Most fields do not change from line to line. By its bytes, as 0 and -0 are equal.
@lru_cache(maxsize=4096)
def _text_of_f32(value: bytes) -> str:
    return _signed_text(_F32.unpack(value)[0], _shortest_f32)


def _signed_text(value: float, shortest: Callable[[float], Decimal]) -> str:
    """shortest: the digits of a finite number >= 0."""
    if math.isnan(value):
        return "NaN"
    sign = "-" if math.copysign(1.0, value) < 0.0 else ""
    size = abs(value)
    return sign + ("inf" if math.isinf(size) else _without_exponent(shortest(size)))


def _without_exponent(digits: Decimal) -> str:
    text = format(digits, "f")
    return text.rstrip("0").rstrip(".") if "." in text else text


def telem_body(layout: Layout, values: Mapping[str, float]) -> str:
    """A line without "$TELEM,": a value for each field by its name; one that is not given is 0."""
    return ",".join(_text(field.kind, values.get(field.name, 0.0)) for field in layout.fields)


def telem_line(body: str) -> str:
    """The line of this body, without its end."""
    return f"$TELEM,{body}"


def sensor_values(rocket: Rocket, mode: ComputerMode) -> dict[str, float]:
    """What the sensors measure and what is computed from it alone, by field name."""
    air = rocket.air
    speed = math.hypot(rocket.speed_north, rocket.speed_east)
    coasting = mode is ComputerMode.Coast
    braking = 0.5 if coasting else 0.0
    after = mode in (ComputerMode.DrogueDeployed, ComputerMode.MainDeployed)
    steered = mode is ComputerMode.MainDeployed and not rocket.on_ground
    bearing = math.degrees(math.atan2(rocket.speed_east, rocket.speed_north)) % 360.0
    wind = math.degrees(math.atan2(-rocket.wind_east, -rocket.wind_north)) % 360.0
    return {
        "pressure": air.pressure,
        "temp": air.temperature - 273.15,
        "altitude": rocket.altitude,
        "latitude": rocket.latitude,
        "longitude": rocket.longitude,
        "num_satellites": 12,
        "mag_x": 18.25,
        "mag_y": -4.8,
        "mag_z": -47.6,
        "accel_x": 0.02,
        "accel_y": -0.01,
        "accel_z": rocket.specific_force,
        "gyro_x": 0.05,
        "gyro_y": -0.1,
        "gyro_z": 0.0 if rocket.on_ground else 12.5,
        "pt3": 1843.0,
        "pt4": 1790.5,
        "rtd": 2051.0,
        "airbrake_state": 1 if coasting else 2 if after else 0,
        "airbrake_deployment": braking,
        "predicted_apogee": _predicted_apogee(rocket),
        "h_acc": 1500,
        "v_acc": 2500,
        "vel_n": rocket.speed_north,
        "vel_e": rocket.speed_east,
        "vel_d": -rocket.vertical_speed,
        "g_speed": speed,
        "s_acc": 300,
        "head_acc": 500_000 if speed else 18_000_000,
        "fix_type": 3,
        "head_mot": round(bearing * 1e5),
        "blims_phase_id": 1 if steered else 0,
        "blims_pid_p": 0.8,
        "blims_pid_i": 0.05,
        "blims_bearing": bearing,
        "blims_wind_from_deg": wind,
    }


def target_values(
    layout: Layout, target: tuple[float, ...], latitude: float, longitude: float
) -> dict[str, float]:
    """The fields that show the target, and the way to its first point; no target: none."""
    if not target:
        return {}
    north = (target[0] - latitude) * 111_320.0
    east = (target[1] - longitude) * 111_320.0 * math.cos(math.radians(latitude))
    return {
        **dict(zip(layout.target_fields, target, strict=False)),
        "blims_dist_to_target_m": math.hypot(north, east),
        "blims_heading_des": math.degrees(math.atan2(east, north)) % 360.0,
    }


def _predicted_apogee(rocket: Rocket) -> float:
    rise = max(0.0, rocket.vertical_speed) ** 2 / (2.0 * GRAVITY)
    return max(rocket.apogee, rocket.height + rise)


def _text(kind: FieldType, value: float) -> str:
    if not kind.is_whole:
        return rust_text(value, int(kind.name[1:]))
    return str(int(max(kind.lowest, min(kind.highest, value))))


def _f32(value: float) -> bytes:
    try:
        return _F32.pack(value)
    except OverflowError:
        return _F32.pack(math.copysign(math.inf, value))


def _rounded_to_f32(value: float) -> float:
    return float(_F32.unpack(_f32(value))[0])


def _shortest_f32(value: float) -> Decimal:
    """The shortest decimal that reads back as value, and of those the nearest. value: >= 0."""
    if value == 0.0:
        return Decimal(0)
    if math.frexp(value)[0] != 0.5:  # no power of two
        # Its neighbours are equally far: the nearest decimal of so many digits reads back as it,
        # or none of so many does; and that of one digit more is nearer. Most need eight or nine.
        shortest = _NEAREST[9].create_decimal_from_float(value)
        for digits in range(8, 0, -1):
            near = _NEAREST[digits].create_decimal_from_float(value)
            if _rounded_to_f32(float(near)) != value:
                break
            shortest = near
        return shortest
    # The neighbour below is nearer than that above: the nearest decimal may be too low, and one
    # that is further off, but higher, may read back as it.
    for digits in range(1, 10):
        both = [Context(digits, one).create_decimal_from_float(value) for one in _BOTH_WAYS]
        found = [one for one in both if _rounded_to_f32(float(one)) == value]
        if found:
            return min(found, key=lambda one: abs(one - Decimal(value)))
    raise AssertionError(f"nine digits tell every 32-bit float, but not {value!r}")
