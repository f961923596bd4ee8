"""A flight computer that restarts, fails or says nonsense in flight: it is still in the air."""

import math

import pytest
from umbilical_rocket import (
    ASCENT,
    COAST,
    DROGUE,
    FAULT,
    MAIN,
    STANDBY,
    STARTUP,
    Rocket,
    flown,
    status,
    vehicle,
)

from chute_ros.links.umbilical.protocol.gate import Situation
from chute_ros.links.umbilical.protocol.modes import FlightMode
from chute_ros.model import LandedState, ParachuteState
from chute_ros.protocol.boot_clock import Age


def test_a_restart_is_believed_at_the_second_record_that_shows_it():
    rocket = Rocket()
    rocket.says(0.0, STANDBY, altitude="1")
    rocket.says(0.1, STANDBY, altitude="1")
    rocket.restarts(1.0)
    assert rocket.says(1.0, STARTUP, altitude="2") == ([], Age.DOUBTFUL)
    assert rocket.computer.mode is FlightMode.STANDBY
    assert rocket.says(1.1, STARTUP, altitude="3") == ([], Age.RESTARTED)
    seen = vehicle(rocket, 1.1)
    assert (seen.reboot_count, seen.rebooted_in_flight) == (1, False)
    assert (seen.uptime, seen.height) == (0.6, 0.0)
    assert status(rocket, 1.1).state is ParachuteState.READY


@pytest.mark.parametrize("mode", [ASCENT, COAST, DROGUE, MAIN])
def test_a_restart_in_flight_is_told_until_the_next_one_on_the_ground(mode):
    rocket = flown((0.0, mode))
    restarts(rocket, 1.0)
    assert vehicle(rocket, 1.1).rebooted_in_flight
    assert status(rocket, 1.1).state is ParachuteState.ABNORMAL
    assert status(rocket, 1.1).faults == ("it restarted in flight",)
    rocket.says(60.0, STARTUP)
    restarts(rocket, 70.0)
    assert (rocket.computer.restarts, rocket.computer.restarted_in_flight) == (2, False)


def restarts(rocket, at):
    """It says Startup twice, by a new clock."""
    rocket.restarts(at)
    rocket.says(at, STARTUP)
    rocket.says(at + 0.1, STARTUP)


def test_a_restart_in_flight_is_one_after_a_long_silence_too_but_not_after_the_landing():
    rocket = Rocket()
    restarts(rocket, rocket.descends(0.0, 10.0) + 30.0)
    assert rocket.computer.restarted_in_flight
    rocket = Rocket()
    restarts(rocket, rocket.descends(0.0, 6.0, MAIN, 10.0, 0.0) + 1.0)
    assert (rocket.computer.restarts, rocket.computer.restarted_in_flight) == (1, False)


def test_a_record_that_is_older_than_the_one_before_changes_nothing():
    rocket = flown((0.0, ASCENT, {"altitude": "100"}))
    old = {"ms_since_boot_cfc": "99900", "altitude": "90"}
    assert rocket.says(0.1, STANDBY, **old) == ([], Age.OLD)
    assert (rocket.computer.mode, rocket.computer.records) == (FlightMode.ASCENT, 1)
    assert vehicle(rocket, 0.1).height == 100.0
    assert not rocket.computer.fresh(3.0)
    # Nor is a clock that wraps a restart.
    rocket = flown((0.0, STANDBY, {"ms_since_boot_cfc": "4294967295"}))
    assert rocket.says(0.1, STANDBY, ms_since_boot_cfc="50") == ([], Age.NEW)
    assert rocket.computer.restarts == 0


def restarted_in_flight():
    """In Startup again, in the middle of its flight; the time."""
    rocket = Rocket()
    rocket.says(0.0, ASCENT, altitude="800")
    rocket.restarts(1.0)
    rocket.says(1.0, STARTUP, altitude="900")
    rocket.says(1.1, STARTUP, altitude="910")
    return rocket, 1.1


@pytest.mark.parametrize("mode", [STARTUP, STANDBY, FAULT, 9])
def test_after_a_restart_in_flight_no_mode_means_ground(mode):
    rocket, now = restarted_in_flight()
    rocket.descends(now, 4.0, mode=mode, height=900.0)
    now += 4.0
    assert rocket.computer.situation(now) is Situation.LOST_IN_FLIGHT
    assert vehicle(rocket, now).landed_state is LandedState.IN_AIR
    assert "it restarted in flight" in status(rocket, now).faults
    assert status(rocket, now).state is ParachuteState.ABNORMAL


def test_it_is_on_the_ground_again_once_its_altitude_stays():
    rocket, now = restarted_in_flight()
    rocket.descends(now, 10.0, mode=STARTUP, height=300.0, speed=30.0)
    rocket.descends(now + 10.0, 5.0, mode=STARTUP, height=0.0, speed=0.0)
    now += 15.0
    assert rocket.computer.situation(now) is Situation.STARTUP
    assert vehicle(rocket, now).landed_state is LandedState.ON_GROUND
    assert vehicle(rocket, now).rebooted_in_flight, "which stays known"
    assert status(rocket, now).faults == ()


def test_a_restart_stays_known_after_a_landing_under_a_canopy():
    """Given a flight computer that goes on in its mode of the flight, and lands in it."""
    rocket, now = restarted_in_flight()
    now = rocket.descends(now + 1.0, 6.0, MAIN, 10.0)
    now = rocket.descends(now, 6.0, MAIN, 0.0, 0.0)
    assert rocket.computer.landed
    assert vehicle(rocket, now).rebooted_in_flight


def test_the_next_flight_knows_nothing_of_a_restart_in_the_one_before():
    """A flight computer that is not switched off between two flights."""
    rocket, now = restarted_in_flight()
    rocket.descends(now, 10.0, mode=STARTUP, height=300.0, speed=30.0)
    rocket.descends(now + 10.0, 5.0, mode=STARTUP, height=0.0, speed=0.0)
    rocket.says(now + 60.0, STANDBY, altitude="0")
    rocket.says(now + 61.0, ASCENT, altitude="200")
    rocket.says(now + 61.1, ASCENT, altitude="215")
    assert rocket.computer.flying
    assert status(rocket, now + 61.1).faults == ()
    assert not vehicle(rocket, now + 61.1).rebooted_in_flight


def test_a_clock_that_starts_at_zero_is_a_restart_as_well():
    rocket = flown((0.0, ASCENT))
    for at, clock in ((1.0, 0), (1.07, 70), (1.17, 170)):
        rocket.says(at, STARTUP, ms_since_boot_cfc=str(clock), altitude=f"{900 + 100 * at}")
    assert rocket.computer.restarted_in_flight
    assert rocket.computer.situation(1.17) is Situation.LOST_IN_FLIGHT


def test_a_mode_without_a_name_does_not_make_it_forget_the_flight():
    rocket = flown((0.0, COAST, {"altitude": "2000"}), (0.1, 9, {"altitude": "2010"}))
    assert rocket.computer.situation(0.1) is Situation.LOST_IN_FLIGHT
    rocket.says(0.2, FAULT, altitude="2020")
    assert rocket.computer.situation(0.2) is Situation.LOST_IN_FLIGHT


def test_a_fault_at_rest_is_none_in_flight():
    """On the pad after a launch that did not lift, or where it fell to the ground."""
    rocket = Rocket()
    rocket.descends(0.0, 6.0, mode=ASCENT, height=0.0, speed=0.0)
    rocket.says(6.1, FAULT, altitude="0")
    assert rocket.computer.situation(6.1) is Situation.FAULT
    rocket = flown((0.0, COAST, {"altitude": "2000"}))
    rocket.descends(0.1, 5.0, mode=FAULT, height=500.0, speed=100.0)
    assert rocket.computer.situation(5.1) is Situation.LOST_IN_FLIGHT
    rocket.descends(5.2, 5.0, mode=FAULT, height=0.0, speed=0.0)
    assert rocket.computer.situation(10.2) is Situation.FAULT


def test_rest_before_the_deployment_or_the_ignition_or_of_a_stuck_barometer_is_no_landing():
    rocket = Rocket()
    rocket.descends(0.0, 20.0, mode=COAST, height=2000.0, speed=0.0)
    rocket.descends(20.1, 1.0, mode=DROGUE, height=2000.0, speed=0.0)
    assert vehicle(rocket, 21.1).landed_state is LandedState.IN_AIR
    # Given 10 s at rest on the pad, when it fails in the climb, then it is in the air.
    rocket = Rocket()
    rocket.descends(0.0, 10.0, mode=STANDBY, height=0.0, speed=0.0)
    rocket.says(10.1, ASCENT, altitude="0.5")
    rocket.says(10.2, FAULT, altitude="2")
    assert rocket.computer.situation(10.2) is Situation.LOST_IN_FLIGHT
    assert vehicle(rocket, 10.2).landed_state is LandedState.IN_AIR
    stuck = {"altitude": "1500", "vel_d": "28"}
    rocket = flown(*((step / 10, DROGUE, stuck) for step in range(200)))
    assert vehicle(rocket, 20.0).landed_state is LandedState.IN_AIR


def test_what_was_in_the_air_a_moment_ago_may_still_be_deployed():
    rocket = flown((0.0, COAST, {"altitude": "2000"}))
    assert rocket.computer.situation(3.2) is Situation.LOST_IN_FLIGHT
    rocket.computer.update(3.2)
    rocket.computer.update(16.0)
    assert rocket.computer.situation(16.0) is Situation.UNKNOWN, "but not for ever"


def test_a_record_of_before_the_cable_was_pulled_is_not_fresh():
    rocket = flown((0.0, STANDBY))
    rocket.computer.cable_pulled()
    assert rocket.computer.situation(0.5) is Situation.UNKNOWN
    rocket.says(0.6, STANDBY)
    assert rocket.computer.situation(0.6) is Situation.STANDBY


def test_an_altitude_that_counts_on_beside_a_pressure_that_stands_is_none():
    """Given a barometer that is lost under way: each turn takes the site's altitude once more."""
    rocket = Rocket()
    rocket.descends(0.0, 2.0, mode=STANDBY, height=0.0, speed=0.0)
    rocket.descends(2.1, 5.0, mode=ASCENT, height=0.0, speed=-150.0)
    lost = {"pressure": "92000.5", "fix_type": "0"}
    for step in range(10):
        rocket.says(7.2 + step / 10, FAULT, altitude=str(750.0 - 10.0 * step), **lost)
    assert math.isnan(vehicle(rocket, 8.1).height)
    rocket.says(8.2, FAULT, altitude="900", pressure="91000", fix_type="0")
    assert vehicle(rocket, 8.2).height == pytest.approx(900.0, abs=1.0), "it is back"


RESTING = {"accel_x": "0.1", "accel_y": "0.2", "accel_z": "9.8"}


def stands(rocket, start, seconds, mode, **texts):
    """With the noise of a barometer; the time of its last record."""
    at = start
    for step in range(round(seconds * 10) + 1):
        at = start + step / 10
        rocket.says(at, mode, altitude=f"{0.3 * (step % 3):.3f}", **{**RESTING, **texts})
    return at


@pytest.mark.parametrize("mode", [ASCENT, COAST])
def test_a_launch_that_did_not_leave_the_pad_is_no_flight_and_is_told(mode):
    rocket = Rocket()
    stands(rocket, 0.0, 3.0, STANDBY)
    now = stands(rocket, 3.1, 9.0, mode)
    assert vehicle(rocket, now).landed_state is LandedState.IN_AIR, "the motor may burn late"
    now = stands(rocket, now + 0.1, 3.0, mode)
    assert vehicle(rocket, now).landed_state is LandedState.ON_GROUND
    told = status(rocket, now)
    assert told.state is ParachuteState.ABNORMAL
    assert "while it stands" in " ".join(told.faults)
    # When it burns after all, then it flies.
    rocket.descends(now + 0.1, 1.0, mode=mode, height=5.0, speed=-50.0)
    assert vehicle(rocket, now + 1.1).landed_state is LandedState.IN_AIR
    assert status(rocket, now + 1.1).faults == ()


@pytest.mark.parametrize("speed", [lambda step: 22.0, lambda step: (-1.4, 0.2, 1.3)[step % 3]])
def test_satellites_that_froze_or_wander_hide_no_landing(speed):
    rocket = Rocket()
    rocket.descends(0.0, 3.0, mode=ASCENT, height=0.0, speed=-100.0)
    rocket.descends(3.1, 5.0, height=60.0, speed=12.0)
    for step in range(90):
        height = f"{0.3 * (step % 3):.3f}"
        texts = {**RESTING, "vel_d": str(speed(step // 10)), "ssa_drogue_deployed": "1"}
        rocket.says(8.2 + step / 10, DROGUE, altitude=height, **texts)
    assert vehicle(rocket, 17.1).landed_state is LandedState.ON_GROUND
