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


def golden(number: int, crc_extra: int, layout: str, *values: float) -> bytes:
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


def imu2(x, y, z):
    return d.MAVLink_scaled_imu2_message(1000, x, y, z, 0, 0, 0, 0, 0, 0)


def imu3(x, y, z):
    return d.MAVLink_scaled_imu3_message(1000, x, y, z, 0, 0, 0, 0, 0, 0)


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


# -- golden frames --------------------------------------------------------------------------------


def test_golden_scaled_pressure():
    told = Told().hear_bytes(golden(29, 115, "Iffhh", 1000, 955.5, 0.0, 2000, 0))
    assert told.at().pressure == pytest.approx(95_550.0)


def test_golden_highres_imu():
    raw = golden(105, 93, "Q13fHB", 1, 0, 0, -G, 0, 0, 0, 0, 0, 0, 900.25, 0, 0, 0, 1 << 9, 0)
    state = Told().hear_bytes(raw).at()
    assert (state.pressure, state.acceleration) == pytest.approx((90_025.0, G))


def test_golden_scaled_imu_2_and_3():
    two = golden(116, 76, "I10h", 1000, 0, 0, -1000, 0, 0, 0, 0, 0, 0, 0)
    three = golden(129, 46, "I10h", 1000, 0, 0, -500, 0, 0, 0, 0, 0, 0, 0)
    state = Told().hear_bytes(two, three).at()
    assert (state.acceleration, state.acceleration_spread) == pytest.approx((0.75 * G, 0.5 * G))


def test_golden_attitude_target():
    raw = golden(83, 22, "I8fB", 1000, *turned(pitch=0.5), 0, 0, 0, 0.6, 0)
    told = Told().hear_bytes(raw).hear(attitude())
    assert told.at().attitude_error == pytest.approx(0.5)


def test_golden_position_target_local_ned():
    values = (1000, 0, 0, -50.0, 0, 0, 1.5, 0, 0, 0, 0, 0, 0, 1)
    told = Told().hear(PX4, local(-48.0)).hear_bytes(golden(85, 140, "I11fHB", *values))
    state = told.at()
    assert (state.target_vertical_speed, state.below_target) == pytest.approx((-1.5, 2.0))


def test_golden_position_target_global_int():
    values = (1000, 0, 0, 520.0, 0, 0, 0, 0, 0, 0, 0, 0, 0b111111000, 0)
    told = Told().hear(COPTER, at_altitude(500.0)).hear_bytes(golden(87, 150, "I2i9fHB", *values))
    assert told.at().below_target == pytest.approx(20.0)
    assert math.isnan(told.at().target_vertical_speed)


def test_golden_nav_controller_output():
    raw = golden(62, 183, "5f2hH", 0, 0, 7.5, 0, 0, 0, 0, 0)
    assert Told().hear(plane(11), vtol(0)).hear_bytes(raw).at().below_target == 7.5


# -- altitude -------------------------------------------------------------------------------------


def test_altitude_is_that_of_global_position_int_and_no_home_moves_it():
    told = Told().hear(at_altitude(488.0, relative=20.0))
    told.hear(at_altitude(487.0, relative=0.0), now=1.0)
    assert (told.at(1.5).altitude, told.at(1.5).altitude_age) == (487.0, 0.5)


def test_altitude_is_not_known_before_the_position_is():
    told = Told().hear(position(relative=3000))
    assert math.isnan(told.at().altitude)
    assert told.at().height == 3.0


def test_altitude_of_another_message_counts_only_where_global_position_int_is_silent():
    told = Told().hear(altitude(510.0), now=0.0)
    assert told.at().altitude == 510.0
    told.hear(at_altitude(488.0), now=1.0).hear(altitude(510.0), now=2.0)
    assert told.at(2.0).altitude == 488.0
    told.hear(altitude(509.0), now=2.1)
    assert told.at(2.1).altitude == 509.0
    told.hear(altitude(NAN), now=2.2)
    assert told.at(2.2).altitude == 509.0


# -- pressure -------------------------------------------------------------------------------------


@pytest.mark.parametrize("hpa", [0.0, -5.0, NAN, math.inf, 1300.0])
def test_what_is_no_pressure_is_not_taken_over(hpa):
    assert math.isnan(Told().hear(pressure(hpa)).at().pressure)


def test_highres_imu_repeats_a_pressure_that_is_not_new():
    told = Told().hear(highres(hpa=900.0, updated=7))
    assert math.isnan(told.at().pressure)


def test_the_barometer_that_was_heard_first_counts_until_it_is_silent():
    told = Told()
    for tenth in range(20):
        told.hear(pressure(955.0), now=tenth / 10)
        told.hear(pressure(957.0, "2"), highres(hpa=950.0, updated=1 << 9), now=tenth / 10)
        assert told.at(tenth / 10).pressure == pytest.approx(95_500.0)
    told.hear(pressure(957.0, "3"), now=2.9)
    assert told.at(2.9).pressure == pytest.approx(95_500.0)
    told.hear(pressure(957.0, "3"), now=2.95)
    assert told.at(2.95).pressure == pytest.approx(95_700.0)
    # And then that one, though the first is back.
    told.hear(pressure(955.0), now=3.0)
    assert told.at(3.0).pressure == pytest.approx(95_700.0)


# -- accelerometers -------------------------------------------------------------------------------


def test_one_accelerometer_has_no_spread():
    state = Told().hear(imu(0, 0, -1000)).at()
    assert state.acceleration == pytest.approx(G)
    assert math.isnan(state.acceleration_spread)


def test_of_two_the_mean_and_of_three_the_middle_one():
    told = Told().hear(imu(0, 0, -1000), imu2(0, 0, -800))
    assert told.at().acceleration == pytest.approx(0.9 * G)
    told.hear(imu3(0, 0, -2000))
    assert told.at().acceleration == pytest.approx(G)
    assert told.at().acceleration_spread == pytest.approx(1.2 * G)


def test_one_that_falls_silent_is_not_set_against_the_others():
    told = Told().hear(imu(0, 0, -1000), imu2(0, 0, -200), now=1.0)
    told.hear(imu2(0, 0, -200), now=1.31)
    assert told.at(1.31).acceleration == pytest.approx(0.2 * G)
    assert math.isnan(told.at(1.31).acceleration_spread)


def test_the_one_in_use_is_no_further_accelerometer():
    told = Told().hear(highres(z=-5.0), imu(0, 0, -1000))
    assert told.at().acceleration == pytest.approx(G)
    assert math.isnan(told.at().acceleration_spread)
    told.hear(highres(z=-5.0), now=1.0)
    assert told.at(1.0).acceleration == 5.0


def test_a_compass_without_an_accelerometer_is_none():
    told = Told().hear(imu(0, 0, -1000), imu2(0, 0, 0), imu3(0, 0, 0))
    assert told.at().acceleration == pytest.approx(G)
    assert math.isnan(told.at().acceleration_spread)


def test_one_that_worked_and_reads_0_then_counts():
    told = Told().hear(imu(0, 0, -1000), imu2(0, 0, -1000)).hear(imu2(0, 0, 0), now=0.1)
    assert told.at(0.1).acceleration_spread == pytest.approx(G)


# -- attitude target ------------------------------------------------------------------------------

ANGLES = st.floats(-1.5, 1.5)
HEADINGS = st.floats(-3.1, 3.1)


@pytest.mark.parametrize("state", [ON_WING, vtol(d.MAV_VTOL_STATE_UNDEFINED)])
def test_on_the_wing_the_controllers_output_tells_the_commanded_attitude(state):
    """ArduPlane in FBWA, its pilot's stick forward: nav_pitch -30 degrees, and it follows."""
    dives = d.MAVLink_nav_controller_output_message(10.0, -30.0, 0, 0, 0, 0.0, 0.0, 0.0)
    banked = attitude(1000, math.radians(10.0), math.radians(-30.0), 2.0)
    told = Told().hear(plane(5), state, banked, dives, banked)
    assert told.at().attitude_error == pytest.approx(0.0, abs=2e-3)
    told.hear(attitude(1100, math.radians(10.0), math.radians(10.0), 2.0), now=0.3)
    assert math.degrees(told.at(0.3).attitude_error) == pytest.approx(40.0, abs=1.0)


def test_on_its_lift_motors_it_does_not():
    dives = d.MAVLink_nav_controller_output_message(0.0, -30.0, 0, 0, 0, 0.0, 0.0, 0.0)
    told = Told().hear(plane(17), ON_LIFT_MOTORS, attitude(), dives, attitude())
    assert math.isnan(told.at().attitude_error)


@given(ANGLES, ANGLES, HEADINGS)
def test_a_vehicle_that_obeys_has_no_error_of_attitude(roll, pitch, yaw):
    told = Told().hear(to_be(turned(roll, pitch, yaw)), attitude(1000, roll, pitch, yaw))
    assert told.at().attitude_error == pytest.approx(0.0, abs=2e-3)


@given(st.floats(0.0, 1.5), HEADINGS, HEADINGS)
def test_the_error_is_the_angle_between_the_vertical_axes(angle, yaw, other):
    level, banked = turned(yaw=yaw), attitude(1000, angle, 0.0, other)
    assert Told().hear(to_be(level), banked).at().attitude_error == pytest.approx(angle, abs=2e-3)


def test_upside_down_where_level_was_commanded():
    told = Told().hear(to_be([1, 0, 0, 0]))
    told.hear(d.MAVLink_attitude_quaternion_message(1000, 0, 1, 0, 0, 0.0, 0.0, 0.0))
    assert told.at().attitude_error == pytest.approx(math.pi)


@pytest.mark.parametrize("rate", [10, 50])
def test_a_flip_whose_target_is_told_ten_times_a_second_is_followed(rate):
    """600 degrees a second, flown as commanded; attitudes come between the targets."""
    told = Told()
    for step in range(50):
        now = step / 50
        angle = math.remainder(math.radians(600.0) * now, 2.0 * math.pi)
        if step % (50 // rate) == 0:
            told.hear(attitude(roll=angle), now=now)
        if step % 5 == 0:
            told.hear(to_be(turned(roll=angle)), now=now)
        assert not told.at(now).attitude_error > math.radians(15.0)


def test_one_that_does_not_follow_shows_it_soon():
    told, late = Told().hear(to_be(turned())), []
    for step in range(50):
        now = step / 50
        told.hear(attitude(roll=math.radians(150.0) * now), now=now)
        told.hear(to_be(turned()), now=now)
        if told.at(now).attitude_error > math.radians(30.0):
            late.append(now - 0.2)
    assert late[0] == pytest.approx(0.15, abs=0.05)


def test_each_attitude_is_set_against_the_newest_target_that_is_fresh():
    told = Told().hear(to_be(turned(roll=0.2)), attitude())
    told.hear(attitude(roll=1.2), now=0.5)
    assert told.at(0.5).attitude_error == pytest.approx(1.0)
    told.hear(attitude(roll=1.4), now=0.6)
    assert told.at(0.6).attitude_error == pytest.approx(1.0)
    assert told.at(0.6).attitude_error_age == pytest.approx(0.1)


@pytest.mark.parametrize(
    "target",
    [
        pytest.param(to_be([1, 0, 0, 0], mask=128), id="attitude ignored"),
        pytest.param(to_be([0, 0, 0, 0]), id="no length"),
        pytest.param(to_be([2, 0, 0, 0]), id="too long"),
        pytest.param(to_be([NAN, 0, 0, 0]), id="not finite"),
        # PX4 repeats the last one while rates are flown.
        pytest.param(to_be([1, 0, 0, 0], boot_ms=400), id="set long ago"),
    ],
)
def test_what_is_no_attitude_target(target):
    told = Told().hear(attitude(1000)).hear(target, attitude(1000, roll=1.0))
    assert math.isnan(told.at().attitude_error)


def test_a_target_that_is_repeated_is_no_restart():
    told = Told().hear(vehicle(), attitude(90_000))
    told.hear(*[to_be([1, 0, 0, 0], boot_ms=2000)] * 5, attitude(90_100))
    assert told.at().reboot_count == 0


# -- vertical targets -----------------------------------------------------------------------------


def test_commanded_vertical_speed_ages_and_is_not_known_when_it_is_old():
    told = Told().hear(PX4, to_fly(vz=-2.0))
    assert told.at(1.0).target_vertical_speed == 2.0
    assert told.at(1.0).target_age == 1.0
    assert math.isnan(told.at(1.1).target_vertical_speed)
    assert told.at(1.1).target_age == pytest.approx(1.1)


@pytest.mark.parametrize(
    "message", [to_fly(vz=1.0, mask=32), to_fly(vz=NAN), to_fly(vz=1.0, frame=8)]
)
def test_vertical_speed_that_is_not_commanded(message):
    assert math.isnan(Told().hear(PX4, message).at().target_vertical_speed)


def test_a_target_that_is_taken_back_is_not_known_at_once():
    told = Told().hear(PX4, local(-10.0), to_fly(vz=-2.0, z=-20.0))
    assert told.at().below_target == 10.0
    told.hear(to_fly(mask=32 | 4), now=0.1)
    assert math.isnan(told.at(0.1).target_vertical_speed)
    assert math.isnan(told.at(0.1).below_target)
    assert told.at(0.1).target_age == pytest.approx(0.1)


def test_one_kind_of_target_does_not_take_back_another():
    told = Told().hear(COPTER, to_fly(vz=-2.0), to_be_at(520.0))
    assert told.at().target_vertical_speed == 2.0
    told = Told().hear(COPTER, to_be_at(520.0, mask=0, vz=1.5))
    assert told.at().target_vertical_speed == -1.5


def test_height_below_a_target_that_is_above_the_sea_or_above_home():
    told = Told().hear(COPTER, at_altitude(500.0, relative=30.0), to_be_at(490.0))
    assert told.at().below_target == -10.0
    told.hear(to_be_at(45.0, frame=d.MAV_FRAME_GLOBAL_RELATIVE_ALT))
    assert told.at().below_target == 15.0
    told.hear(to_be_at(45.0, frame=d.MAV_FRAME_GLOBAL_TERRAIN_ALT))
    assert math.isnan(told.at().below_target)


def test_height_that_is_old_is_not_set_against_a_target():
    told = Told().hear(COPTER, at_altitude(500.0)).hear(to_be_at(520.0), now=1.1)
    assert math.isnan(told.at(1.1).below_target)


@pytest.mark.parametrize("who", [PX4, plane(10)], ids=["PX4", "ArduPlane"])
def test_way_points_that_may_be_of_an_earlier_mission_are_not_targets(who):
    told = Told().hear(who, at_altitude(500.0), to_be_at(520.0))
    assert math.isnan(told.at().below_target)


@pytest.mark.parametrize("state", [d.MAV_VTOL_STATE_UNDEFINED, d.MAV_VTOL_STATE_FW])
@pytest.mark.parametrize("mode", [6, 7, 10, 11, 12, 13, 15])
def test_height_error_of_an_aeroplane_in_modes_that_hold_height(mode, state):
    told = Told().hear(plane(mode), vtol(state), off_by(12.0))
    assert told.at().below_target == 12.0


@pytest.mark.parametrize("mode", [0, 2, 4, 5, 8, 17, 18, 19, 21, 23, 24])
def test_height_error_that_may_be_old(mode):
    assert math.isnan(Told().hear(plane(mode), ON_WING, off_by(12.0)).at().below_target)


@pytest.mark.parametrize("mode", [19, 20])
def test_height_error_on_lift_motors_in_modes_that_hold_height(mode):
    told = Told().hear(plane(mode), ON_LIFT_MOTORS, off_by(3.0))
    assert told.at().below_target == 3.0


@pytest.mark.parametrize(
    "state", [d.MAV_VTOL_STATE_TRANSITION_TO_FW, d.MAV_VTOL_STATE_TRANSITION_TO_MC, 3]
)
def test_height_error_of_a_mission_on_lift_motors_or_between_may_be_old(state):
    told = Told().hear(plane(10), vtol(state), off_by(3.0))
    assert math.isnan(told.at().below_target)


def test_height_error_of_an_aeroplane_that_does_not_say_on_what_it_flies():
    assert math.isnan(Told().hear(plane(10), off_by(3.0)).at().below_target)


@pytest.mark.parametrize("who", [COPTER, PX4, vehicle(d.MAV_AUTOPILOT_PX4, 1)])
def test_height_error_of_others_has_no_certain_sign_or_mode(who):
    assert math.isnan(Told().hear(who, ON_WING, off_by(12.0)).at().below_target)


def test_full_thrust_means_that_it_is_commanded_not_to_sink():
    told = Told().hear(COPTER, to_be(turned(roll=0.3), thrust=0.97))
    assert told.at(1.0).target_vertical_speed == 0.0
    assert math.isnan(told.at(1.1).target_vertical_speed)


@pytest.mark.parametrize(
    ("who", "target"),
    [
        pytest.param(COPTER, to_be([1, 0, 0, 0], thrust=0.9), id="more could come"),
        pytest.param(COPTER, to_be(turned(roll=0.6), thrust=1.0), id="tilted"),
        pytest.param(COPTER, to_be([1, 0, 0, 0], thrust=1.0, mask=64), id="thrust ignored"),
        pytest.param(
            vehicle(d.MAV_AUTOPILOT_PX4, d.MAV_TYPE_FIXED_WING),
            to_be([1, 0, 0, 0], thrust=1.0),
            id="thrust of a propeller in front",
        ),
    ],
)
def test_thrust_that_says_nothing(who, target):
    assert math.isnan(Told().hear(who, target).at().target_vertical_speed)


def test_thrust_counts_only_where_no_vertical_speed_is_commanded():
    told = Told().hear(COPTER, to_fly(vz=3.0), to_be([1, 0, 0, 0], thrust=1.0))
    assert told.at().target_vertical_speed == -3.0


def test_thrust_that_is_lowered_says_nothing_any_more():
    told = Told().hear(COPTER, to_be([1, 0, 0, 0], thrust=1.0))
    told.hear(to_be([1, 0, 0, 0], thrust=0.5), now=0.1)
    assert math.isnan(told.at(0.1).target_vertical_speed)


def test_quadplane_that_hovers_on_full_thrust():
    told = Told().hear(plane(19), ON_LIFT_MOTORS, to_be([1, 0, 0, 0], thrust=1.0))
    assert told.at().target_vertical_speed == 0.0
    told = Told().hear(plane(12), ON_WING, to_be([1, 0, 0, 0], thrust=1.0))
    assert math.isnan(told.at().target_vertical_speed)


def test_nothing_of_it_is_known_at_first():
    state = Told().hear(heartbeat(d.MAV_TYPE_QUADROTOR, d.MAV_AUTOPILOT_PX4)).at()
    names = (
        "altitude pressure acceleration_spread attitude_error target_vertical_speed "
        "below_target target_age"
    )
    assert all(math.isnan(getattr(state, name)) for name in names.split())
