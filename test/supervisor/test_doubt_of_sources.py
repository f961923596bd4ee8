"""What is doubted of a measurement: by its vertical speed, by which of several sources told it."""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

import pytest
from story import START, Story, shipped

from chute_ros.model import Action, LinkState
from chute_ros.supervisor.measured import Measured, Sample
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits

LOST = {"link_state": LinkState.LOST}
#: A height that may change by 60 m/s and by 10 m besides.
HEIGHT = Limits(-500.0, 500.0, rate=60.0, jump=10.0, max_age=1.0, stuck_after=5.0)


def heights(*samples: tuple[float, float]) -> Measured:
    """What is known after these (m, time of measurement)."""
    known = Measured()
    for value, at in samples:
        known = known.with_sample(Sample(value, at), HEIGHT)
    return known


# -- doubt belongs to a source --------------------------------------------------------------------


def test_what_one_source_put_in_doubt_says_nothing_of_another_and_counts_when_it_is_back() -> None:
    jumped = heights((100.0, 0.0), (60.0, 0.1), (60.1, 0.15), (60.2, 0.2))
    assert jumped.has_jumped(0.3)
    assert jumped.told_by("") is jumped
    other = jumped.told_by("imu")
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


def test_a_jump_from_one_source_to_the_other_is_the_others() -> None:
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
def test_a_report_names_who_tells_a_part(part: str, name: str) -> None:
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
    profile: str, speed: float, every: float, gap: float
) -> None:
    """Its heights alone deny the sink: were they not believed, nothing would."""
    story = told_beside_a_lie(profile, -speed, every, gap)
    assert story.state.measured("vertical_speed").value == pytest.approx(-speed, abs=0.1)
    assert story.fired() == []
    assert story.state.measured("height").rejected == ""


@pytest.mark.parametrize(("profile", "speed", "every", "gap"), LIES)
def test_by_a_speed_that_lies_upwards_a_fall_is_not_hidden(
    profile: str, speed: float, every: float, gap: float
) -> None:
    story = told_beside_a_lie(profile, speed, every, gap, falls=True)
    assert story.fired()[:1] == ["KILL"]
    assert story.newest(Action.KILL).rule == "excess tilt"


# -- who tells nothing ----------------------------------------------------------------------------


def test_a_doubt_stands_while_nobody_tells_the_part() -> None:
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


def test_who_tells_what_was_told_before_a_jump_has_not_jumped() -> None:
    """Given a height that jumped, and another source that tells what it told before."""
    jumped = heights((100.0, 0.0), (60.0, 0.1), (60.1, 0.15), (60.2, 0.2))
    other = jumped.told_by("odometry")
    for at in (0.3, 0.35, 0.4):
        other = other.with_sample(Sample(100.0 - at, at), HEIGHT)
    assert other.value == 99.6
    assert not other.has_jumped(0.4)
    assert math.isnan(other.before_jump)
    further = jumped.told_by("odometry")
    for at in (0.3, 0.35, 0.4):
        further = further.with_sample(Sample(120.0 - at, at), HEIGHT)
    assert (further.jumped_at, further.before_jump) == (0.4, 60.2)


def test_what_another_told_before_its_jump_counts_for_the_change_alone() -> None:
    jumped = heights((100.0, 0.0), (60.0, 0.1), (60.1, 0.15), (60.2, 0.2))
    other = jumped.told_by("odometry").with_sample(Sample(61.0, 0.3), HEIGHT)
    for at in (0.4, 0.45, 0.5):
        other = other.with_sample(Sample(100.0 - at, at), HEIGHT)
    assert (other.jumped_at, other.before_jump) == (0.5, 61.0)
