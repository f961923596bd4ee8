"""Altitude, pressure, several accelerometers, and what the vehicle is commanded.

The golden frames are packed here from the layouts in MAVLink's common.xml, not by the dialect.
"""

import math
import struct

import pytest
from autopilot_bench import Told, attitude, imu, position
from hypothesis import given
from hypothesis import strategies as st
from link_bench import heartbeat

from chute_ros.protocol.mavlink.dialect import dialect as d

NAN = math.nan
G = 9.80665


def golden(number, crc_extra, layout, *values):
    """A MAVLink 2 frame of 1/1, its zero bytes at the end cut off."""
    payload = struct.pack("<" + layout, *values).rstrip(b"\0") or b"\0"
    body = struct.pack("<BBBBBB3s", len(payload), 0, 0, 0, 1, 1, number.to_bytes(3, "little"))
    crc = 0xFFFF
    for byte in body + payload + bytes([crc_extra]):
        mixed = (byte ^ crc) & 0xFF
        mixed = (mixed ^ mixed << 4) & 0xFF
        crc = (crc >> 8 ^ mixed << 8 ^ mixed << 3 ^ mixed >> 4) & 0xFFFF
    return b"\xfd" + body + payload + struct.pack("<H", crc)


def vehicle(autopilot=d.MAV_AUTOPILOT_ARDUPILOTMEGA, kind=d.MAV_TYPE_QUADROTOR, mode=0):
    return d.MAVLink_heartbeat_message(kind, autopilot, 0, mode, d.MAV_STATE_ACTIVE, 3)


COPTER, PX4 = vehicle(), vehicle(d.MAV_AUTOPILOT_PX4)


def plane(mode):
    return vehicle(kind=d.MAV_TYPE_FIXED_WING, mode=mode)


def vtol(state):
    return d.MAVLink_extended_sys_state_message(state, d.MAV_LANDED_STATE_IN_AIR)


ON_WING, ON_LIFT_MOTORS = vtol(d.MAV_VTOL_STATE_FW), vtol(d.MAV_VTOL_STATE_MC)


def at_altitude(alt, relative=0.0, lat=473_000_000):
    return d.MAVLink_global_position_int_message(
        1000, lat, 85_000_000, int(alt * 1000), int(relative * 1000), 0, 0, 0, 0
    )


def altitude(amsl, relative=NAN):
    return d.MAVLink_altitude_message(0, NAN, amsl, NAN, relative, NAN, NAN)


def pressure(hpa, kind=""):
    return getattr(d, f"MAVLink_scaled_pressure{kind}_message")(1000, hpa, 0.0, 2000)


def imu2(z):
    return d.MAVLink_scaled_imu2_message(1000, 0, 0, z, 0, 0, 0, 0, 0, 0)


def imu3(z):
    return d.MAVLink_scaled_imu3_message(1000, 0, 0, z, 0, 0, 0, 0, 0, 0)


def imu1(z):
    return imu(0, 0, z)


def told(*messages):
    """What is known right after these."""
    return Told().hear(*messages).at()


def highres(x=0.0, y=0.0, z=-G, hpa=0.0, updated=7):
    return d.MAVLink_highres_imu_message(0, x, y, z, *[0.0] * 6, hpa, 0.0, 0.0, 0.0, updated)


def turned(roll=0.0, pitch=0.0, yaw=0.0):
    """The quaternion w, x, y, z of these angles."""
    (cr, sr), (cp, sp), (cy, sy) = [(math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw)]
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]


def to_be(q, thrust=0.5, mask=0, boot_ms=1000):
    return d.MAVLink_attitude_target_message(boot_ms, mask, q, 0.0, 0.0, 0.0, thrust)


def to_fly(vz=0.0, z=0.0, mask=0, frame=d.MAV_FRAME_LOCAL_NED):
    rest = [0.0] * 5
    return d.MAVLink_position_target_local_ned_message(
        1000, frame, mask, 0.0, 0.0, z, 0.0, 0.0, vz, *rest
    )


def to_be_at(alt, mask=0b111111000, frame=d.MAV_FRAME_GLOBAL, vz=0.0):
    return d.MAVLink_position_target_global_int_message(
        1000, frame, mask, 0, 0, alt, 0.0, 0.0, vz, *[0.0] * 5
    )


def local(z, vz=0.0):
    return d.MAVLink_local_position_ned_message(1000, 0.0, 0.0, z, 0.0, 0.0, vz)


def off_by(alt_error):
    return d.MAVLink_nav_controller_output_message(0.0, 0.0, 0, 0, 0, alt_error, 0.0, 0.0)


#: Message -> what comes, its frame among other messages, and what is then known.
GOLDEN = {
    "SCALED_PRESSURE": (
        [golden(29, 115, "Iffhh", 1000, 955.5, 0.0, 2000, 0)],
        {"pressure": 95_550.0},
    ),
    "HIGHRES_IMU": (
        [golden(105, 93, "Q13fHB", 1, 0, 0, -G, *[0] * 6, 900.25, 0, 0, 0, 1 << 9, 0)],
        {"pressure": 90_025.0, "acceleration": G},
    ),
    "SCALED_IMU 2 and 3": (
        [
            golden(116, 76, "I10h", 1000, 0, 0, -1000, *[0] * 7),
            golden(129, 46, "I10h", 1000, 0, 0, -500, *[0] * 7),
        ],
        {"acceleration": 0.75 * G, "acceleration_spread": 0.5 * G},
    ),
    "ATTITUDE_TARGET": (
        [golden(83, 22, "I8fB", 1000, *turned(pitch=0.5), 0, 0, 0, 0.6, 0), attitude()],
        {"attitude_error": 0.5},
    ),
    "POSITION_TARGET_LOCAL_NED": (
        [PX4, local(-48.0), golden(85, 140, "I11fHB", 1000, 0, 0, -50, 0, 0, 1.5, *[0] * 6, 1)],
        {"target_vertical_speed": -1.5, "below_target": 2.0},
    ),
    "POSITION_TARGET_GLOBAL_INT": (
        [
            *(COPTER, at_altitude(500.0)),
            golden(87, 150, "I2i9fHB", 1000, 0, 0, 520.0, *[0] * 8, 0b111111000, 0),
        ],
        {"below_target": 20.0, "target_vertical_speed": NAN},
    ),
    "NAV_CONTROLLER_OUTPUT": (
        [plane(11), vtol(0), golden(62, 183, "5f2hH", 0, 0, 7.5, 0, 0, 0, 0, 0)],
        {"below_target": 7.5},
    ),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_golden(name):
    came, known = GOLDEN[name]
    heard = Told()
    for one in came:
        (heard.hear_bytes if isinstance(one, bytes) else heard.hear)(one)
    state = heard.at()
    assert {one: getattr(state, one) for one in known} == pytest.approx(known, nan_ok=True)


def test_altitude_is_that_of_global_position_int_and_no_home_moves_it():
    heard = Told().hear(at_altitude(488.0, relative=20.0))
    heard.hear(at_altitude(487.0, relative=0.0), now=1.0)
    assert (heard.at(1.5).altitude, heard.at(1.5).altitude_age) == (487.0, 0.5)
    state = told(position(relative=3000))
    assert math.isnan(state.altitude), "not known before the position is"
    assert state.height == 3.0


def test_altitude_of_another_message_counts_only_where_global_position_int_is_silent():
    heard = Told()
    for now, message, known in (
        (0.0, altitude(510.0), 510.0),
        (1.0, at_altitude(488.0), 488.0),
        (2.0, altitude(510.0), 488.0),
        (2.1, altitude(509.0), 509.0),
        (2.2, altitude(NAN), 509.0),
    ):
        assert heard.hear(message, now=now).at(now).altitude == known, now


def test_what_is_no_pressure_or_not_new_is_not_taken_over():
    for hpa in (0.0, -5.0, NAN, math.inf, 1300.0):
        assert math.isnan(told(pressure(hpa)).pressure), hpa
    assert math.isnan(told(highres(hpa=900.0, updated=7)).pressure)


def test_the_barometer_that_was_heard_first_counts_until_it_is_silent():
    heard = Told()
    for tenth in range(20):
        heard.hear(pressure(955.0), now=tenth / 10)
        heard.hear(pressure(957.0, "2"), highres(hpa=950.0, updated=1 << 9), now=tenth / 10)
        assert heard.at(tenth / 10).pressure == pytest.approx(95_500.0)
    heard.hear(pressure(957.0, "3"), now=2.9)
    assert heard.at(2.9).pressure == pytest.approx(95_500.0)
    heard.hear(pressure(957.0, "3"), now=2.95)
    assert heard.at(2.95).pressure == pytest.approx(95_700.0)
    # And then that one, though the first is back.
    heard.hear(pressure(955.0), now=3.0)
    assert heard.at(3.0).pressure == pytest.approx(95_700.0)


#: Accelerometers -> the acceleration, and how far they are apart, G.
ACCELEROMETERS = {
    "one": ([imu1(-1000)], 1.0, NAN),
    "the mean of two": ([imu1(-1000), imu2(-800)], 0.9, 0.2),
    "the middle one of three": ([imu1(-1000), imu2(-800), imu3(-2000)], 1.0, 1.2),
    "the one in use is no further one": ([highres(z=-5.0), imu1(-1000)], 1.0, NAN),
    "a compass is none": ([imu1(-1000), imu2(0), imu3(0)], 1.0, NAN),
    "one that worked reads 0": ([imu1(-1000), imu2(-1000), imu2(0)], 0.5, 1.0),
}


@pytest.mark.parametrize("story", ACCELEROMETERS)
def test_accelerometers(story):
    messages, mean, spread = ACCELEROMETERS[story]
    state = told(*messages)
    assert state.acceleration == pytest.approx(mean * G)
    assert state.acceleration_spread == pytest.approx(spread * G, nan_ok=True)


def test_an_accelerometer_that_falls_silent_is_not_set_against_the_others():
    heard = Told().hear(imu1(-1000), imu2(-200), now=1.0).hear(imu2(-200), now=1.31)
    assert heard.at(1.31).acceleration == pytest.approx(0.2 * G)
    assert math.isnan(heard.at(1.31).acceleration_spread)
    heard = Told().hear(highres(z=-5.0), imu1(-1000)).hear(highres(z=-5.0), now=1.0)
    assert heard.at(1.0).acceleration == 5.0


ANGLES = st.floats(-1.5, 1.5)
HEADINGS = st.floats(-3.1, 3.1)


def nav_pitch(degrees, roll=0.0):
    return d.MAVLink_nav_controller_output_message(roll, degrees, 0, 0, 0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("state", [ON_WING, vtol(d.MAV_VTOL_STATE_UNDEFINED)])
def test_on_the_wing_the_controllers_output_tells_the_commanded_attitude(state):
    """ArduPlane in FBWA, its pilot's stick forward: nav_pitch -30 degrees, and it follows."""
    banked = attitude(1000, math.radians(10.0), math.radians(-30.0), 2.0)
    heard = Told().hear(plane(5), state, banked, nav_pitch(-30.0, roll=10.0), banked)
    assert heard.at().attitude_error == pytest.approx(0.0, abs=2e-3)
    heard.hear(attitude(1100, math.radians(10.0), math.radians(10.0), 2.0), now=0.3)
    assert math.degrees(heard.at(0.3).attitude_error) == pytest.approx(40.0, abs=1.0)
    on_motors = told(plane(17), ON_LIFT_MOTORS, attitude(), nav_pitch(-30.0), attitude())
    assert math.isnan(on_motors.attitude_error), "on its lift motors it does not"


@given(ANGLES, ANGLES, HEADINGS)
def test_a_vehicle_that_obeys_has_no_error_of_attitude(roll, pitch, yaw):
    heard = Told().hear(to_be(turned(roll, pitch, yaw)), attitude(1000, roll, pitch, yaw))
    assert heard.at().attitude_error == pytest.approx(0.0, abs=2e-3)


@given(st.floats(0.0, 1.5), HEADINGS, HEADINGS)
def test_the_error_is_the_angle_between_the_vertical_axes(angle, yaw, other):
    level, banked = turned(yaw=yaw), attitude(1000, angle, 0.0, other)
    assert Told().hear(to_be(level), banked).at().attitude_error == pytest.approx(angle, abs=2e-3)


@pytest.mark.parametrize("rate", [10, 50])
def test_a_flip_whose_target_is_told_ten_times_a_second_is_followed(rate):
    """600 degrees a second, flown as commanded; attitudes come between the targets."""
    heard = Told()
    for step in range(50):
        now = step / 50
        angle = math.remainder(math.radians(600.0) * now, 2.0 * math.pi)
        if step % (50 // rate) == 0:
            heard.hear(attitude(roll=angle), now=now)
        if step % 5 == 0:
            heard.hear(to_be(turned(roll=angle)), now=now)
        assert not heard.at(now).attitude_error > math.radians(15.0)


def test_one_that_does_not_follow_shows_it_soon():
    heard, late = Told().hear(to_be(turned())), []
    for step in range(50):
        now = step / 50
        heard.hear(attitude(roll=math.radians(150.0) * now), now=now)
        heard.hear(to_be(turned()), now=now)
        if heard.at(now).attitude_error > math.radians(30.0):
            late.append(now - 0.2)
    assert late[0] == pytest.approx(0.15, abs=0.05)


def test_each_attitude_is_set_against_the_newest_target_that_is_fresh():
    heard = Told().hear(to_be(turned(roll=0.2)), attitude())
    heard.hear(attitude(roll=1.2), now=0.5)
    assert heard.at(0.5).attitude_error == pytest.approx(1.0)
    heard.hear(attitude(roll=1.4), now=0.6)
    assert heard.at(0.6).attitude_error == pytest.approx(1.0)
    assert heard.at(0.6).attitude_error_age == pytest.approx(0.1)


def test_upside_down_where_level_was_commanded():
    upside_down = d.MAVLink_attitude_quaternion_message(1000, 0, 1, 0, 0, 0.0, 0.0, 0.0)
    assert told(to_be([1, 0, 0, 0]), upside_down).attitude_error == pytest.approx(math.pi)


#: PX4 repeats the last one while rates are flown.
NO_TARGETS = {
    "attitude ignored": to_be([1, 0, 0, 0], mask=128),
    "no length": to_be([0, 0, 0, 0]),
    "too long": to_be([2, 0, 0, 0]),
    "not finite": to_be([NAN, 0, 0, 0]),
    "set long ago": to_be([1, 0, 0, 0], boot_ms=400),
}


@pytest.mark.parametrize("story", NO_TARGETS)
def test_what_is_no_attitude_target(story):
    state = told(attitude(1000), NO_TARGETS[story], attitude(1000, roll=1.0))
    assert math.isnan(state.attitude_error)


def test_a_target_that_is_repeated_is_no_restart():
    repeated = [to_be([1, 0, 0, 0], boot_ms=2000)] * 5
    assert told(vehicle(), attitude(90_000), *repeated, attitude(90_100)).reboot_count == 0


def test_commanded_vertical_speed_ages_and_is_not_known_when_it_is_old():
    heard = Told().hear(PX4, to_fly(vz=-2.0))
    assert heard.at(1.0).target_vertical_speed == 2.0
    assert heard.at(1.0).target_age == 1.0
    assert math.isnan(heard.at(1.1).target_vertical_speed)
    assert heard.at(1.1).target_age == pytest.approx(1.1)


def test_vertical_speed_that_is_not_commanded_and_one_that_another_target_leaves_alone():
    for message in (to_fly(vz=1.0, mask=32), to_fly(vz=NAN), to_fly(vz=1.0, frame=8)):
        assert math.isnan(told(PX4, message).target_vertical_speed), message
    assert told(COPTER, to_fly(vz=-2.0), to_be_at(520.0)).target_vertical_speed == 2.0
    assert told(COPTER, to_be_at(520.0, mask=0, vz=1.5)).target_vertical_speed == -1.5


def test_a_target_that_is_taken_back_is_not_known_at_once():
    heard = Told().hear(PX4, local(-10.0), to_fly(vz=-2.0, z=-20.0))
    assert heard.at().below_target == 10.0
    heard.hear(to_fly(mask=32 | 4), now=0.1)
    assert math.isnan(heard.at(0.1).target_vertical_speed)
    assert math.isnan(heard.at(0.1).below_target)
    assert heard.at(0.1).target_age == pytest.approx(0.1)


def test_height_below_a_target_that_is_above_the_sea_or_above_home():
    heard = Told().hear(COPTER, at_altitude(500.0, relative=30.0), to_be_at(490.0))
    assert heard.at().below_target == -10.0
    heard.hear(to_be_at(45.0, frame=d.MAV_FRAME_GLOBAL_RELATIVE_ALT))
    assert heard.at().below_target == 15.0
    heard.hear(to_be_at(45.0, frame=d.MAV_FRAME_GLOBAL_TERRAIN_ALT))
    assert math.isnan(heard.at().below_target)
    old = Told().hear(COPTER, at_altitude(500.0)).hear(to_be_at(520.0), now=1.1)
    assert math.isnan(old.at(1.1).below_target), "not against a height that is old"
    for who in (PX4, plane(10)):
        state = told(who, at_altitude(500.0), to_be_at(520.0))
        assert math.isnan(state.below_target), "a way point may be of an earlier mission"


def test_height_error_of_an_aeroplane_in_modes_that_hold_height():
    for mode in (6, 7, 10, 11, 12, 13, 15):
        for state in (d.MAV_VTOL_STATE_UNDEFINED, d.MAV_VTOL_STATE_FW):
            assert told(plane(mode), vtol(state), off_by(12.0)).below_target == 12.0, mode
    for mode in (19, 20):
        assert told(plane(mode), ON_LIFT_MOTORS, off_by(3.0)).below_target == 3.0, mode


def followed(target, height, until=4.0):
    """What is known of an aeroplane in AUTO at the end, which tells 5 times a second its height at
    t and how far it is below its target."""
    heard = Told().hear(plane(10), vtol(0))
    for k in range(round(until * 5.0) + 1):
        t = k / 5.0
        heard.hear(plane(10), vtol(0), at_altitude(height(t)), now=t)
        heard.hear(off_by(target(t) - height(t)), now=t + 0.05)
    return heard.at(until + 0.05)


def test_a_height_target_that_comes_down_is_a_commanded_sink():
    """Terrain, a glide slope: it is 3 m below it, and sinks as it does."""
    slope = followed(lambda t: 503.0 - 6.0 * t, lambda t: 500.0 - 6.0 * t)
    assert slope.target_vertical_speed == pytest.approx(-6.0, abs=0.1)
    assert slope.below_target == pytest.approx(3.0)


@pytest.mark.parametrize(
    "target",
    [lambda t: 503.0, lambda t: 540.0 if t < 3.0 else 503.0, lambda t: 503.0 + 2.0 * t],
    ids=["stands", "is that of the next way point", "climbs"],
)
def test_one_that_sinks_below_a_target_that_does_not_was_not_commanded_to(target):
    falls = followed(target, lambda t: 500.0 - 8.0 * t)
    assert math.isnan(falls.target_vertical_speed)
    assert falls.below_target > 30.0


def test_targets_that_count_from_elsewhere_do_not_come_down_from_one_another():
    """ArduCopter tells one above its origin, and the same above the sea."""
    heard = Told().hear(COPTER)
    for k in range(1, 30):
        target = to_fly(z=-70.0, mask=32) if k % 2 else to_be_at(520.0)
        heard.hear(local(-50.0 + k), at_altitude(500.0 - k), target, now=0.1 * k)
        assert math.isnan(heard.at(0.1 * k).target_vertical_speed), k
    assert heard.at(2.9).below_target == pytest.approx(49.0)


def test_in_modes_whose_message_tells_no_command_nothing_of_it_is_known():
    """STABILIZE and TRAINING tell level whatever the sticks do, ACRO the own attitude."""
    for mode, commanded in [(2, False), (3, False), (4, False), (5, True), (12, True)]:
        level = Told().hear(plane(mode), ON_WING, attitude(), nav_pitch(0.0), attitude())
        assert math.isnan(level.at().attitude_error) is not commanded, mode


def test_a_tail_sitter_of_px4_tells_its_attitude_in_a_hover_alone():
    """On its wing that of the hover goes on, 90 degrees from upright: it is not known there."""
    px4 = vehicle(d.MAV_AUTOPILOT_PX4, d.MAV_TYPE_VTOL_QUADROTOR)
    upright, lies = attitude(1000, pitch=-0.1), attitude(1100, pitch=-1.5)
    heard = Told().hear(px4, ON_LIFT_MOTORS, upright)
    assert heard.at().tilt == pytest.approx(0.1)
    for state in (vtol(d.MAV_VTOL_STATE_TRANSITION_TO_FW), ON_WING):
        heard.hear(state, lies, now=0.6)
        assert heard.at(0.6).tilt == pytest.approx(0.1), "as it was"
        assert heard.at(0.6).attitude_age == pytest.approx(0.6)
    ardupilot = vehicle(d.MAV_AUTOPILOT_ARDUPILOTMEGA, d.MAV_TYPE_VTOL_QUADROTOR)
    assert told(ardupilot, ON_WING, lies).tilt == pytest.approx(1.5), "it turns its view itself"


#: Who, and on what it flies.
NO_HEIGHT_ERROR = {
    "of a mode that may be old": [
        (plane(mode), ON_WING) for mode in (0, 2, 4, 5, 8, 17, 18, 19, 21, 23, 24)
    ],
    "of a mission on lift motors or between": [
        (plane(10), vtol(state))
        for state in (d.MAV_VTOL_STATE_TRANSITION_TO_FW, d.MAV_VTOL_STATE_TRANSITION_TO_MC, 3)
    ],
    "of one that does not say on what it flies": [(plane(10),)],
    "of others, without a certain sign or mode": [
        (who, ON_WING) for who in (COPTER, PX4, vehicle(d.MAV_AUTOPILOT_PX4, 1))
    ],
}


@pytest.mark.parametrize("story", NO_HEIGHT_ERROR)
def test_height_error_that_says_nothing(story):
    for before in NO_HEIGHT_ERROR[story]:
        assert math.isnan(told(*before, off_by(12.0)).below_target), before


def test_full_thrust_means_that_it_is_commanded_not_to_sink():
    heard = Told().hear(COPTER, to_be(turned(roll=0.3), thrust=0.97))
    assert heard.at(1.0).target_vertical_speed == 0.0
    assert math.isnan(heard.at(1.1).target_vertical_speed)


LEVEL = [1, 0, 0, 0]
PROPELLER = vehicle(d.MAV_AUTOPILOT_PX4, d.MAV_TYPE_FIXED_WING)
NO_THRUST = {
    "more could come": [COPTER, to_be(LEVEL, thrust=0.9)],
    "tilted": [COPTER, to_be(turned(roll=0.6), thrust=1.0)],
    "thrust ignored": [COPTER, to_be(LEVEL, thrust=1.0, mask=64)],
    "of a propeller in front": [PROPELLER, to_be(LEVEL, thrust=1.0)],
    "on the wing": [plane(12), ON_WING, to_be(LEVEL, thrust=1.0)],
    "lowered": [COPTER, to_be(LEVEL, thrust=1.0), to_be(LEVEL, thrust=0.5)],
}


@pytest.mark.parametrize("story", NO_THRUST)
def test_thrust_that_says_nothing(story):
    assert math.isnan(told(*NO_THRUST[story]).target_vertical_speed)


def test_thrust_counts_on_lift_motors_and_where_no_vertical_speed_is_commanded():
    full = to_be(LEVEL, thrust=1.0)
    assert told(plane(19), ON_LIFT_MOTORS, full).target_vertical_speed == 0.0
    assert told(COPTER, to_fly(vz=3.0), full).target_vertical_speed == -3.0


def test_nothing_of_it_is_known_at_first():
    state = Told().hear(heartbeat(d.MAV_TYPE_QUADROTOR, d.MAV_AUTOPILOT_PX4)).at()
    names = (
        "altitude pressure acceleration_spread attitude_error target_vertical_speed "
        "below_target target_age"
    )
    assert all(math.isnan(getattr(state, name)) for name in names.split())
