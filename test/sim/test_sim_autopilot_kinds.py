"""Where simulated autopilots differ as real ones do: termination, arming, parameters."""

import struct
from dataclasses import replace

import pytest
from device_bench import Station

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.sim.autopilot_kinds import ARDUCOPTER, ARDUPLANE, GENERIC, KINDS, PX4

ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
FAILED, NOT_NOW = dialect.MAV_RESULT_FAILED, dialect.MAV_RESULT_TEMPORARILY_REJECTED
ARM_DISARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
TERMINATE = dialect.MAV_CMD_DO_FLIGHTTERMINATION
ASK = dialect.MAV_CMD_ARM_AUTHORIZATION_REQUEST
TAKEOFF = (dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0)
FORCE = 21196
EACH = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)


def flying(kind, **parameters):
    kind = replace(kind, parameters={**kind.parameters, **parameters})
    station = Station(AutopilotDevice(1, [], kind=kind))
    station.command(ARM_DISARM, 1)
    station.run(0.1)
    station.command(*TAKEOFF, 20.0)
    station.run(10.0, step=0.05)
    station.forget()
    return station


def releases(station):
    longs = [m for m in station.messages("COMMAND_LONG") if m.command == 208]
    return [(m.target_system, m.target_component, m.param1) for m in longs]


@EACH
def test_its_heartbeat_says_which_it_is(kind):
    beat = Station(AutopilotDevice(1, [], kind=kind)).newest("HEARTBEAT")
    assert (beat.autopilot, beat.type) == (kind.autopilot, kind.vehicle_type)


@EACH
def test_a_forced_disarm_is_obeyed_by_all(kind):
    station = flying(kind)
    assert station.command(ARM_DISARM, 0) == [kind.disarm_refused]
    assert station.command(ARM_DISARM, 0, FORCE) == [ACCEPTED]
    station.run(0.05)
    assert not station.device.model.armed
    assert releases(station) == []


@pytest.mark.parametrize(
    ("kind", "after"), [(GENERIC, None), (PX4, 0.35), (ARDUCOPTER, 0.0), (ARDUPLANE, None)]
)
def test_disarmed_in_the_air_some_say_that_they_stand(kind, after):
    station = flying(kind)

    def stands():
        return (
            station.newest("EXTENDED_SYS_STATE").landed_state == dialect.MAV_LANDED_STATE_ON_GROUND
        )

    station.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 245, 20_000.0)
    station.command(ARM_DISARM, 0, FORCE)
    station.run(0.1, step=0.02)
    assert stands() is (after == 0.0)
    station.run(0.35, step=0.02)
    assert stands() is (after is not None)
    assert not station.device.model.on_ground
    # Armed again, it flies.
    station.command(ARM_DISARM, 1)
    station.run(0.1, step=0.02)
    assert not stands()


@pytest.mark.parametrize(
    ("kind", "parameters", "answer", "released", "for_good"),
    [
        (GENERIC, {}, ACCEPTED, [], True),
        (PX4, {}, ACCEPTED, [(1, 161, 2.0)], True),
        (ARDUCOPTER, {}, ACCEPTED, [], False),
        (ARDUPLANE, {}, FAILED, [], None),
        (ARDUPLANE, {"AFS_ENABLE": 1}, FAILED, [], None),
        (ARDUPLANE, {"AFS_ENABLE": 1, "AFS_TERM_ACTION": 42}, ACCEPTED, [], True),
    ],
)
def test_a_termination(kind, parameters, answer, released, for_good):
    station = flying(kind, **parameters)
    assert station.command(TERMINATE, 1) == [answer]
    station.run(0.05)
    assert station.device.model.armed is (for_good is None)
    assert releases(station) == released
    if for_good is not None:
        again = station.command(ARM_DISARM, 1)
        assert again == ([DENIED] if for_good else [ACCEPTED])


def test_px4_denies_a_termination_that_is_not_needed():
    station = Station(AutopilotDevice(1, [], kind=PX4))
    assert station.command(TERMINATE, 1) == [DENIED], "disarmed"
    station = flying(PX4)
    station.command(TERMINATE, 1)
    station.run(0.05)
    assert station.command(TERMINATE, 1) == [NOT_NOW], "terminated already"


def test_px4_shows_an_order_only_after_its_acknowledgement():
    station = flying(PX4)
    station.command(ARM_DISARM, 0, FORCE)
    station.command(dialect.MAV_CMD_REQUEST_MESSAGE, 0)
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED
    assert station.newest("HEARTBEAT").base_mode & armed
    station.run(0.03)
    station.command(dialect.MAV_CMD_REQUEST_MESSAGE, 0)
    assert not station.newest("HEARTBEAT").base_mode & armed


@pytest.mark.parametrize(("kind", "beats"), [(PX4, 2), (ARDUPLANE, 25)])
def test_px4_takes_no_other_interval_of_its_heartbeat(kind, beats):
    station = Station(AutopilotDevice(1, [], kind=kind))
    station.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 0, 100_000)
    station.forget()
    station.run(2.55)
    assert len(station.messages("HEARTBEAT")) == beats


def test_a_quadplane_says_in_air_before_it_has_left_the_ground():
    station = Station(AutopilotDevice(1, [], kind=ARDUPLANE))
    station.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 245, 10_000)
    station.command(ARM_DISARM, 1)
    station.device.model.climb_speed = 0.5
    station.command(*TAKEOFF, 20.0)
    station.run(0.1)
    assert station.newest("EXTENDED_SYS_STATE").landed_state == dialect.MAV_LANDED_STATE_IN_AIR
    assert station.device.model.height < 0.1
    assert station.command(ARM_DISARM, 0) == [FAILED], "it takes itself to fly"
    assert station.command(ARM_DISARM, 0, FORCE) == [ACCEPTED]
    station.run(0.1)
    assert station.newest("EXTENDED_SYS_STATE").landed_state == dialect.MAV_LANDED_STATE_ON_GROUND


# Parameters


def read(station, name):
    station.forget()
    station.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    return [f.message for f in station.frames]


def test_px4_puts_the_bytes_of_an_integer_into_the_float():
    station = Station(AutopilotDevice(1, [], kind=PX4))
    (told,) = read(station, "CBRK_FLIGHTTERM")
    assert told.param_type == dialect.MAV_PARAM_TYPE_INT32
    assert struct.unpack("<i", struct.pack("<f", told.param_value)) == (121212,)
    (told,) = read(station, "COM_SPOOLUP_TIME")
    assert (told.param_type, told.param_value) == (dialect.MAV_PARAM_TYPE_REAL32, 1.0)


def test_a_parameter_is_set_and_one_that_is_not_there_is_an_error():
    station = Station(AutopilotDevice(1, [], kind=ARDUPLANE))
    station.send(dialect.MAVLink_param_set_message(1, 1, b"AFS_ENABLE", 1.0, 2))
    (told,) = read(station, "AFS_ENABLE")
    assert told.param_value == 1.0
    (error,) = read(station, "NO_SUCH")
    assert (error.get_type(), error.error) == (
        "PARAM_ERROR",
        dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST,
    )


def test_a_generic_autopilot_has_no_parameters():
    assert read(Station(AutopilotDevice(1, [])), "AFS_ENABLE") == []


# Arm authorization


def asking():
    kind = replace(PX4, parameters={**PX4.parameters, "COM_ARM_AUTH_REQ": 1})
    return Station(AutopilotDevice(1, [], kind=kind))


@pytest.mark.parametrize(("result", "armed"), [(ACCEPTED, True), (DENIED, False)])
def test_px4_that_asks_arms_by_the_answer(result, armed):
    station = asking()
    assert station.command(ARM_DISARM, 1) == [], "the order waits"
    question = station.newest("COMMAND_LONG")
    assert (question.target_system, question.command) == (10, ASK)
    station.send(dialect.MAVLink_command_ack_message(ASK, result, 0, 1, 1, 1))
    station.run(0.05)
    assert station.device.model.armed is armed
    assert station.newest("COMMAND_ACK").result == (ACCEPTED if armed else NOT_NOW)


def test_px4_that_asks_and_is_not_answered_does_not_arm():
    station = asking()
    station.command(ARM_DISARM, 1)
    station.run(1.1)
    assert station.newest("COMMAND_ACK").result == NOT_NOW
    assert not station.device.model.armed
    station.send(dialect.MAVLink_command_ack_message(ASK, ACCEPTED, 0, 1, 1, 1))
    station.run(0.1)
    assert not station.device.model.armed, "too late"
