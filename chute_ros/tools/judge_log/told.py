"""The MAVLink messages with which an autopilot tells what a log has of its vehicle.

Source: MAVLink common.xml. SI units and radians in; time_boot_ms is filled in by who sends. A
message without the number that it is there for is none (None): that is not known, or beyond what
its field can hold.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect

_GRAVITY = 9.80665  # m/s^2
_INT16, _INT32 = 2**15 - 1, 2**31 - 1
#: The largest 32-bit float.
_SINGLE = 3.4028234e38
_IMUS = (
    dialect.MAVLink_scaled_imu_message,
    dialect.MAVLink_scaled_imu2_message,
    dialect.MAVLink_scaled_imu3_message,
)
#: ATTITUDE_TARGET_TYPEMASK: the rates are ignored.
_ATTITUDE_ONLY = 0b111
#: POSITION_TARGET_TYPEMASK: all is ignored but z and vz; besides, one of them.
_HEIGHT_AND_SPEED, _NO_HEIGHT, _NO_SPEED = 0b1101_1101_1011, 0b100, 0b10_0000


def _if_told(make: Callable[..., Any]) -> Callable[..., Any]:
    """What the numbers make, or None where one of them cannot be told."""

    @functools.wraps(make)
    def made(*numbers: Any) -> Any:
        try:
            return make(*numbers)
        except _NotToldError:
            return None

    return made


class _NotToldError(Exception):
    """A message would have no meaning without this number."""


def heartbeat(
    vehicle_type: int, autopilot: int, armed: bool, mode: int = 0, critical: bool = False
) -> Any:
    """mode: HEARTBEAT.custom_mode."""
    flags = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    flags |= dialect.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    status = dialect.MAV_STATE_ACTIVE if armed else dialect.MAV_STATE_STANDBY
    status = dialect.MAV_STATE_CRITICAL if critical else status
    return dialect.MAVLink_heartbeat_message(vehicle_type, autopilot, flags, mode, status, 3)


def landed(in_air: bool) -> Any:
    """What it takes itself to do."""
    state = dialect.MAV_LANDED_STATE_IN_AIR if in_air else dialect.MAV_LANDED_STATE_ON_GROUND
    return dialect.MAVLink_extended_sys_state_message(0, state)


@_if_told
def attitude(roll: float, pitch: float, yaw: float) -> Any:
    """The attitude."""
    angles = map(_single, (roll, pitch, yaw))
    return dialect.MAVLink_attitude_message(0, *angles, 0.0, 0.0, 0.0)


@_if_told
def position(
    height: float, vertical_speed: float, altitude: float, latitude: float, longitude: float
) -> Any:
    """height above home, vertical_speed up; altitude and degrees NaN: not known."""
    known = _are_within(((altitude, _INT32 / 1e3), (latitude, 90.0), (longitude, 180.0)))
    return dialect.MAVLink_global_position_int_message(
        0,
        *((round(latitude * 1e7), round(longitude * 1e7)) if known else (0, 0)),
        round(altitude * 1000.0) if known else 0,
        *(_millimetres(height), 0, 0),
        *(_whole(-vertical_speed * 100.0, _INT16), 65535),
    )


@_if_told
def pressure(pascal: float) -> Any:
    """Of the barometer."""
    return dialect.MAVLink_scaled_pressure_message(0, _single(pascal / 100.0), 0.0, 0)


@_if_told
def acceleration(which: int, x: float, y: float, z: float) -> Any:
    """Specific force of an accelerometer, 0 to 2."""
    if not all(map(math.isfinite, (x, y, z))):
        raise _NotToldError
    parts = (_whole(part / _GRAVITY * 1000.0, _INT16) for part in (x, y, z))
    return _IMUS[which](0, *parts, 0, 0, 0, 0, 0, 0)


def battery(voltage: float, remaining: float) -> Any:
    """remaining: 0 to 1; NaN: not known."""
    share = _whole(remaining * 100.0, 100) if math.isfinite(remaining) else -1
    millivolt = 65535
    if math.isfinite(voltage):
        millivolt = round(min(65534.0, max(0.0, voltage * 1000.0)))
    return dialect.MAVLink_sys_status_message(*(0, 0, 0, 0), millivolt, -1, share, *(0,) * 6)


@_if_told
def attitude_target(quaternion: Sequence[float], thrust: float) -> Any:
    """What it was told to turn to; thrust 0 to 1, NaN: not known."""
    mask = _ATTITUDE_ONLY
    if not math.isfinite(thrust):
        mask, thrust = mask | dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE, 0.0
    turned = [_single(part) for part in quaternion]
    return dialect.MAVLink_attitude_target_message(0, mask, turned, 0.0, 0.0, 0.0, _single(thrust))


@_if_told
def position_target(height: float, vertical_speed: float) -> Any:
    """Above the origin, and up; NaN: not told."""
    mask = _HEIGHT_AND_SPEED
    mask |= 0 if math.isfinite(height) else _NO_HEIGHT
    mask |= 0 if math.isfinite(vertical_speed) else _NO_SPEED
    z, vz = (_single(-one) if math.isfinite(one) else 0.0 for one in (height, vertical_speed))
    return dialect.MAVLink_position_target_local_ned_message(
        *(0, dialect.MAV_FRAME_LOCAL_NED, mask, 0.0, 0.0, z, 0.0, 0.0, vz, 0.0, 0.0, 0.0, 0.0, 0.0)
    )


@_if_told
def local_position(height: float, vertical_speed: float) -> Any:
    """Above the origin, and up."""
    return dialect.MAVLink_local_position_ned_message(
        0, 0.0, 0.0, _single(-height), 0.0, 0.0, _single(-vertical_speed)
    )


@_if_told
def wing_target(roll: float, pitch: float, too_low: float) -> Any:
    """As ArduPlane tells it; too_low: m below its target."""
    return dialect.MAVLink_nav_controller_output_message(
        *map(_single, (math.degrees(roll), math.degrees(pitch))),
        *(0, 0, 0, _single(too_low), 0.0, 0.0),
    )


@_if_told
def home(altitude: float, latitude: float, longitude: float, below_origin: float) -> Any:
    """Where heights begin; below_origin: m; degrees NaN: not known."""
    known = _are_within(((latitude, 90.0), (longitude, 180.0)))
    return dialect.MAVLink_home_position_message(
        *((round(latitude * 1e7), round(longitude * 1e7)) if known else (0, 0)),
        *(_millimetres(altitude), 0.0, 0.0, _single(below_origin)),
        *([1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0),
    )


def can_be_single(value: float) -> bool:
    """A 32-bit float can hold it."""
    return not math.isfinite(value) or abs(value) <= _SINGLE


def _single(value: float) -> float:
    if not can_be_single(value):
        raise _NotToldError
    return value


def _millimetres(metres: float) -> int:
    if not abs(metres) * 1000.0 <= _INT32:  # NaN is none either
        raise _NotToldError
    return round(metres * 1000.0)


def _are_within(values: Sequence[tuple[float, float]]) -> bool:
    """Each is known, and no further from 0 than this."""
    return all(abs(value) <= most for value, most in values)


def _whole(value: float, most: int) -> int:
    """Of what autopilots cut off at the ends of its field."""
    return round(max(-most, min(most, value))) if math.isfinite(value) else 0
