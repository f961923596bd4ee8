"""Signs that the motors stand still, beside HEARTBEAT: only after an accepted order, and new."""

from functools import partial

import pytest
from link_bench import Bench, ack, ardupilot, landed, setting

from chute_ros.protocol.mavlink.dialect import dialect as d

PILOT = (1, 1)
DISARM = 400
IN_AIR = d.MAV_LANDED_STATE_IN_AIR


def outputs(*us, port=0):
    padded = (*us, *[0] * (16 - len(us)))
    return d.MAVLink_servo_output_raw_message(0, port, *padded[:8], *padded[8:])


def text(words):
    return d.MAVLink_statustext_message(6, words.encode())


IDLE, DRIVEN = outputs(1000, 1000, 1500), outputs(1600, 1580, 1480)
OFF = outputs(1000, 1000, 1900)


def flying():
    """Two motors and a control surface; it was seen disarmed."""
    bench = Bench().hear(PILOT, ardupilot(), IDLE)
    turning = esc_status(4000, 4100, -3900, 4000)
    return bench.at(0.5).hear(PILOT, ardupilot(True), landed(IN_AIR), DRIVEN, turning).at(1.0)


def esc_status(*rpm, index=0):
    return d.MAVLink_esc_status_message(index, 0, rpm, [15.0] * 4, [1.0] * 4)


def esc_telemetry(*rpm):
    zero = [0] * 4
    return d.MAVLink_esc_telemetry_1_to_4_message(zero, zero, zero, zero, rpm, zero)


SIGNS = {
    "SERVO_OUTPUT_RAW": OFF,
    "EXTENDED_SYS_STATE": landed(),
    "ESC_STATUS": esc_status(0, 0, 0, 0),
    "ESC_TELEMETRY_1_TO_4": esc_telemetry(0, 0, 0, 0),
    "ArduCopter": text("Disarming motors"),
    "ArduPlane": text("Throttle disarmed"),
    "PX4": text("Disarmed by external command"),
}


@pytest.mark.parametrize("name", SIGNS)
def test_a_sign_after_the_acceptance_alone_confirms_the_kill(name):
    sign = SIGNS[name]
    bench = flying().call("kill", 1).at(1.02).hear(PILOT, ack(DISARM))
    assert bench.ends(1) == []
    assert bench.at(1.05).hear(PILOT, sign).end(1).finished.success
    failed = ack(DISARM, d.MAV_RESULT_FAILED)
    assert flying().call("kill", 1).at(1.02).hear(PILOT, failed, sign).ends(1) == []
    bench = flying().hear(PILOT, sign).call("kill", 1).at(1.02).hear(PILOT, ack(DISARM))
    assert bench.at(1.05).hear(PILOT, ardupilot(True)).ends(1) == [], "it is of before the order"


def test_one_of_eight_motors_that_turns_is_enough():
    bench = flying().hear(PILOT, esc_status(4000, 0, 0, 0, index=4)).call("kill", 1)
    bench.at(1.02).hear(PILOT, ack(DISARM)).at(1.05).hear(PILOT, esc_status(0, 0, 0, 0))
    assert bench.ends(1) == []
    bench.at(1.07).hear(PILOT, esc_status(0, 0, 0, 0, index=4))
    assert bench.end(1).finished.success


def test_motors_on_another_port_or_in_another_group_must_stand_still_too():
    bench = Bench().hear(PILOT, ardupilot(), IDLE, outputs(1000, 1000, port=1))
    bench.at(0.5).hear(PILOT, ardupilot(True), DRIVEN, outputs(1600, 1600, port=1))
    bench.at(1.0).call("kill", 1).at(1.02).hear(PILOT, ack(DISARM)).at(1.05).hear(PILOT, OFF)
    assert bench.ends(1) == []
    assert bench.hear(PILOT, outputs(1000, 1000, port=1)).end(1).finished.success
    zero = [0] * 4
    others = d.MAVLink_esc_telemetry_5_to_8_message(zero, zero, zero, zero, [4000] * 4, zero)
    bench = flying().hear(PILOT, others).call("kill", 1)
    bench.at(1.02).hear(PILOT, ack(DISARM)).at(1.05).hear(PILOT, esc_telemetry(*zero))
    assert bench.hear(PILOT, esc_status(*zero)).ends(1) == []


def test_outputs_of_one_that_was_just_armed_are_not_those_of_one_that_stands_still():
    """A heartbeat tells of the arming up to 1 s later."""
    bench = Bench().hear(PILOT, ardupilot(), IDLE).at(0.4).hear(PILOT, outputs(1100, 1100, 1500))
    bench.at(0.5).hear(PILOT, ardupilot(True), DRIVEN).at(1.0).call("kill", 1)
    bench.at(1.02).hear(PILOT, ack(DISARM)).at(1.05).hear(PILOT, outputs(1100, 1100, 1500))
    assert bench.ends(1) == []
    assert bench.at(1.1).hear(PILOT, OFF).end(1).finished.success


def test_what_says_that_an_order_is_obeyed_which_stops_no_motor_confirms_nothing():
    """An aeroplane whose motor runs without arming accepts a disarm, and says so."""
    afs = {"ARMING_REQUIRE": 0, "AFS_ENABLE": 1, "AFS_TERM_ACTION": 42, "AFS_TERM_PIN": -1}
    plane = partial(ardupilot, kind=d.MAV_TYPE_FIXED_WING)
    bench = Bench().hear(PILOT, plane(True), *(setting(*one) for one in afs.items()))
    bench.at(1.0).call("kill", 1).at(1.22)
    bench.hear(PILOT, ack(DISARM), text("Throttle disarmed"), plane(True))
    assert bench.ends(1) == []
    bench.hear(PILOT, ack(185), text("Throttle disarmed"))
    assert bench.end(1).finished.success


def test_a_glider_with_its_motor_off_and_armed_confirms_nothing():
    bench = flying().hear(PILOT, OFF).call("kill", 1)
    bench.at(1.02).hear(PILOT, ack(DISARM)).at(1.05).hear(PILOT, OFF)
    assert bench.ends(1) == []


@pytest.mark.parametrize(
    "newest", [outputs(1000, 1200, 1500), outputs(0, 0, 0)], ids=["one turns", "nothing known"]
)
def test_outputs_that_show_no_standstill_confirm_nothing(newest):
    bench = flying().call("kill", 1)
    bench.at(1.02).hear(PILOT, ack(DISARM)).at(1.05).hear(PILOT, newest)
    assert (bench.ends(1) == []) is (newest is not None and newest.servo2_raw > 0)


def test_outputs_of_an_autopilot_that_was_never_seen_disarmed_confirm_nothing():
    bench = Bench().hear(PILOT, ardupilot(True), DRIVEN).at(1.0).call("kill", 1)
    bench.at(1.02).hear(PILOT, ack(DISARM)).at(1.05).hear(PILOT, OFF)
    assert bench.ends(1) == []
