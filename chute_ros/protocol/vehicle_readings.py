"""What standard ROS messages say of the vehicle, in the terms of model.VehicleState.

A reader takes one message and gives a mapping: each part that the message speaks of, with its
values in the order of PARTS, or None where the message does not know it (a value that is not
finite, a mark for "no estimate"). No content of a message makes a reader raise.

Sources: REP 103 (world: x east, y north, z up; body: x forward, y left, z up), REP 105 (frames),
REP 145 (an IMU's linear acceleration is the specific force, gravity included), the comments in
nav_msgs/Odometry and sensor_msgs/Imu, and MAVROS 2.12 for what its topics carry.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from chute_ros.model import Armed, LandedState, LinkState, VehicleState

#: Each part of the picture and the fields of model.VehicleState that it fills.
PARTS: dict[str, tuple[str, ...]] = {
    "armed": ("armed",),
    "landed_state": ("landed_state",),
    "height": ("height",),
    "altitude": ("altitude",),
    "pressure": ("pressure",),
    "vertical_speed": ("vertical_speed",),
    "attitude": ("roll", "pitch", "yaw", "tilt"),
    "attitude_error": ("attitude_error",),
    "target": ("target_vertical_speed", "below_target"),
    "acceleration": ("acceleration", "acceleration_spread"),
    "position": ("latitude", "longitude"),
    "battery": ("battery_voltage", "battery_remaining"),
}
#: The autopilot's own word, without an age field: state of the link to it, MAV_STATE of MAVLink.
AUTOPILOT = "autopilot"

Values = tuple[Any, ...]
Parts = Mapping[str, Values | None]

#: What a quaternion's length may differ from 1: more than rounding and drift of a filter make.
_LENGTH_TOLERANCE = 0.01
#: V. What MAVROS makes of the mark for "not known" in MAVLink's SYS_STATUS, 65535 mV.
_VOLTAGE_NOT_KNOWN = 65.535
#: Endings of frame ids whose axes are not those of REP 103: north east down, forward right down.
_FOREIGN_ENDINGS = ("_ned", "_frd")
#: REP 105: what stands still, or drifts with what is taken to.
_OF_THE_WORLD = ("earth", "map", "odom", "world")


def wrong_frame(frame_id: str, child_frame_id: str) -> str:
    """Why what is told in these frames is not what it is read as, in words; empty: it is.

    A frame may say itself that its axes point down (REP 105 adds such endings): a height or a
    pitch would have the wrong sign. A twist is in the frame of the body (nav_msgs/Odometry): of
    one in the world's a bank or a pitch would make a sink. child_frame_id: empty, if not said.
    """
    down = next((one for one in (frame_id, child_frame_id) if one.endswith(_FOREIGN_ENDINGS)), "")
    if down:
        return f"frame {down!r} has its axes pointing down, not as REP 103 has them"
    if child_frame_id and child_frame_id in (frame_id, *_OF_THE_WORLD):
        return f"child_frame_id {child_frame_id!r} is no frame of the body, whose twist is needed"
    return ""


def odometry(message: Any) -> Parts:
    """nav_msgs/Odometry: height of the pose over its frame's origin, attitude, vertical speed.

    The twist is in the body's frame, so that it takes the attitude to know what of it is upward.
    """
    orientation = message.pose.pose.orientation
    return {
        "height": _finite(message.pose.pose.position.z),
        "vertical_speed": _upward(orientation, message.twist.twist.linear),
        "attitude": attitude(orientation),
    }


def imu(message: Any) -> Parts:
    """sensor_msgs/Imu: attitude, and length of the specific force in m/s^2.

    Element 0 of a covariance is -1: the sensor does not estimate that. (Orientation: of a sensor
    mounted along the vehicle's axes.)
    """
    return {
        "attitude": _if_estimated(message.orientation_covariance, attitude(message.orientation)),
        "acceleration": _if_estimated(
            message.linear_acceleration_covariance, _length(message.linear_acceleration)
        ),
    }


def mavros_state(message: Any) -> Parts:
    """mavros_msgs/State: armed, link to the autopilot, MAV_STATE.

    Not connected, MAVROS sends "not armed" without having heard it: that is not taken over.
    """
    if not message.connected:
        return {"armed": None, AUTOPILOT: (LinkState.LOST, 0)}
    armed = Armed.ARMED if message.armed else Armed.DISARMED
    return {"armed": (armed,), AUTOPILOT: (LinkState.OK, int(message.system_status))}


def mavros_extended_state(message: Any) -> Parts:
    """mavros_msgs/ExtendedState: landed state, in the numbers of MAV_LANDED_STATE."""
    known = LandedState.UNKNOWN < message.landed_state <= max(LandedState)
    return {"landed_state": (LandedState(message.landed_state),) if known else None}


def battery(message: Any) -> Parts:
    """sensor_msgs/BatteryState as MAVROS fills it: voltage in V, remaining charge 0 to 1."""
    voltage, remaining = message.voltage, message.percentage
    if not 0.0 < voltage < math.inf or abs(voltage - _VOLTAGE_NOT_KNOWN) < 0.001:
        voltage = math.nan
    if not 0.0 <= remaining <= 1.0:  # MAVROS sends -0.01 where the autopilot does not know
        remaining = math.nan
    unknown = math.isnan(voltage) and math.isnan(remaining)
    return {"battery": None if unknown else (voltage, remaining)}


def position(message: Any) -> Parts:
    """sensor_msgs/NavSatFix: latitude and longitude in degrees, WGS 84, and the altitude, m: above
    the ellipsoid, which no home moves either, and of which changes alone count."""
    found = _finite(message.latitude, message.longitude)
    # Below 0 there is no fix; 0, 0 is what receivers send before they know.
    if found is None or message.status.status < 0 or found == (0.0, 0.0):
        return {"position": None, "altitude": None}
    inside = abs(message.latitude) <= 90.0 and abs(message.longitude) <= 180.0
    return {"position": found if inside else None, "altitude": _finite(message.altitude)}


def relative_altitude(message: Any) -> Parts:
    """std_msgs/Float64 on MAVROS's global_position/rel_alt: height above home, m."""
    return {"height": _finite(message.data)}


def vehicle_state(state: VehicleState) -> Parts:
    """Every part of a VehicleState, and the autopilot's own word; ages are the caller's."""
    parts: dict[str, Values | None] = {}
    for part, names in PARTS.items():
        values = tuple(getattr(state, name) for name in names)
        received = math.isfinite(getattr(state, f"{part}_age"))
        parts[part] = values if received and any(map(_known, values)) else None
    return {**parts, AUTOPILOT: (state.link_state, state.system_status)}


def attitude(orientation: Any) -> Values | None:
    """Roll, pitch, yaw (aircraft axes, yaw 0 to north, clockwise) and tilt, rad.

    orientation: the quaternion that turns forward-left-up into east-north-up. None: its length
    is not 1, as of one that nobody filled in with an attitude.
    """
    unit = _unit(orientation)
    if unit is None:
        return None
    w, x, y, z = unit
    upright = 1.0 - 2.0 * (x * x + y * y)
    roll = math.atan2(2.0 * (w * x + y * z), upright)
    # The left-hand axis of the body is the right-hand one of aircraft, turned round.
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (x * z - w * y))))
    heading = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    yaw = math.remainder(math.pi / 2.0 - heading, 2.0 * math.pi)
    return roll, pitch, yaw, math.acos(max(-1.0, min(1.0, upright)))


def _upward(orientation: Any, velocity: Any) -> Values | None:
    """What of a velocity in the body's frame (m/s) is upward in the world."""
    unit = _unit(orientation)
    if unit is None:
        return None
    w, x, y, z = unit
    return _finite(
        2.0 * (x * z - w * y) * velocity.x
        + 2.0 * (y * z + w * x) * velocity.y
        + (1.0 - 2.0 * (x * x + y * y)) * velocity.z
    )


def _unit(orientation: Any) -> tuple[float, float, float, float] | None:
    w, x, y, z = orientation.w, orientation.x, orientation.y, orientation.z
    length = math.hypot(w, x, y, z)
    # NaN is not within the tolerance either.
    if not abs(length - 1.0) <= _LENGTH_TOLERANCE:
        return None
    return w / length, x / length, y / length, z / length


def _length(vector: Any) -> Values | None:
    return _finite(math.hypot(vector.x, vector.y, vector.z))


def _finite(*values: float) -> Values | None:
    return values if all(map(math.isfinite, values)) else None


def _if_estimated(covariance: Any, values: Values | None) -> Values | None:
    return None if covariance[0] == -1.0 else values


def _known(value: Any) -> bool:
    """Not NaN, and not the member 0 (unknown) of an enumeration."""
    return bool(value) if isinstance(value, Armed | LandedState) else not math.isnan(value)
