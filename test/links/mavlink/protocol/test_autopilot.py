"""What the autopilot says of the vehicle: each message and field, its sign, what is no value."""

import math

import pytest
from autopilot_bench import Told, attitude, imu, position
from link_bench import ardupilot, copter, heartbeat, landed

from chute_ros.links.mavlink.protocol.autopilot import is_autopilot
from chute_ros.links.mavlink.protocol.stream_watch import ASKED_FOR
from chute_ros.model import VTOL, Armed, LandedState, LinkState
from chute_ros.protocol.mavlink.dialect import dialect as d

NAN, INF = math.nan, math.inf


def quaternion(w, x, y, z):
    return d.MAVLink_attitude_quaternion_message(1000, w, x, y, z, 0.0, 0.0, 0.0)


def highres(x, y, z):
    return d.MAVLink_highres_imu_message(0, x, y, z, *[0.0] * 10, 0)


def power(millivolt, percent):
    return d.MAVLink_sys_status_message(0, 0, 0, 0, millivolt, -1, percent, 0, 0, 0, 0, 0, 0)


def local(vz):
    return d.MAVLink_local_position_ned_message(1000, 0.0, 0.0, -50.0, 0.0, 0.0, vz)


def altitude(relative):
    return d.MAVLink_altitude_message(0, 0.0, 0.0, 0.0, relative, 0.0, 0.0)


HALF = math.sqrt(0.5)
VALUES = [
    (copter(True), "armed", Armed.ARMED),
    (copter(False), "armed", Armed.DISARMED),
    (copter(False, d.MAV_STATE_CRITICAL), "system_status", d.MAV_STATE_CRITICAL),
    (landed(1), "landed_state", LandedState.ON_GROUND),
    (landed(2), "landed_state", LandedState.IN_AIR),
    (landed(3), "landed_state", LandedState.TAKING_OFF),
    (landed(4), "landed_state", LandedState.LANDING),
    (position(relative=12_340), "height", 12.34),
    (position(relative=-1500), "height", -1.5),
    (position(vz=250), "vertical_speed", -2.5),  # down positive on the wire
    (position(vz=-300), "vertical_speed", 3.0),
    (position(lat=-337_000_000, lon=1_512_000_000), "latitude", -33.7),
    (position(lat=-337_000_000, lon=1_512_000_000), "longitude", 151.2),
    (local(4.0), "vertical_speed", -4.0),
    (altitude(33.0), "height", 33.0),
    (attitude(roll=0.5), "roll", 0.5),
    (attitude(pitch=-0.25), "pitch", -0.25),
    (attitude(yaw=-3.0), "yaw", -3.0),
    (attitude(roll=-0.5), "tilt", 0.5),
    (attitude(roll=math.pi), "tilt", math.pi),
    (quaternion(1, 0, 0, 0), "tilt", 0.0),
    (quaternion(HALF, HALF, 0, 0), "roll", math.pi / 2),
    (quaternion(HALF, 0, HALF, 0), "pitch", math.pi / 2),
    (quaternion(HALF, 0, 0, HALF), "yaw", math.pi / 2),
    (quaternion(0, 1, 0, 0), "tilt", math.pi),
    (quaternion(0.9, 0, 0, 0), "tilt", 0.0),
    (imu(0, 0, -1000), "acceleration", 9.80665),
    (imu(300, 400, 0), "acceleration", 0.5 * 9.80665),
    (highres(3.0, 4.0, 0.0), "acceleration", 5.0),
    (power(22_800, 80), "battery_voltage", 22.8),
    (power(22_800, 80), "battery_remaining", 0.8),
    (power(0xFFFF, 0), "battery_remaining", 0.0),
    (position(boot_ms=2500), "uptime", 2.5),
    (d.MAVLink_system_time_message(0, 7500), "uptime", 7.5),
    # What is no value is not taken over.
    (position(), "latitude", NAN),  # 0, 0 is sent before it is known
    (position(lat=950_000_000, lon=1), "latitude", NAN),
    (local(NAN), "vertical_speed", NAN),
    (altitude(NAN), "height", NAN),
    (altitude(INF), "height", NAN),
    (attitude(roll=NAN), "tilt", NAN),
    (attitude(yaw=INF), "roll", NAN),
    (quaternion(NAN, 0, 0, 0), "tilt", NAN),
    (quaternion(0, 0, 0, 0), "tilt", NAN),
    (quaternion(INF, 0, 0, 0), "tilt", NAN),
    (highres(NAN, 0.0, 0.0), "acceleration", NAN),
    (power(0xFFFF, -1), "battery_voltage", NAN),
    (power(0xFFFF, -1), "battery_remaining", NAN),
    (power(0xFFFF, 101), "battery_remaining", NAN),
]


def test_each_field_of_each_message():
    for message, field, value in VALUES:
        known = getattr(Told().hear(message).at(), field)
        assert known == pytest.approx(value, abs=1e-3, nan_ok=True), (message.get_type(), field)


def test_undefined_landed_state_lets_the_known_one_age():
    for state in (0, 5, 255):
        told = Told().hear(landed(2), now=1.0).hear(landed(state), now=3.0)
        assert told.at(4.0).landed_state is LandedState.IN_AIR, state
        assert told.at(4.0).landed_state_age == 3.0


MC, FW, TO_FW = d.MAV_VTOL_STATE_MC, d.MAV_VTOL_STATE_FW, d.MAV_VTOL_STATE_TRANSITION_TO_FW


@pytest.mark.parametrize(
    ("kind", "states", "known_as"),
    [
        # ArduPlane calls a quadplane FIXED_WING where Q_MAV_TYPE is 0 or 1; in MANUAL it says FW,
        # in QSTABILIZE MC (4.7.0-dev in its own simulator).
        (d.MAV_TYPE_FIXED_WING, [FW], VTOL),
        (d.MAV_TYPE_FIXED_WING, [MC], VTOL),
        (d.MAV_TYPE_FIXED_WING, [0], d.MAV_TYPE_FIXED_WING),
        # With Q_MAV_TYPE 2, once it has been on its wing or in MANUAL.
        (d.MAV_TYPE_QUADROTOR, [TO_FW, MC], VTOL),
        # ArduCopter always says MC, PX4's multirotors say nothing.
        (d.MAV_TYPE_QUADROTOR, [MC], d.MAV_TYPE_QUADROTOR),
        (d.MAV_TYPE_HEXAROTOR, [MC], d.MAV_TYPE_HEXAROTOR),
        (d.MAV_TYPE_QUADROTOR, [0], d.MAV_TYPE_QUADROTOR),
        (d.MAV_TYPE_VTOL_TILTROTOR, [MC, FW], d.MAV_TYPE_VTOL_TILTROTOR),
        (d.MAV_TYPE_GROUND_ROVER, [MC], d.MAV_TYPE_GROUND_ROVER),
    ],
)
def test_a_vtol_is_known_by_what_it_tells_beside_its_type(kind, states, known_as):
    told = Told().hear(ardupilot(kind=kind))
    assert told.at().vehicle_type == kind
    for state in states:
        told.hear(d.MAVLink_extended_sys_state_message(state, 2))
    told.hear(ardupilot(kind=kind))
    assert told.at().vehicle_type == known_as


def test_each_part_has_its_own_age():
    told = Told().hear(copter(), now=1.0).hear(landed(), now=2.0).hear(position(vz=5), now=3.0)
    told.hear(attitude(), now=4.0).hear(imu(0, 0, 0), now=5.0).hear(power(1, 1), now=6.0)
    told.hear(position(lat=1, lon=1), now=7.0)
    state = told.at(10.0)
    ages = "armed landed_state height vertical_speed attitude acceleration battery position"
    assert [getattr(state, f"{part}_age") for part in ages.split()] == [9, 8, 3, 3, 6, 5, 4, 3]


def test_nothing_is_known_at_first():
    state = Told().at(5.0)
    assert (state.armed, state.landed_state) == (Armed.UNKNOWN, LandedState.UNKNOWN)
    assert state.link_state is LinkState.NEVER_SEEN
    assert all(math.isnan(getattr(state, name)) for name in vars(state) if name.endswith("_age"))
    assert math.isnan(state.uptime)


def test_motors_off_by_disarm_or_termination():
    for armed, state, off in (
        (False, d.MAV_STATE_STANDBY, True),
        (True, d.MAV_STATE_ACTIVE, False),
        (True, d.MAV_STATE_FLIGHT_TERMINATION, True),
    ):
        assert Told().hear(copter(armed, state)).tracker.motors_off == off
    assert not Told().tracker.motors_off


@pytest.mark.parametrize(
    ("before", "in_flight"),
    [
        ([copter(True), landed(2)], True),
        ([copter(True), landed(1)], True),  # armed: the motors may turn
        ([copter(False), landed(2)], True),
        ([copter(False), landed(1)], False),
        ([copter(False)], False),
    ],
)
def test_restart_is_seen_and_forgets_what_it_no_longer_knows(before, in_flight):
    told = Told().hear(*before, position(boot_ms=90_000, relative=5000), now=1.0)
    told.hear(attitude(200), attitude(300), now=2.0)
    state = told.at(2.0)
    assert (state.reboot_count, state.rebooted_in_flight) == (1, in_flight)
    assert (state.armed, state.landed_state) == (Armed.UNKNOWN, LandedState.UNKNOWN)
    assert math.isnan(state.landed_state_age)
    assert (state.height, state.height_age) == (5.0, 1.0)
    assert state.uptime == pytest.approx(0.3)


def test_second_restart_before_it_says_where_it_is_still_is_in_flight():
    told = Told().hear(copter(True), landed(2), attitude(90_000))
    told.hear(attitude(200), attitude(5000), copter(False), attitude(300), attitude(400))
    assert told.at().reboot_count == 2
    assert told.at().rebooted_in_flight
    # After it said that it stands on the ground, a restart there is one.
    told.hear(landed(1), attitude(5000), attitude(300), attitude(400))
    assert (told.at().reboot_count, told.at().rebooted_in_flight) == (3, False)


def test_reordered_delayed_empty_and_wrapped_times_are_no_restart():
    for times, uptime in (
        *(([5000, 4100, 5050], 5.05), ([5000, 3000, 5050], 5.05), ([5000, 0, 5050], 5.05)),
        ([2**32 - 100, 50, 2**32 - 50, 100, 150], 0.15),  # after 49 days
    ):
        told = Told().hear(copter(True), *[attitude(boot_ms) for boot_ms in times])
        assert told.at().reboot_count == 0, times
        assert told.at().armed is Armed.ARMED
        assert told.at().uptime == uptime
    script = [d.MAVLink_named_value_float_message(t, b"x", 1.0) for t in (5, 6, 7)]
    assert Told().hear(attitude(90_000), *script).at().reboot_count == 0


def test_is_autopilot():
    px4, ardupilot = d.MAV_AUTOPILOT_PX4, d.MAV_AUTOPILOT_ARDUPILOTMEGA
    generic, invalid = d.MAV_AUTOPILOT_GENERIC, d.MAV_AUTOPILOT_INVALID
    for kind, autopilot, expected in (
        (d.MAV_TYPE_QUADROTOR, px4, True),
        (d.MAV_TYPE_GENERIC, generic, True),
        (d.MAV_TYPE_PARAFOIL, ardupilot, True),
        (99, px4, True),  # a vehicle newer than the dialect
        (d.MAV_TYPE_QUADROTOR, invalid, False),
        (d.MAV_TYPE_GCS, invalid, False),
        (d.MAV_TYPE_GIMBAL, invalid, False),
        # Components that fill in what they are not:
        (d.MAV_TYPE_GCS, generic, False),
        (d.MAV_TYPE_PARACHUTE, generic, False),
        (d.MAV_TYPE_GIMBAL, ardupilot, False),
        (d.MAV_TYPE_CAMERA, generic, False),
        (d.MAV_TYPE_ANTENNA_TRACKER, ardupilot, False),
        (d.MAV_TYPE_ONBOARD_CONTROLLER, generic, False),
    ):
        assert is_autopilot(heartbeat(kind, autopilot)) is expected, (kind, autopilot)


def whole_picture(boot_ms=1000):
    at = {"boot_ms": boot_ms}
    return landed(), position(**at), attitude(**at), imu(0, 0, 0, **at), power(1, 1)


ALL = tuple(ASKED_FOR.values())


def due(told, now):
    """What of the needed messages is asked for at 10 Hz."""
    asks = (one.message_id for one in told.tracker.messages_due(0.1, now))
    return tuple(message for message in asks if message in ALL)


def test_all_messages_are_asked_for_until_they_come():
    for lacking in (None, *range(5)):
        told = Told().hear(heartbeat())
        assert due(told, 0.0) == ALL
        told.hear(*(one for n, one in enumerate(whole_picture()) if n != lacking), now=0.4)
        assert due(told, 0.5) == (() if lacking is None else (ALL[lacking],)), lacking


def test_one_that_starts_anew_is_asked_for_all_that_does_not_come_by_itself():
    told = Told().hear(heartbeat())
    for tenth in range(100):
        told.hear(*whole_picture(60_000 + 100 * tenth), now=tenth / 10)
    assert due(told, 9.9) == ()
    for tenth in range(3):
        told.hear(attitude(boot_ms=100 * tenth), now=10.0 + tenth / 10)
    assert told.tracker.reboot_count == 1
    assert set(due(told, 10.2)) == set(ALL) - {ASKED_FOR["tilt"]}


def test_one_that_is_heard_again_may_have_started_anew():
    told = Told().hear(heartbeat(), *whole_picture())
    told.tracker.liveness.update(60.0)
    told.hear(heartbeat(), now=60.0)
    assert due(told, 60.0) == ALL
