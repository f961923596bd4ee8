"""A sign in doubt counts half where one would decide alone; a doubt belongs to its source."""

import math
from dataclasses import replace
from types import MappingProxyType

import pytest
from story import START, Story, shipped, vehicle

from chute_ros.model import Action, LinkState
from chute_ros.supervisor import readings
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import JUMP_DOUBTED, REJECTION_DOUBTED, Measured, Sample
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits

LOST = {"link_state": LinkState.LOST}


def flying(profile: str = "multirotor") -> Story:
    return Story(shipped(profile)).ready().fly(0.3)


def doubt(story: Story, name: str) -> str:
    value = story.state.measured(name).value
    return readings.doubt(story.state, name, value, START + story.t)


def test_a_tilt_that_jumps_as_its_autopilot_is_lost_does_not_end_the_flight():
    """Given a sensor of the second source that turns by 180 degrees at once, flying well."""
    story = flying().fly(1.0, 0.02, **LOST)
    story.fly(4.0, 0.02, **LOST, tilt=179.0)
    assert story.fired() == []
    assert story.state.stage is Stage.IN_FLIGHT


def test_with_a_second_sign_it_does():
    story = flying().fly(1.0, 0.02, **LOST)
    story.fly(2.0, 0.02, **LOST, tilt=179.0)
    story.fly(3.0, 0.02, **LOST, tilt=179.0, acceleration=3.0)
    assert story.fired()[0] == "KILL"
    assert story.newest(Action.KILL).rule == "autopilot lost and falling"
    reasons = " ".join(story.newest(Action.KILL).reasons)
    assert "tilt_deg 179.00 (above 45; in doubt: it jumped" in reasons


def test_one_that_tips_over_as_bodies_do_is_not_in_doubt():
    """Given the attitude alone, as of an IMU: at 400 degrees a second it turns over."""
    story = flying().fly(1.0, 0.02, **LOST)
    for step in range(1, 60):
        told = {"tilt": min(8.0 * step, 170.0), "vertical_speed": math.nan}
        story.fly(story.t + 0.02, 0.02, **LOST, **told)
    assert story.fired()[0] == "KILL"


def test_what_has_jumped_is_doubted_as_long_as_a_fall_may_last_and_one_not_taken_a_second():
    story = flying().fly(1.0, 0.02)
    story.fly(1.02, 0.02, tilt=179.0)
    assert story.state.measured("tilt_deg").rejected
    story.fly(1.1, 0.02, tilt=179.0)
    jumped = story.state.measured("tilt_deg").jumped_at
    known = story.state.measured("tilt_deg")
    assert known.doubt("tilt_deg", jumped + JUMP_DOUBTED - 0.1) == "it jumped 9.9 s ago"
    assert known.doubt("tilt_deg", jumped + JUMP_DOUBTED) == ""
    # Noise leaves some that could be.
    story = flying().fly(1.0, 0.02)
    story.fly(1.02, 0.02, tilt=179.0).fly(1.04, 0.02, tilt=3.0)
    known = story.state.measured("tilt_deg")
    assert known.rejected == ""
    assert "another was not taken" in known.doubt("tilt_deg", known.measured_at)
    assert known.doubt("tilt_deg", known.doubted_at + REJECTION_DOUBTED) == ""


@pytest.mark.parametrize(("force", "fires"), [(0.0, False), (0.01, True)])
def test_a_force_of_exactly_nothing_is_what_a_broken_sensor_says(force, fires):
    story = flying()
    for _ in range(20):
        told = story.told(**LOST)
        exactly = replace(told, state=replace(told.state, acceleration=force))
        story.at(story.t + 0.05, story.heartbeat(), exactly)
    assert bool(story.fired()) is fires


def test_one_that_is_upside_down_is_no_impossible_one():
    """Pi as a message carries it is a little more than pi."""
    story = flying()
    told = story.told()
    story.at(story.t + 0.5, replace(told, state=replace(told.state, tilt=3.1415927410125732)))
    assert story.state.measured("tilt_deg").rejected == ""


def test_what_another_source_contradicts_is_doubted():
    story = flying()
    told = story.told(tilt=90.0, **LOST)
    for _ in range(20):
        report = replace(told, disputed=frozenset({"attitude"}))
        story.at(story.t + 0.05, story.heartbeat(), report)
    assert story.fired() == []
    assert doubt(story, "tilt_deg") == "another source reported otherwise"
    assert doubt(story, "acceleration") == ""
    story.fly(story.t + 1.0, **LOST, tilt=90.0)
    assert story.fired()[0] == "KILL"


# -- a sink needs the heights, where they are told ------------------------------------------------


@pytest.mark.parametrize(("sinks", "fires"), [(0.0, False), (8.0, True)])
def test_a_speed_that_the_heights_deny_is_no_sink(sinks, fires):
    """Given a vertical speed that drifts, beside heights that stay where they are."""
    story = flying().fly(1.0, **LOST).fly(1.05, **LOST, vertical_speed=-4.0)
    for step in range(60):
        told = {"vertical_speed": -8.0, "height": 50.0 - sinks * step * 0.05}
        story.fly(story.t + 0.05, **LOST, **told)
    assert bool(story.fired()) is fires


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize(("sinks", "fires"), [(0.0, False), (12.0, True)])
def test_beside_a_speed_that_jumped_a_gust_that_lifts_is_no_sign(profile, sinks, fires):
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


def test_a_fall_whose_speed_was_not_told_for_a_second_is_no_jump():
    story = flying().fly(1.0)
    begun = story.t
    story.fly(begun + 1.0, vertical_speed=math.nan, height=math.nan, acceleration=4.5)
    story.fly(begun + 2.0, vertical_speed=-14.0, height=math.nan, acceleration=4.5)
    assert story.newest(Action.KILL).rule == "falls flat"
    assert story.when(Action.KILL) - begun < 1.6


# -- silence that was waited for ------------------------------------------------------------------


@pytest.mark.parametrize(("before", "delay"), [(0.0, 1.0), (0.5, 0.5), (2.0, 0.05)])
def test_signs_are_counted_while_the_silence_is_waited_for(before, delay):
    """Given an aeroplane on its side for so long before its autopilot counts as lost."""
    story = flying("fixed_wing")
    story.fly(story.t + before, tilt=80.0 if before else 0.0)
    assert story.fired() == []
    lost_at = story.t
    story.fly(story.t + 1.5, tilt=80.0, **LOST)
    assert story.when(Action.KILL) - lost_at == pytest.approx(delay, abs=0.051)


@pytest.mark.parametrize(("lasts", "fires"), [(0.7, False), (1.0, True)])
def test_a_gust_that_lifts_beside_a_hung_autopilot_is_no_fall(lasts, fires):
    """Given an IMU alone, and a multirotor of which less than half of the weight is carried."""
    unknown = {"vertical_speed": math.nan, "height": math.nan}
    story = flying().fly(4.0, 0.02, **LOST, **unknown)
    story.fly(story.t + lasts, 0.02, **LOST, **unknown, acceleration=3.5)
    story.fly(story.t + 2.0, 0.02, **LOST, **unknown)
    assert bool(story.fired()) is fires


def test_what_was_counted_leaks_before_the_silence_as_well():
    story = flying("fixed_wing").fly(1.0, tilt=80.0)
    story.fly(3.0).fly(3.5, tilt=80.0, **LOST)
    assert story.fired() == []


def test_a_force_that_is_noise_does_not_keep_what_it_counted():
    """Given an IMU alone, that tells no speed: its noise is below the limit now and then."""
    story = flying().fly(4.5, 0.02, vertical_speed=math.nan, height=math.nan)
    forces = (9.0, 3.5, 12.0, 3.0, 20.0, 9.8, 3.9, 3.1, 15.0, 7.0)
    for step in range(300):
        told = {"acceleration": forces[step % len(forces)] + step * 1e-4}
        story.fly(story.t + 0.02, 0.02, **LOST, **told, vertical_speed=math.nan, height=math.nan)
    assert story.fired() == []


def test_an_accelerometer_that_tells_random_bits_ends_no_flight():
    """Given an IMU alone: of its numbers most are out of range, and the others are nearly 0."""
    unknown = {"vertical_speed": math.nan, "height": math.nan}
    for forces in ((1e30, 0.0), (1e30, 1e30, 1e30, 1e-9, 1e-5), (1e30, 1e-3, 1e-4, 1e-6)):
        story = flying().fly(4.0, 0.02, **LOST, **unknown)
        for step in range(200):
            force = forces[step % len(forces)] * (1.0 + step * 1e-3)
            story.fly(story.t + 0.02, 0.02, **LOST, **unknown, acceleration=force)
        assert story.fired() == []


def test_a_date_that_goes_back_puts_no_value_in_doubt():
    """Given two sources of one truth, of which one is told later: its dates go back and forth."""
    story = flying().fly(1.0)
    for _ in range(10):
        for age in (0.0, 0.3):
            told = vehicle(age, tilt=5.0, acceleration=9.7)
            story.at(story.t + 0.05, story.heartbeat(), told)
            assert doubt(story, "tilt_deg") == ""
    assert math.isnan(story.state.measured("tilt_deg").jumped_at)


def test_who_was_late_has_counted_nothing_while_the_silence_was_its_own():
    """Given a banked vehicle whose supervisor hangs: its first word afterwards is that the
    autopilot is lost, as nobody has read it."""
    story = flying("fixed_wing").fly(3.0, tilt=80.0)
    story._update((story.heartbeat(), story.told(tilt=80.0, **LOST)), 6.0)
    assert "silence meanwhile does not count" in story.said()
    story.at(6.05, story.told(tilt=80.0))
    story.fly(8.0, tilt=80.0)
    assert story.fired() == []


def test_a_supervisor_that_stalls_shortly_goes_on_counting():
    """Given one that stalls again and again as its aeroplane falls."""
    story = flying("fixed_wing").fly(1.0, tilt=80.0, **LOST)
    for _ in range(2):
        story._update((story.heartbeat(), story.told(tilt=80.0, **LOST)), story.t + 0.8)
    assert "silence meanwhile does not count" in story.said()
    story.fly(story.t + 0.3, tilt=80.0, **LOST)
    assert story.fired()[0] == "KILL"


#: A height that may change by 60 m/s and by 10 m besides.
HEIGHT = Limits(-500.0, 500.0, rate=60.0, jump=10.0, max_age=1.0, stuck_after=5.0)


def heights(*samples: tuple[float, float]) -> Measured:
    """What is known after these (m, time of measurement)."""
    known = Measured()
    for value, at in samples:
        known = known.with_sample(Sample(value, at), HEIGHT)
    return known


JUMPED = heights((100.0, 0.0), (60.0, 0.1), (60.1, 0.15), (60.2, 0.2))


def told_by_another(*samples: tuple[float, float]) -> Measured:
    """After the jump another source tells these."""
    known = JUMPED.told_by("odometry")
    for value, at in samples:
        known = known.with_sample(Sample(value, at), HEIGHT)
    return known


# -- doubt belongs to a source --------------------------------------------------------------------


def test_what_one_source_put_in_doubt_says_nothing_of_another_and_counts_when_it_is_back():
    assert JUMPED.has_jumped(0.3)
    assert JUMPED.told_by("") is JUMPED
    other = JUMPED.told_by("imu")
    assert (other.source, other.value, other.count) == ("imu", 60.2, 2)
    assert math.isnan(other.doubted_at)
    assert math.isnan(other.jumped_at)
    assert other.doubt("height", 0.3) == ""
    on = other.with_sample(Sample(60.3, 0.3), HEIGHT)
    assert on.source == "imu"
    back = on.told_by("")
    assert (back.jumped_at, back.before_jump, back.doubted_at) == (0.2, 100.0, 0.15)
    assert back.doubt("height", 0.3) == "it jumped 0.1 s ago"
    assert back.told_by("imu").doubt("height", 0.3) == ""
    third = back.told_by("odometry")
    assert third.doubt("height", 0.3) == ""
    assert {one.source for one in third.others} == {"", "imu"}


@pytest.mark.parametrize(
    ("samples", "jumped_at", "before_jump"),
    [
        # Who tells what was told before a jump has not jumped; who tells something else has.
        ([(99.7, 0.3), (99.65, 0.35), (99.6, 0.4)], math.nan, math.nan),
        ([(119.7, 0.3), (119.65, 0.35), (119.6, 0.4)], 0.4, 60.2),
        # What another told before its jump counts for the change alone.
        ([(61.0, 0.3), (99.6, 0.4), (99.55, 0.45), (99.5, 0.5)], 0.5, 61.0),
    ],
)
def test_another_source_has_jumped_from_what_was_told_last_but_not_back(
    samples, jumped_at, before_jump
):
    known = told_by_another(*samples)
    assert known.value == samples[-1][0]
    told = (known.jumped_at, known.before_jump)
    assert told == pytest.approx((jumped_at, before_jump), nan_ok=True)
    assert known.has_jumped(samples[-1][1]) is not math.isnan(jumped_at)


def test_a_jump_from_one_source_to_the_other_is_the_others():
    other = heights((100.0, 0.0)).told_by("imu")
    for at in (0.1, 0.15, 0.2):
        other = other.with_sample(Sample(60.0 - at, at), HEIGHT)
    assert other.has_jumped(0.3)
    assert not other.told_by("").has_jumped(0.3)


@pytest.mark.parametrize(
    ("part", "name"),
    [
        ("attitude", "tilt_deg"),
        ("vertical_speed", "vertical_speed"),
        ("acceleration", "acceleration"),
        ("height", "height"),
    ],
)
def test_a_report_names_who_tells_a_part(part, name):
    story = Story(shipped("multirotor")).ready().fly(0.3)
    assert story.state.measured(name).source == ""
    told = replace(story.told(), told_by=MappingProxyType({part: "imu"}))
    story.at(story.t + 0.05, story.heartbeat(), told)
    sources = {one: story.state.measured(one).source for one in STANDARD_LIMITS}
    assert sources == {one: "imu" if one == name else "" for one in STANDARD_LIMITS}


# -- a speed that lies denies no height -----------------------------------------------------------


def told_beside_a_lie(
    profile: str, speed: float, every: float, gap: float = 0.0, falls: bool = False
) -> Story:
    """Heights that are true, and a speed that has jumped so long ago that nothing doubts it any
    more; then a gap, and a vehicle that leans over and sinks with a part of its thrust."""
    story = Story(shipped(profile)).ready().fly(3.0, every, height=150.0)
    story.fly(15.0, every, height=150.0, vertical_speed=speed)
    for _ in range(round(gap / every)):
        story.at(story.t + every, story.heartbeat())
    height, sinking = 150.0, 0.0
    for step in range(round(4.0 / every)):
        told = {"height": height, "vertical_speed": speed}
        if falls:
            sinking = min(sinking + 4.0 * every, 18.0)
            height -= sinking * every
            told |= {"tilt": min(5.0 + 75.0 * step * every, 80.0), "acceleration": 6.0}
        story.at(story.t + every, story.heartbeat(), story.told(**told))
    return story


LIES = [
    ("multirotor", 140.0, 0.1, 0.0),
    ("multirotor", 90.0, 0.2, 0.0),
    ("multirotor", 50.0, 0.1, 0.9),
    ("multirotor", 29.0, 0.1, 0.9),
    ("fixed_wing", 110.0, 0.2, 0.0),
]


@pytest.mark.parametrize(("profile", "speed", "every", "gap"), LIES)
def test_by_a_speed_that_lies_downwards_one_that_flies_well_is_not_ended(
    profile, speed, every, gap
):
    """Its heights alone deny the sink: were they not believed, nothing would."""
    story = told_beside_a_lie(profile, -speed, every, gap)
    assert story.state.measured("vertical_speed").value == pytest.approx(-speed, abs=0.1)
    assert story.fired() == []
    assert story.state.measured("height").rejected == ""


@pytest.mark.parametrize(("profile", "speed", "every", "gap"), LIES)
def test_by_a_speed_that_lies_upwards_a_fall_is_not_hidden(profile, speed, every, gap):
    story = told_beside_a_lie(profile, speed, every, gap, falls=True)
    assert story.fired()[:1] == ["KILL"]
    assert story.newest(Action.KILL).rule == "excess tilt"


# -- who tells nothing ----------------------------------------------------------------------------


def test_a_doubt_stands_while_nobody_tells_the_part():
    """Given an IMU whose tilt has jumped, of which three of four words cannot be read: the part is
    told by nobody then, and its last value is still young."""
    story = Story(shipped("multirotor")).ready().fly(1.0)
    gone = {"attitude_age": math.nan, "tilt": math.nan}
    for step in range(150):
        tilt = 0.0 if step < 25 else 143.0
        told = story.told(tilt=tilt, **LOST, vertical_speed=math.nan, height=math.nan)
        if step > 30 and step % 4:
            told = replace(told, state=replace(told.state, **gone))
        else:
            told = replace(told, told_by=MappingProxyType({"attitude": "imu"}))
        story.at(story.t + 0.02, story.heartbeat(), told)
    assert story.state.measured("tilt_deg").source == "imu"
    assert "it jumped" in story.state.measured("tilt_deg").doubt("tilt_deg", START + story.t)
    assert story.fired() == []
