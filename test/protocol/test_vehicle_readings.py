"""Golden values of what Odometry, Imu and MAVROS's topics say, and what no input may do."""

import dataclasses
import math
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import Quaternion, Vector3
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Imu, NavSatFix

from chute_ros.model import Armed, LandedState, LinkState, VehicleState
from chute_ros.protocol import vehicle_readings as readings

NAN, INF = math.nan, math.inf
HALF = math.sqrt(0.5)
LEVEL_EAST = (1.0, 0.0, 0.0, 0.0)
ON_LEFT_SIDE = (HALF, -HALF, 0.0, 0.0)
NOSE_UP = (HALF, 0.0, -HALF, 0.0)
INVERTED = (0.0, 1.0, 0.0, 0.0)
THIRTY_UP = (math.cos(math.radians(15)), 0.0, -math.sin(math.radians(15)), 0.0)
#: w, x, y, z of forward-left-up in east-north-up; roll, pitch, yaw and tilt in degrees.
ATTITUDES = {
    "level, nose to the east": (LEVEL_EAST, 0, 0, 90, 0),
    "level, nose to the north": ((HALF, 0.0, 0.0, HALF), 0, 0, 0, 0),
    "level, nose to the west": ((0.0, 0.0, 0.0, 1.0), 0, 0, -90, 0),
    "level, nose to the south": ((HALF, 0.0, 0.0, -HALF), 0, 0, 180, 0),
    "the same quaternion's other sign": ((-HALF, 0.0, 0.0, -HALF), 0, 0, 0, 0),
    "nose up by 30 degrees": (THIRTY_UP, 0, 30, 90, 30),
    "right side down": ((HALF, HALF, 0.0, 0.0), 90, 0, 90, 90),
    "left side down by 30 degrees": (
        (math.cos(math.radians(15)), -math.sin(math.radians(15)), 0.0, 0.0),
        -30,
        0,
        90,
        30,
    ),
    "inverted": (INVERTED, 180, 0, 90, 180),
    "off by rounding": ((1.0 + 1e-3, 0.0, 0.0, 0.0), 0, 0, 90, 0),
}
#: Attitude and velocity in the body's frame; what of it is upward.
VERTICAL_SPEEDS = {
    "climbs level": (LEVEL_EAST, (5.0, 0.0, 2.0), 2.0),
    "falls level": (LEVEL_EAST, (0.0, 0.0, -7.0), -7.0),
    "falls on its left side, towards its left": (ON_LEFT_SIDE, (0.0, 7.0, 0.0), -7.0),
    "on its left side, belly first: level": (ON_LEFT_SIDE, (0.0, 0.0, -7.0), 0.0),
    "climbs like a rocket": (NOSE_UP, (80.0, 0.0, 0.0), 80.0),
    "falls tail first": (NOSE_UP, (-30.0, 0.0, 0.0), -30.0),
    "falls inverted": (INVERTED, (0.0, 0.0, 9.0), -9.0),
    "flies along its nose, 30 degrees up": (THIRTY_UP, (10.0, 0.0, 0.0), 5.0),
}
FLOATS = st.floats(width=64)
LENGTHS = st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e200, 1e308, NAN, INF, -INF, HALF])
ANY = FLOATS | LENGTHS


def quaternion(w, x, y, z):
    return Quaternion(w=w, x=x, y=y, z=z)


def by_name(parts):
    """The fields that the parts fill."""
    return {
        name: value
        for part, values in parts.items()
        for name, value in zip(readings.PARTS[part], values, strict=False)
    }


def odometry(orientation=LEVEL_EAST, z=0.0, velocity=(0.0, 0.0, 0.0)):
    message = Odometry()
    message.pose.pose.position.z = z
    message.pose.pose.orientation = quaternion(*orientation)
    x, y, upward = velocity
    message.twist.twist.linear = Vector3(x=x, y=y, z=upward)
    return message


def imu(orientation=LEVEL_EAST, acceleration=(0.0, 0.0, 9.81)):
    x, y, z = acceleration
    return Imu(orientation=quaternion(*orientation), linear_acceleration=Vector3(x=x, y=y, z=z))


@pytest.mark.parametrize("case", ATTITUDES)
def test_attitude_in_the_axes_of_aircraft(case):
    given_quaternion, *degrees = ATTITUDES[case]
    roll, pitch, yaw, tilt = map(math.degrees, readings.attitude(quaternion(*given_quaternion)))
    assert (pitch, tilt) == pytest.approx((degrees[1], degrees[3]), abs=1e-4)
    # 180 and -180 degrees are the same angle.
    for found, wanted in ((roll, degrees[0]), (yaw, degrees[2])):
        assert math.remainder(found - wanted, 360.0) == pytest.approx(0.0, abs=1e-4)
        assert -180.0 <= found <= 180.0


def test_the_bodys_velocity_is_turned_into_the_world():
    for case, (orientation, velocity, upward) in VERTICAL_SPEEDS.items():
        known = by_name(readings.odometry(odometry(orientation, velocity=velocity)))
        assert known["vertical_speed"] == pytest.approx(upward, abs=1e-12), case


def test_without_a_unit_quaternion_height_is_all_that_odometry_knows():
    for w in (0.0, 0.5, 2.0, NAN):
        parts = readings.odometry(odometry((w, 0.0, 0.0, 0.0), 12.5, (1.0, 2.0, 3.0)))
        assert parts == {"height": (12.5,), "vertical_speed": None, "attitude": None}, w


def test_what_is_not_finite_is_not_known_and_the_rest_is():
    parts = readings.odometry(odometry(z=NAN, velocity=(0.0, INF, 1.0)))
    assert parts["height"] is None
    assert parts["vertical_speed"] is None
    assert parts["attitude"] is not None


def test_imu_tells_attitude_and_the_length_of_the_specific_force():
    parts = by_name(readings.imu(imu(THIRTY_UP, (2.0, 3.0, 6.0))))
    assert parts["acceleration"] == 7.0
    assert parts["pitch"] == pytest.approx(math.radians(30))
    assert by_name(readings.imu(imu(acceleration=(0.0, 0.0, 0.0))))["acceleration"] == 0.0
    # Imu says with a covariance of minus 1 what it does not estimate.
    message = imu()
    message.orientation_covariance[0] = -1.0
    assert readings.imu(message) == {"attitude": None, "acceleration": (9.81,)}
    message = imu()
    message.linear_acceleration_covariance[0] = -1.0
    assert readings.imu(message)["acceleration"] is None
    assert readings.imu(message)["attitude"] is not None


def test_mavros_state():
    for armed, connected, parts in (
        (True, True, {"armed": (Armed.ARMED,), "autopilot": (LinkState.OK, 4)}),
        (False, True, {"armed": (Armed.DISARMED,), "autopilot": (LinkState.OK, 4)}),
        (False, False, {"armed": None, "autopilot": (LinkState.LOST, 0)}),
    ):
        message = SimpleNamespace(armed=armed, connected=connected, system_status=4)
        assert readings.mavros_state(message) == parts


def test_mavros_extended_state():
    for number, landed_state in (*((int(s), s) for s in LandedState), (5, None), (255, None)):
        told = readings.mavros_extended_state(SimpleNamespace(landed_state=number))
        known = landed_state not in (None, LandedState.UNKNOWN)
        assert told == {"landed_state": (landed_state,) if known else None}, number


def test_battery():
    for voltage, percentage, wanted in (
        (22.2, 0.5, (22.2, 0.5)),
        (22.2, -0.01, (22.2, NAN)),
        (65.535, 0.5, (NAN, 0.5)),
        (0.0, 1.0, (NAN, 1.0)),
        (NAN, NAN, None),
        (INF, 1.5, None),
    ):
        told = readings.battery(BatteryState(voltage=voltage, percentage=percentage))["battery"]
        assert told == (None if wanted is None else pytest.approx(wanted, nan_ok=True))


def test_position():
    for status, latitude, longitude, known in (
        (0, 47.4, 8.5, True),
        (2, -33.9, 151.2, True),
        (-1, 47.4, 8.5, False),
        (0, 0.0, 0.0, False),
        (0, NAN, 8.5, False),
        (0, 91.0, 8.5, False),
        (0, 47.4, -181.0, False),
    ):
        message = NavSatFix(latitude=latitude, longitude=longitude, altitude=512.5)
        message.status.status = status
        expected = {"position": (latitude, longitude) if known else None}
        fixed = status >= 0 and (latitude, longitude) != (0.0, 0.0) and latitude == latitude
        expected["altitude"] = (512.5,) if fixed else None
        assert readings.position(message) == expected, (status, latitude, longitude)


def test_relative_altitude_is_a_height():
    assert readings.relative_altitude(SimpleNamespace(data=-2.5)) == {"height": (-2.5,)}
    assert readings.relative_altitude(SimpleNamespace(data=NAN)) == {"height": None}


def test_the_parts_are_all_fields_with_an_age():
    names = {field.name for field in dataclasses.fields(VehicleState)}
    assert {f"{part}_age" for part in readings.PARTS} == {n for n in names if n.endswith("_age")}
    assert {name for fields in readings.PARTS.values() for name in fields} <= names


def test_of_a_vehicle_state_only_what_was_received_is_known():
    state = VehicleState(height=3.0, armed=Armed.ARMED, armed_age=0.1, tilt=0.2, attitude_age=0.0)
    known = {part for part, values in readings.vehicle_state(state).items() if values}
    assert known == {"armed", "attitude", "autopilot"}


def test_frames_that_are_not_what_is_read_are_named():
    for frame, child, told in (
        ("map", "base_link", ""),
        ("odom", "", ""),
        ("", "", ""),
        ("odom_ned", "", "frame 'odom_ned' has its axes pointing down"),
        ("", "body_frd", "frame 'body_frd' has its axes pointing down"),
        ("map", "odom", "child_frame_id 'odom' is no frame of the body"),
        ("base_link", "base_link", "child_frame_id 'base_link' is no frame of the body"),
    ):
        why = readings.wrong_frame(frame, child)
        assert why.startswith(told), (frame, child)
        assert bool(why) is bool(told)


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi / 2, math.pi / 2), FLOATS)
def test_tilt_is_the_angle_that_roll_and_pitch_make(roll, pitch, heading):
    heading = heading if math.isfinite(heading) else 0.0
    # Turned about z, then y (nose down is positive in these axes), then x.
    (cz, sz), (cy, sy), (cx, sx) = (
        (math.cos(a / 2), math.sin(a / 2)) for a in (heading, -pitch, roll)
    )
    found = readings.attitude(
        quaternion(
            cx * cy * cz + sx * sy * sz,
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
        )
    )
    upright = max(-1.0, min(1.0, math.cos(roll) * math.cos(pitch)))
    assert math.cos(found[3]) == pytest.approx(upright, abs=1e-9)
    # Near straight up and down, rounding moves the arc sine by the root of what it moves the sine.
    assert math.cos(found[0]) * math.cos(found[1]) == pytest.approx(upright, abs=1e-6)
    assert found[1] == pytest.approx(pitch, abs=1e-6)


@given(st.tuples(ANY, ANY, ANY, ANY), ANY, st.tuples(ANY, ANY, ANY), st.sampled_from([-1.0, 0.0]))
def test_no_content_raises_and_what_is_known_is_finite(orientation, z, vector, covariance):
    message = imu(orientation, vector)
    message.orientation_covariance[0] = message.linear_acceleration_covariance[0] = covariance
    told = {**readings.odometry(odometry(orientation, z, vector)), **readings.imu(message)}
    for values in told.values():
        assert values is None or all(map(math.isfinite, values))


@given(ANY, ANY, st.integers(-128, 127), st.integers(0, 255), st.booleans())
def test_no_content_of_mavros_raises(one, other, status, number, connected):
    readings.battery(SimpleNamespace(voltage=one, percentage=other))
    readings.relative_altitude(SimpleNamespace(data=one))
    fix = {"latitude": one, "longitude": other, "altitude": other}
    readings.position(SimpleNamespace(**fix, status=SimpleNamespace(status=status)))
    readings.mavros_extended_state(SimpleNamespace(landed_state=number))
    readings.mavros_state(SimpleNamespace(connected=connected, armed=True, system_status=number))
