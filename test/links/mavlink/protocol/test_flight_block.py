"""A block holds until the vehicle is off the ground by its height, whatever its landed state."""

from typing import Any

import pytest
from link_bench import Bench, ack, ardupilot, copter, landed, px4_integer, setting

from chute_ros.links.mavlink.runtime import MavlinkRuntime, MavlinkSettings
from chute_ros.protocol.mavlink.dialect import dialect as d

PILOT = (1, 1)
DISARM, FORCE, REQUEST, INTERVAL = 400, 21196, 512, 511
IN_AIR = d.MAV_LANDED_STATE_IN_AIR
QUADPLANE = d.MAV_TYPE_VTOL_RESERVED2


def at_height(height):
    return d.MAVLink_global_position_int_message(
        0, 0, 0, int(height * 1000), int(height * 1000), 0, 0, 0, 0
    )


def quadplane(armed=False):
    return ardupilot(armed, kind=QUADPLANE)


def on_the_ground(make=quadplane, reason="no parachute", **config):
    """Disarmed, at height 0, flight blocked."""
    bench = Bench(**config).hear(PILOT, make(False), landed(), at_height(0.0))
    bench.call("flight_block", reason)
    return bench.at(0.5).hear(PILOT, make(False), at_height(0.0))


def disarms(bench):
    """The orders to disarm: plain (0) and forced (21196)."""
    return [m.param2 for m in bench.commands(DISARM)]


def test_in_air_at_height_0_ends_no_block():
    """A quadplane says IN_AIR 0.05 s after a take-off is ordered, before it says armed."""
    bench = on_the_ground().hear(PILOT, landed(IN_AIR))
    bench.at(0.7).hear(PILOT, quadplane(True), at_height(0.1), landed(IN_AIR))
    assert disarms(bench) == [0]
    bench.at(0.72).hear(PILOT, ack(DISARM, d.MAV_RESULT_FAILED))
    assert disarms(bench) == [0, FORCE], "it refuses as it takes itself to fly, and stands"
    bench.at(0.74).hear(PILOT, ack(DISARM), quadplane(False))
    assert bench.end(-1).finished.success


def test_in_air_of_one_that_has_stood_still_ends_no_block():
    """A quadplane (ArduPlane 4.7.0-dev in its own simulator) was disarmed as a take-off had been
    ordered, and says IN_AIR from then on; 8 s later it is armed by force, where it stands."""
    bench = on_the_ground().hear(PILOT, landed(IN_AIR))
    for k in range(80):
        bench.at(bench.t + 0.1).hear(PILOT, quadplane(False), landed(IN_AIR))
        bench.hear(PILOT, at_height(0.2 * (k % 3)))
    bench.at(bench.t + 0.1).hear(PILOT, quadplane(True), at_height(0.1), landed(IN_AIR))
    assert disarms(bench) == [0]


@pytest.mark.parametrize(
    ("place", "height"),
    [
        # It soars, it falls, it glides; 47.0 degrees and a part of a degree, 111 km.
        (lambda k: 47.0 + 1e-5 * k, lambda k: 3.0),
        (lambda k: 47.0, lambda k: 5.0 - 0.08 * k),
        (lambda k: 47.0 + 1e-5 * k, lambda k: 5.0 - 0.05 * k),
    ],
)
def test_what_says_in_air_and_moves_has_not_stood_still(place, height):
    bench = on_the_ground().hear(PILOT, landed(IN_AIR))
    for armed in (False, True):
        for k in range(40):
            now = height(k + 40 * armed)
            at = d.MAVLink_global_position_int_message(
                0, int(place(k) * 1e7), 85_000_000, int(now * 1000), int(now * 1000), 0, 0, 0, 0
            )
            bench.at(bench.t + 0.1).hear(PILOT, quadplane(armed), at, landed(IN_AIR))
    assert disarms(bench) == []


@pytest.mark.parametrize("blocked_first", [True, False])
@pytest.mark.parametrize("told", [10, 60])
def test_one_that_arms_in_the_air_is_not_disarmed(blocked_first, told):
    """An autopilot that starts anew at 100 m, a glider that starts its motor: IN_AIR all the
    time, and disarmed between two heartbeats, or for longer."""
    bench = Bench().hear(PILOT, quadplane(False), landed(), at_height(0.0))
    climb(bench, quadplane, [10.0 * k for k in range(11)])
    if blocked_first:
        bench.call("flight_block", "the supervisor is lost")
    climb(bench, quadplane, [100.0] * 40)
    for armed in (False, True):
        for _ in range(told):
            bench.at(bench.t + 0.1).hear(PILOT, quadplane(armed), at_height(100.0), landed(IN_AIR))
        bench.call("flight_block", "the supervisor is lost")
    climb(bench, quadplane, [100.0] * 10)
    assert disarms(bench) == []


def test_one_that_is_launched_downhill_has_left_the_ground():
    def fly(*depths):
        for depth in depths:
            alt, relative = int((500.0 - depth) * 1000), int(-depth * 1000)
            at = d.MAVLink_global_position_int_message(0, 0, 0, alt, relative, 0, 0, 0, 0)
            bench.at(bench.t + 0.1).hear(PILOT, at, landed(IN_AIR), quadplane(True))
            if bench.commands(DISARM):
                bench.hear(PILOT, ack(DISARM, d.MAV_RESULT_FAILED))

    bench = Bench(takeoff_height=2.0).hear(PILOT, quadplane(False), landed())
    bench.call("flight_block", "no parachute")
    fly(*(0.1 * step for step in range(11)), 2.0, 3.0, 4.0, 5.0)
    bench.clear()
    fly(6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0)
    assert disarms(bench) == []


def test_a_disarm_without_an_answer_is_followed_by_a_forced_one():
    bench = on_the_ground().at(0.7).hear(PILOT, quadplane(True), at_height(0.1))
    for _ in range(3):
        bench.at(bench.t + 0.1).hear(PILOT, at_height(0.3))
    assert disarms(bench) == [0, 0, FORCE]


def climb(bench, make, heights, every=0.1):
    for height in heights:
        bench.at(bench.t + every).hear(PILOT, at_height(height), landed(IN_AIR), make(True))
        if len(bench.commands(DISARM)):
            bench.hear(PILOT, ack(DISARM, d.MAV_RESULT_FAILED))


def test_above_takeoff_height_nothing_is_disarmed_any_more():
    bench = on_the_ground(takeoff_height=2.0)
    climb(bench, quadplane, [n / 2 for n in range(1, 20)])
    bench.clear()
    climb(bench, quadplane, [10.0] * 50)
    climb(bench, quadplane, [1.0] * 50)
    assert disarms(bench) == [], "down again, but it does not say that it stands"
    bench.at(bench.t + 0.1).hear(PILOT, at_height(0.5), landed())
    assert disarms(bench)[:1] == [0]
    # One height above it is no take off.
    bench = on_the_ground()
    climb(bench, quadplane, [0.1, 5.0, 0.1, 0.2])
    bench.clear()
    climb(bench, quadplane, [0.2] * 20)
    assert FORCE in disarms(bench)
    # Home that is set as it arms is no climb.
    bench = Bench().hear(PILOT, quadplane(), landed(), at_height(30.0))
    bench.call("flight_block", "x").at(0.5).hear(PILOT, at_height(30.0), quadplane(True))
    climb(bench, quadplane, [0.0, 0.0])
    bench.clear()
    climb(bench, quadplane, [n / 2 for n in range(1, 20)])
    bench.clear()
    climb(bench, quadplane, [10.0] * 20)
    assert disarms(bench) == []


@pytest.mark.parametrize(
    "before",
    [
        pytest.param([quadplane(True), at_height(0.0)], id="not seen to arm"),
        pytest.param([quadplane(False), quadplane(True)], id="height not known as it armed"),
    ],
)
def test_nothing_is_forced_where_the_height_since_arming_is_not_known(before):
    bench = Bench().call("flight_block", "x").hear(PILOT, landed(), *before)
    for _ in range(20):
        bench.at(bench.t + 0.1).hear(PILOT, at_height(0.0), landed(), quadplane(True))
        bench.hear(PILOT, ack(DISARM, d.MAV_RESULT_FAILED))
    assert set(disarms(bench)) == {0}


def test_nothing_is_forced_on_a_height_that_no_longer_comes():
    bench = on_the_ground().at(0.7).hear(PILOT, quadplane(True), at_height(0.1)).clear()
    for _ in range(20):
        bench.at(bench.t + 0.2).hear(PILOT, quadplane(True), landed())
        if bench.t > 2.0:
            bench.hear(PILOT, ack(DISARM, d.MAV_RESULT_FAILED))
    forced = [t for t, m in bench.sent if m.get_type() == "COMMAND_LONG" and m.param2 == FORCE]
    assert all(t <= 1.9 for t in forced)


def test_nothing_is_forced_on_a_vehicle_that_was_armed_before_the_block():
    bench = Bench().hear(PILOT, quadplane(), landed(), at_height(0.0)).at(0.5)
    bench.hear(PILOT, quadplane(True), at_height(0.5), landed(IN_AIR))
    bench.call("flight_block", "the supervisor is lost")
    for _ in range(20):
        bench.at(bench.t + 0.1).hear(PILOT, at_height(1.0), landed(IN_AIR), quadplane(True))
        bench.hear(PILOT, ack(DISARM, d.MAV_RESULT_FAILED))
    assert set(disarms(bench)) == {0}


# -- seen sooner ------------------------------------------------------------------------------


def test_an_old_heartbeat_is_asked_for_while_flight_is_blocked():
    bench = on_the_ground(copter).stream(1.9, 0.1, PILOT, lambda: at_height(0.0))
    asked = [m for m in bench.commands(REQUEST) if m.param1 == 0]
    assert 4 <= len(asked) <= 7
    bench.hear(PILOT, ack(REQUEST)).call("flight_block", "").clear().stream(
        2.4, 0.1, PILOT, lambda: at_height(0.0)
    )
    assert bench.commands(REQUEST) == []


@pytest.mark.parametrize(("make", "times"), [(quadplane, 3), (copter, 0)])
def test_a_faster_heartbeat_is_asked_for_but_of_px4(make, times):
    bench = Bench(autopilot_message_rate=10.0).hear(PILOT, make())
    for _ in range(200):
        bench.at(bench.t + 0.5).hear(PILOT, at_height(0.0), make())
    orders = [m for m in bench.commands(INTERVAL) if m.param1 == 0]
    assert [m.param2 for m in orders] == [200_000] * times


# -- asked whether it may arm -----------------------------------------------------------------


def may_it_arm(target=(1, 0)):
    return d.MAVLink_command_long_message(*target, 3001, 0, *[0.0] * 7)


def answers(bench):
    acks = [m for _, m in bench.sent if m.get_type() == "COMMAND_ACK"]
    assert {m.command for m in acks} <= {3001}
    return [
        (m.result, m.progress, m.result_param2, m.target_system, m.target_component) for m in acks
    ]


def test_an_autopilot_that_asks_may_arm_only_while_flight_is_not_blocked():
    bench = Bench().hear(PILOT, copter(), may_it_arm())
    assert answers(bench) == [(d.MAV_RESULT_ACCEPTED, 0, 5, 1, 1)]
    bench.at(0.06)
    assert answers(bench) == [(d.MAV_RESULT_ACCEPTED, 0, 5, 1, 1)] * 2, "again, and no more"
    bench.at(1.0)
    assert len(answers(bench)) == 2
    bench.call("flight_block", "no parachute").clear().hear(PILOT, may_it_arm((1, 191)))
    generic = d.MAV_ARM_AUTH_DENIED_REASON_GENERIC
    assert answers(bench) == [(d.MAV_RESULT_DENIED, generic, 0, 1, 1)]
    assert bench.texts()[-1] == "no parachute: flight blocked, arming denied"
    bench.call("flight_block", "").clear().hear(PILOT, may_it_arm())
    assert answers(bench)[0][0] == d.MAV_RESULT_ACCEPTED


def test_only_our_autopilot_is_answered_and_only_where_we_are_asked():
    bench = Bench().hear(PILOT, copter())
    bench.hear(PILOT, may_it_arm((10, 0)), may_it_arm((1, 42))).hear((1, 190), may_it_arm())
    bench.hear((2, 1), may_it_arm())
    assert answers(bench) == []


def block_warnings(bench):
    return [text for text in bench.link.setup().warnings if "COM_" in text]


def test_a_block_that_cannot_be_kept_is_said_before_flight():
    bench = Bench().hear(PILOT, copter(), setting("COM_SPOOLUP_TIME", 0.0))
    assert block_warnings(bench) == []
    bench.hear(PILOT, setting("MPC_TKO_RAMP_T", 0.0))
    (warning,) = block_warnings(bench)
    assert "COM_SPOOLUP_TIME is 0 and MPC_TKO_RAMP_T is 0" in warning
    assert bench.link.vehicle_state(bench.now).faults == (), "it forbids nothing"
    bench.hear(PILOT, px4_integer("COM_ARM_AUTH_REQ", 1), px4_integer("COM_ARM_AUTH_ID", 1))
    assert block_warnings(bench) == []
    assert bench.link.setup().block == "the autopilot asks us before it arms"


def test_an_autopilot_that_asks_another_is_said():
    bench = Bench().hear(PILOT, copter(), px4_integer("COM_ARM_AUTH_REQ", 1))
    bench.hear(PILOT, px4_integer("COM_ARM_AUTH_ID", 10))
    (warning,) = block_warnings(bench)
    assert "COM_ARM_AUTH_ID is 10, and not our system id 1" in warning


def test_arming_lifts_no_block_that_stands_for_a_doubt():
    """Given autopilots of two systems, so that flight is blocked; one is armed, and the order to
    disarm is lost, or refused."""
    settings = MavlinkSettings(expect_parachute=False)
    runtime = MavlinkRuntime("mavlink_parachute", settings, Any)
    bench = on_the_ground(reason="autopilots of systems 1, 2")
    bench.hear((2, 1), copter())

    def healthy():
        return runtime.summarise(bench.link, bench.now).device_healthy

    assert not healthy()
    bench.at(0.7).hear(PILOT, quadplane(True), at_height(0.1), landed(IN_AIR))
    assert not healthy(), "it is armed, and stands"
    bench.at(1.1).hear(PILOT, quadplane(True), at_height(0.3), landed(IN_AIR))
    assert not healthy()
    # In flight nothing is taken back.
    for height in range(1, 20):
        bench.at(bench.t + 0.1).hear(PILOT, quadplane(True), at_height(height), landed(IN_AIR))
    assert healthy()
