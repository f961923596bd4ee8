"""The simulated autopilot, from the other side of the protocol."""

import math

import pytest
from device_bench import Station, parachute_status

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.air import air_at
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.sim.flight import Descent
from chute_ros.sim.home import Homing

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
DENIED = dialect.MAV_RESULT_DENIED
NOT_NOW = dialect.MAV_RESULT_TEMPORARILY_REJECTED
UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED
ARM_DISARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
TERMINATE = dialect.MAV_CMD_DO_FLIGHTTERMINATION
TAKEOFF = (dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0)
MOTOR_OFF = (
    dialect.MAV_CMD_INJECT_FAILURE,
    dialect.FAILURE_UNIT_SYSTEM_MOTOR,
    dialect.FAILURE_TYPE_OFF,
)
SET = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
FORCE = 21196


@pytest.fixture
def ground():
    return Station(AutopilotDevice(1, []))


@pytest.fixture
def flying(ground):
    ground.command(ARM_DISARM, 1)
    ground.command(*TAKEOFF, 60.0)
    ground.run(30.0, step=0.05)
    return ground


def armed(station):
    """By its newest heartbeat."""
    station.run(0.0)
    return bool(station.newest("HEARTBEAT").base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)


def height(station):
    return station.newest("GLOBAL_POSITION_INT").relative_alt / 1000.0


def landed_state(station):
    return station.newest("EXTENDED_SYS_STATE").landed_state


def test_on_the_ground_it_says_so(ground):
    ground.run(2.0)
    beat = ground.newest("HEARTBEAT")
    assert (beat.type, beat.autopilot) == (
        dialect.MAV_TYPE_QUADROTOR,
        dialect.MAV_AUTOPILOT_GENERIC,
    )
    assert not armed(ground)
    assert landed_state(ground) == dialect.MAV_LANDED_STATE_ON_GROUND
    assert height(ground) == 0.0
    assert ground.newest("SYS_STATUS").voltage_battery == 15800


def test_arming_shows_in_a_heartbeat_at_once(ground):
    ground.run(0.5)
    ground.forget()
    assert ground.command(ARM_DISARM, 1) == [ACCEPTED]
    assert armed(ground)
    names = [frame.message.get_type() for frame in ground.frames]
    assert names[:2] == ["COMMAND_ACK", "HEARTBEAT"]
    assert ground.newest("HEARTBEAT").system_status == dialect.MAV_STATE_ACTIVE
    assert ground.command(ARM_DISARM, 0) == [ACCEPTED]
    assert not armed(ground)


def test_it_takes_off_only_when_armed_and_to_a_height(ground):
    assert ground.command(*TAKEOFF, 60.0) == [DENIED]
    ground.command(ARM_DISARM, 1)
    for nowhere in (0.0, -5.0, float("nan")):
        assert ground.command(*TAKEOFF, nowhere) == [DENIED]
    assert ground.command(*TAKEOFF, 60.0) == [ACCEPTED]
    ground.run(30.0, step=0.05)
    assert height(ground) == pytest.approx(60.0, abs=1.0)
    assert landed_state(ground) == dialect.MAV_LANDED_STATE_IN_AIR


def test_in_the_air_it_refuses_a_plain_disarm(flying):
    assert flying.command(ARM_DISARM, 0) == [NOT_NOW]
    assert flying.command(ARM_DISARM, 0, 1) == [NOT_NOW]
    flying.run(2.0)
    assert armed(flying)
    assert height(flying) == pytest.approx(60.0, abs=1.0)


def test_in_the_air_a_forced_disarm_stops_the_motors(flying):
    assert flying.command(ARM_DISARM, 0, FORCE) == [ACCEPTED]
    assert not armed(flying)
    flying.run(1.5)
    assert flying.newest("GLOBAL_POSITION_INT").vz > 500, "it falls; positive is down"
    assert flying.command(ARM_DISARM, 1) == [ACCEPTED], "it may be armed again"


def test_a_termination_stops_the_motors_for_good(flying):
    assert flying.command(TERMINATE, 0) == [DENIED]
    assert armed(flying)
    assert flying.command(TERMINATE, 1) == [ACCEPTED]
    assert not armed(flying)
    assert flying.newest("HEARTBEAT").system_status == dialect.MAV_STATE_FLIGHT_TERMINATION
    assert flying.command(ARM_DISARM, 1) == [DENIED]
    assert any("FLIGHT TERMINATION at 60" in line for line in flying.log)


def test_it_lands_and_disarms_itself(flying):
    assert flying.command(dialect.MAV_CMD_NAV_LAND) == [ACCEPTED]
    flying.run(60.0, step=0.05)
    assert "TOUCHDOWN" in flying.log
    assert not armed(flying)
    assert landed_state(flying) == dialect.MAV_LANDED_STATE_ON_GROUND


def test_a_motor_fails_on_request(flying):
    other = (dialect.MAV_CMD_INJECT_FAILURE, dialect.FAILURE_UNIT_SYSTEM_MOTOR, 0)
    assert flying.command(*other) == [UNSUPPORTED]
    assert flying.command(*MOTOR_OFF) == [ACCEPTED]
    assert any("MOTOR FAILURE at 60" in line for line in flying.log)
    flying.command(SET, dialect.MAVLINK_MSG_ID_ATTITUDE, 100_000)
    flying.run(1.5)
    assert flying.newest("GLOBAL_POSITION_INT").vz > 500
    assert flying.newest("ATTITUDE").roll > 1.0
    assert armed(flying), "nobody has told it to stop"


def test_the_canopy_opens_when_the_parachute_says_that_it_was_released(flying):
    flying.command(TERMINATE, 1)
    flying.run(1.0)
    flying.send(parachute_status(deployed=0), sender=(1, 161))
    assert flying.device.model.canopy == 0.0
    flying.send(parachute_status(deployed=3), sender=(1, 161))
    flying.run(4.0)
    assert flying.newest("GLOBAL_POSITION_INT").vz == pytest.approx(500, abs=30)
    flying.send(parachute_status(deployed=3), sender=(1, 161))
    assert sum(line.startswith("CANOPY") for line in flying.log) == 1
    flying.run(20.0, step=0.05)
    assert "TOUCHDOWN" in flying.log


def test_the_parachute_of_another_vehicle_opens_no_canopy_here(flying):
    flying.send(parachute_status(deployed=3), sender=(2, 161))
    flying.run(1.0)
    assert not any(line.startswith("CANOPY") for line in flying.log)


def test_a_restart_in_the_air_starts_its_clock_anew_and_does_not_hold_the_vehicle(flying):
    assert flying.newest("GLOBAL_POSITION_INT").time_boot_ms > 29_000
    flying.device.act("reboot")
    flying.run(0.2)
    position = flying.newest("GLOBAL_POSITION_INT")
    assert position.time_boot_ms < 300
    assert position.relative_alt == pytest.approx(60_000, abs=1000), "the vehicle is where it was"
    assert not armed(flying)
    flying.run(1.5)
    assert flying.newest("GLOBAL_POSITION_INT").vz > 500


def test_attitude_and_acceleration_come_only_on_request(ground):
    ground.run(3.0)
    assert ground.messages("ATTITUDE") == ground.messages("SCALED_IMU") == []
    for message_id in (dialect.MAVLINK_MSG_ID_ATTITUDE, dialect.MAVLINK_MSG_ID_SCALED_IMU):
        assert ground.command(SET, message_id, 50_000) == [ACCEPTED]
    ground.run(2.0)
    assert len(ground.messages("ATTITUDE")) == pytest.approx(40, abs=2)
    imu = ground.newest("SCALED_IMU")
    assert imu.zacc == pytest.approx(-1000, abs=2), "one g, downwards"


def test_the_command_line_can_do_it_too(ground):
    ground.device.act("arm")
    ground.device.act("takeoff=20")
    ground.run(15.0, step=0.05)
    assert height(ground) == pytest.approx(20.0, abs=1.0)
    ground.device.act("land")
    ground.run(15.0, step=0.05)
    assert landed_state(ground) == dialect.MAV_LANDED_STATE_ON_GROUND
    assert not armed(ground)
    ground.device.act("fail-motor")
    ground.run(0.0)
    assert {"ARMED", "TOUCHDOWN", "MOTOR FAILURE at 0.0 m"} <= {*ground.log}


def test_after_a_pause_it_catches_up(flying):
    # The process was stopped for a while: the vehicle goes on from where it was.
    flying.command(TERMINATE, 1)
    flying.now += 2.0
    flying.run(0.0)
    assert 30.0 < height(flying) < 50.0


# -- what it tells besides ------------------------------------------------------------------------


def asked(station, *names):
    """Ten times a second from now on."""
    for name in names:
        message_id = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
        assert station.command(SET, message_id, 100_000) == [ACCEPTED]


def test_altitude_and_pressure_tell_of_the_height_whatever_home_is(flying):
    asked(flying, "SCALED_PRESSURE", "HOME_POSITION")
    flying.device.home.move(55.0)
    flying.run(0.5)
    position = flying.newest("GLOBAL_POSITION_INT")
    assert position.alt / 1000.0 == pytest.approx(548.0, abs=1.0)
    assert position.relative_alt / 1000.0 == pytest.approx(5.0, abs=1.0)
    assert flying.newest("HOME_POSITION").altitude == 543_000
    told = {one.press_abs for one in flying.messages("SCALED_PRESSURE")}
    assert len(told) > 3, "a barometer has noise"
    assert sum(told) / len(told) == pytest.approx(air_at(548.0).pressure / 100.0, abs=0.15)


def test_the_local_position_is_that_of_take_off_whatever_home_is(flying):
    asked(flying, "LOCAL_POSITION_NED")
    flying.device.home.move(55.0)
    flying.command(TERMINATE, 1)
    flying.run(1.0)
    local, position = flying.newest("LOCAL_POSITION_NED"), flying.newest("GLOBAL_POSITION_INT")
    assert -local.z == pytest.approx(position.relative_alt / 1000.0 + 55.0, abs=2.0)
    assert local.vz == pytest.approx(position.vz / 100.0, abs=2.0)
    assert local.vz > 5.0


@pytest.mark.parametrize(
    ("homing", "told"), [(Homing.STAYS, 30.0), (Homing.FOLLOWS, 0.0), (Homing.ZEROED, -20.0)]
)
def test_home_after_a_disarming_in_the_air(flying, homing, told):
    """Given a vehicle that falls by some 30 m: 5 m of them before its home is set anew."""
    flying.device.home.homing = homing
    flying.command(ARM_DISARM, 0, FORCE)
    lowest = 0.0
    for _ in range(54):
        flying.run(0.05)
        lowest = min(lowest, height(flying))
    true = flying.device.model.height
    assert 25.0 < true < 36.0
    assert flying.newest("GLOBAL_POSITION_INT").alt / 1000.0 == pytest.approx(488 + true, abs=4.0)
    if homing is Homing.FOLLOWS:
        assert -20.0 < lowest < 0.0, "it starts at zero again and again"
    else:
        assert height(flying) == pytest.approx(told, abs=10.0)


def test_a_home_that_drifts_takes_the_heights_with_it(flying):
    flying.device.home.drift = 0.5
    flying.run(20.0)
    assert height(flying) == pytest.approx(50.0, abs=1.0)
    assert flying.newest("GLOBAL_POSITION_INT").alt == pytest.approx(548_000, abs=1000)


def turned(message):
    """The angle from upright that an attitude target asks for, rad."""
    return 2.0 * math.atan2(message.q[1], message.q[0])


def test_what_is_in_control_was_told_to_do_what_it_does(flying):
    asked(flying, "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED")
    model = flying.device.model
    model.step = lambda dt: None
    model.roll, model.vertical_speed, model.height = 1.1, -7.0, 42.0
    flying.run(0.3)
    target = flying.newest("POSITION_TARGET_LOCAL_NED")
    assert turned(flying.newest("ATTITUDE_TARGET")) == pytest.approx(1.1)
    assert (target.z, target.vz) == pytest.approx((-42.0, 7.0))
    used = dialect.POSITION_TARGET_TYPEMASK_Z_IGNORE | dialect.POSITION_TARGET_TYPEMASK_VZ_IGNORE
    assert not target.type_mask & used


@pytest.mark.parametrize("sinks", [False, True])
def test_what_is_out_of_control_was_told_to_be_upright_and_to_stay(flying, sinks):
    asked(flying, "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED")
    flying.device.model.descent = Descent("sink", 8.0) if sinks else None
    flying.device.act("fail-motor")
    flying.run(2.0)
    target = flying.newest("POSITION_TARGET_LOCAL_NED")
    assert turned(flying.newest("ATTITUDE_TARGET")) == 0.0
    assert (target.z, target.vz) == pytest.approx((-60.0, 0.0))
    assert flying.newest("GLOBAL_POSITION_INT").vz > 500


def test_one_accelerometer_or_two(ground):
    second = (SET, dialect.MAVLINK_MSG_ID_SCALED_IMU2, 100_000)
    assert ground.command(*second) == [DENIED]
    ground.device.add_second_imu()
    assert ground.command(*second) == [ACCEPTED]
    ground.run(0.5)
    assert ground.newest("SCALED_IMU2").zacc == pytest.approx(-1000, abs=2)
