"""A sign in doubt counts half where one would decide alone."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from story import START, Story, shipped, vehicle

from chute_ros.model import Action, LinkState, VehicleState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor import readings
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import JUMP_DOUBTED, REJECTION_DOUBTED

LOST = {"link_state": LinkState.LOST}


def flying(profile: str = "multirotor") -> Story:
    return Story(shipped(profile)).ready().fly(0.3)


def doubt(story: Story, name: str) -> str:
    value = story.state.measured(name).value
    return readings.doubt(story.state, name, value, START + story.t)


def test_a_tilt_that_jumps_as_its_autopilot_is_lost_does_not_end_the_flight() -> None:
    """Given a sensor of the second source that turns by 180 degrees at once, flying well."""
    story = flying().fly(1.0, 0.02, **LOST)
    story.fly(4.0, 0.02, **LOST, tilt=179.0)
    assert story.fired() == []
    assert story.state.stage is Stage.IN_FLIGHT


def test_with_a_second_sign_it_does() -> None:
    story = flying().fly(1.0, 0.02, **LOST)
    story.fly(2.0, 0.02, **LOST, tilt=179.0)
    story.fly(3.0, 0.02, **LOST, tilt=179.0, acceleration=3.0)
    assert story.fired()[0] == "KILL"
    assert story.newest(Action.KILL).rule == "autopilot lost and falling"
    reasons = " ".join(story.newest(Action.KILL).reasons)
    assert "tilt_deg 179.00 (above 45; in doubt: it jumped" in reasons


def test_one_that_tips_over_as_bodies_do_is_not_in_doubt() -> None:
    """Given the attitude alone, as of an IMU: at 400 degrees a second it turns over."""
    story = flying().fly(1.0, 0.02, **LOST)
    for step in range(1, 60):
        told = {"tilt": min(8.0 * step, 170.0), "vertical_speed": math.nan}
        story.fly(story.t + 0.02, 0.02, **LOST, **told)
    assert story.fired()[0] == "KILL"


def test_what_has_jumped_is_doubted_as_long_as_a_fall_may_last() -> None:
    story = flying().fly(1.0, 0.02)
    story.fly(1.02, 0.02, tilt=179.0)
    assert story.state.measured("tilt_deg").rejected
    story.fly(1.1, 0.02, tilt=179.0)
    jumped = story.state.measured("tilt_deg").jumped_at
    known = story.state.measured("tilt_deg")
    assert known.doubt("tilt_deg", jumped + JUMP_DOUBTED - 0.1) == "it jumped 9.9 s ago"
    assert known.doubt("tilt_deg", jumped + JUMP_DOUBTED) == ""


def test_after_one_that_was_not_taken_it_is_doubted_for_a_second() -> None:
    """Noise leaves some that could be."""
    story = flying().fly(1.0, 0.02)
    story.fly(1.02, 0.02, tilt=179.0)
    story.fly(1.04, 0.02, tilt=3.0)
    known = story.state.measured("tilt_deg")
    assert known.rejected == ""
    assert "another was not taken" in known.doubt("tilt_deg", known.measured_at)
    assert known.doubt("tilt_deg", known.doubted_at + REJECTION_DOUBTED) == ""


@pytest.mark.parametrize(("force", "fires"), [(0.0, False), (0.01, True)])
def test_a_force_of_exactly_nothing_is_what_a_broken_sensor_says(
    force: float, fires: bool
) -> None:
    story = flying()
    for _ in range(20):
        told = story.told(**LOST)
        exactly = replace(told, state=replace(told.state, acceleration=force))
        story.at(story.t + 0.05, story.heartbeat(), exactly)
    assert bool(story.fired()) is fires


def test_one_that_is_upside_down_is_no_impossible_one() -> None:
    """Pi as a message carries it is a little more than pi."""
    story = flying()
    told = story.told()
    story.at(story.t + 0.5, replace(told, state=replace(told.state, tilt=3.1415927410125732)))
    assert story.state.measured("tilt_deg").rejected == ""


def test_what_another_source_contradicts_is_doubted() -> None:
    story = flying()
    told = story.told(tilt=90.0, **LOST)
    for _ in range(20):
        report = replace(told, disputed=frozenset({"attitude"}))
        story.at(story.t + 0.05, story.heartbeat(), report)
    assert story.fired() == []
    assert doubt(story, "tilt_deg") == "another source told otherwise"
    assert doubt(story, "acceleration") == ""
    story.fly(story.t + 1.0, **LOST, tilt=90.0)
    assert story.fired()[0] == "KILL"


def test_a_report_says_nothing_of_disputes_unless_told() -> None:
    assert i.VehicleReport(VehicleState()).disputed == frozenset()


# -- a sink needs the heights, where they are told ------------------------------------------------


@pytest.mark.parametrize(("sinks", "fires"), [(0.0, False), (8.0, True)])
def test_a_speed_that_the_heights_deny_is_no_sink(sinks: float, fires: bool) -> None:
    """Given a vertical speed that drifts, beside heights that stay where they are."""
    story = flying().fly(1.0, **LOST).fly(1.05, **LOST, vertical_speed=-4.0)
    for step in range(60):
        told = {"vertical_speed": -8.0, "height": 50.0 - sinks * step * 0.05}
        story.fly(story.t + 0.05, **LOST, **told)
    assert bool(story.fired()) is fires


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize(("sinks", "fires"), [(0.0, False), (12.0, True)])
def test_beside_a_speed_that_jumped_a_gust_that_lifts_is_no_sign(
    profile: str, sinks: float, fires: bool
) -> None:
    """Given a speed that is suddenly 16 m/s too low, and a force of less than half its weight."""
    story = flying(profile)
    begun = story.t
    for step in range(60):
        height = 50.0 - sinks * step * 0.05
        told = {"vertical_speed": -16.0, "acceleration": 4.0, "height": height}
        story.fly(story.t + 0.05, **told)
    assert "it jumped" in doubt(story, "vertical_speed")
    assert bool(story.fired()) is fires
    if fires:
        assert story.when(Action.KILL) - begun < 2.5


def test_a_fall_whose_speed_was_not_told_for_a_second_is_no_jump() -> None:
    story = flying().fly(1.0)
    begun = story.t
    story.fly(begun + 1.0, vertical_speed=math.nan, height=math.nan, acceleration=4.5)
    story.fly(begun + 2.0, vertical_speed=-14.0, height=math.nan, acceleration=4.5)
    assert story.newest(Action.KILL).rule == "critical sink"
    assert story.when(Action.KILL) - begun < 1.6


# -- silence that was waited for ------------------------------------------------------------------


@pytest.mark.parametrize(("before", "delay"), [(0.0, 1.0), (0.5, 0.5), (2.0, 0.05)])
def test_signs_are_counted_while_the_silence_is_waited_for(before: float, delay: float) -> None:
    """Given an aeroplane on its side for so long before its autopilot counts as lost."""
    story = flying("fixed_wing")
    story.fly(story.t + before, tilt=80.0 if before else 0.0)
    assert story.fired() == []
    lost_at = story.t
    story.fly(story.t + 1.5, tilt=80.0, **LOST)
    assert story.when(Action.KILL) - lost_at == pytest.approx(delay, abs=0.051)


@pytest.mark.parametrize(("lasts", "fires"), [(0.7, False), (1.0, True)])
def test_a_gust_that_lifts_beside_a_hung_autopilot_is_no_fall(lasts: float, fires: bool) -> None:
    """Given an IMU alone, and a multirotor of which less than half of the weight is carried."""
    unknown = {"vertical_speed": math.nan, "height": math.nan}
    story = flying().fly(4.0, 0.02, **LOST, **unknown)
    story.fly(story.t + lasts, 0.02, **LOST, **unknown, acceleration=3.5)
    story.fly(story.t + 2.0, 0.02, **LOST, **unknown)
    assert bool(story.fired()) is fires


def test_what_was_counted_leaks_before_the_silence_as_well() -> None:
    story = flying("fixed_wing").fly(1.0, tilt=80.0)
    story.fly(3.0).fly(3.5, tilt=80.0, **LOST)
    assert story.fired() == []


def test_a_force_that_is_noise_does_not_keep_what_it_counted() -> None:
    """Given an IMU alone, that tells no speed: its noise is below the limit now and then."""
    story = flying().fly(4.5, 0.02, vertical_speed=math.nan, height=math.nan)
    forces = (9.0, 3.5, 12.0, 3.0, 20.0, 9.8, 3.9, 3.1, 15.0, 7.0)
    for step in range(300):
        told = {"acceleration": forces[step % len(forces)] + step * 1e-4}
        story.fly(story.t + 0.02, 0.02, **LOST, **told, vertical_speed=math.nan, height=math.nan)
    assert story.fired() == []


def test_an_accelerometer_that_tells_random_bits_ends_no_flight() -> None:
    """Given an IMU alone: of its numbers most are out of range, and the others are nearly 0."""
    unknown = {"vertical_speed": math.nan, "height": math.nan}
    for forces in ((1e30, 0.0), (1e30, 1e30, 1e30, 1e-9, 1e-5), (1e30, 1e-3, 1e-4, 1e-6)):
        story = flying().fly(4.0, 0.02, **LOST, **unknown)
        for step in range(200):
            force = forces[step % len(forces)] * (1.0 + step * 1e-3)
            story.fly(story.t + 0.02, 0.02, **LOST, **unknown, acceleration=force)
        assert story.fired() == []


def test_a_date_that_goes_back_puts_no_value_in_doubt() -> None:
    """Given two sources of one truth, of which one is told later: its dates go back and forth."""
    story = flying().fly(1.0)
    for _ in range(10):
        for age in (0.0, 0.3):
            told = vehicle(age, tilt=5.0, acceleration=9.7)
            story.at(story.t + 0.05, story.heartbeat(), told)
            assert doubt(story, "tilt_deg") == ""
    assert math.isnan(story.state.measured("tilt_deg").jumped_at)


def test_who_was_late_has_counted_nothing_while_the_silence_was_its_own() -> None:
    """Given a banked vehicle whose supervisor hangs: its first word afterwards is that the
    autopilot is lost, as nobody has read it."""
    story = flying("fixed_wing").fly(3.0, tilt=80.0)
    story._update((story.heartbeat(), story.told(tilt=80.0, **LOST)), 6.0)
    assert "silence meanwhile does not count" in story.said()
    story.at(6.05, story.told(tilt=80.0))
    story.fly(8.0, tilt=80.0)
    assert story.fired() == []


def test_a_supervisor_that_stalls_shortly_goes_on_counting() -> None:
    """Given one that stalls again and again as its aeroplane falls."""
    story = flying("fixed_wing").fly(1.0, tilt=80.0, **LOST)
    for _ in range(2):
        story._update((story.heartbeat(), story.told(tilt=80.0, **LOST)), story.t + 0.8)
    assert "silence meanwhile does not count" in story.said()
    story.fly(story.t + 0.3, tilt=80.0, **LOST)
    assert story.fired()[0] == "KILL"
