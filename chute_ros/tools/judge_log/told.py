"""The MAVLink messages with which an autopilot tells what a log has of its vehicle.

Source: MAVLink common.xml. SI units and radians in; time_boot_ms is filled in by who sends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect

_GRAVITY = 9.80665  # m/s^2
_INT16, _INT32 = 2**15 - 1, 2**31 - 1
_IMUS = (
    dialect.MAVLink_scaled_imu_message,
    dialect.MAVLink_scaled_imu2_message,
    dialect.MAVLink_scaled_imu3_message,
)
#: ATTITUDE_TARGET_TYPEMASK: the rates are ignored.
_ATTITUDE_ONLY = 0b111
#: POSITION_TARGET_TYPEMASK: all is ignored but z and vz; besides, one of them.
_HEIGHT_AND_SPEED, _NO_HEIGHT, _NO_SPEED = 0b1101_1101_1011, 0b100, 0b10_0000


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


def attitude(roll: float, pitch: float, yaw: float) -> Any:
    """The attitude."""
    return dialect.MAVLink_attitude_message(0, roll, pitch, yaw, 0.0, 0.0, 0.0)


def position(
    height: float, vertical_speed: float, altitude: float, latitude: float, longitude: float
) -> Any:
    """height above home, vertical_speed up; altitude and degrees NaN: not known."""
    known = all(map(math.isfinite, (altitude, latitude, longitude)))
    return dialect.MAVLink_global_position_int_message(
        0,
        *((round(latitude * 1e7), round(longitude * 1e7)) if known else (0, 0)),
        _whole(altitude * 1000.0, _INT32) if known else 0,
        *(_whole(height * 1000.0, _INT32), 0, 0),
        *(_whole(-vertical_speed * 100.0, _INT16), 65535),
    )


def pressure(pascal: float) -> Any:
    """Of the barometer."""
    return dialect.MAVLink_scaled_pressure_message(0, pascal / 100.0, 0.0, 0)


def acceleration(which: int, x: float, y: float, z: float) -> Any:
    """Specific force of an accelerometer, 0 to 2."""
    parts = (_whole(part / _GRAVITY * 1000.0, _INT16) for part in (x, y, z))
    return _IMUS[which](0, *parts, 0, 0, 0, 0, 0, 0)


def battery(voltage: float, remaining: float) -> Any:
    """remaining: 0 to 1; NaN: not known."""
    share = _whole(remaining * 100.0, 100) if math.isfinite(remaining) else -1
    millivolt = 65535
    if math.isfinite(voltage):
        millivolt = min(65534, max(0, round(voltage * 1000.0)))
    return dialect.MAVLink_sys_status_message(*(0, 0, 0, 0), millivolt, -1, share, *(0,) * 6)


def attitude_target(quaternion: Sequence[float], thrust: float) -> Any:
    """What it was told to turn to; thrust 0 to 1, NaN: not known."""
    mask = _ATTITUDE_ONLY
    if not math.isfinite(thrust):
        mask, thrust = mask | dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE, 0.0
    turned = list(quaternion)
    return dialect.MAVLink_attitude_target_message(0, mask, turned, 0.0, 0.0, 0.0, thrust)


def position_target(height: float, vertical_speed: float) -> Any:
    """Above the origin, and up; NaN: not told."""
    mask = _HEIGHT_AND_SPEED
    mask |= 0 if math.isfinite(height) else _NO_HEIGHT
    mask |= 0 if math.isfinite(vertical_speed) else _NO_SPEED
    z, vz = (-one if math.isfinite(one) else 0.0 for one in (height, vertical_speed))
    return dialect.MAVLink_position_target_local_ned_message(
        *(0, dialect.MAV_FRAME_LOCAL_NED, mask, 0.0, 0.0, z, 0.0, 0.0, vz, 0.0, 0.0, 0.0, 0.0, 0.0)
    )


def local_position(height: float, vertical_speed: float) -> Any:
    """Above the origin, and up."""
    return dialect.MAVLink_local_position_ned_message(
        0, 0.0, 0.0, -height, 0.0, 0.0, -vertical_speed
    )


def wing_target(roll: float, pitch: float, too_low: float) -> Any:
    """As ArduPlane tells it; too_low: m below its target."""
    return dialect.MAVLink_nav_controller_output_message(
        math.degrees(roll), math.degrees(pitch), 0, 0, 0, too_low, 0.0, 0.0
    )


def home(altitude: float, latitude: float, longitude: float, below_origin: float) -> Any:
    """Where heights begin; below_origin: m."""
    return dialect.MAVLink_home_position_message(
        *(round(latitude * 1e7), round(longitude * 1e7), _whole(altitude * 1000.0, _INT32)),
        *(0.0, 0.0, below_origin, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0),
    )


def _whole(value: float, most: int) -> int:
    return round(max(-most, min(most, value))) if math.isfinite(value) else 0
