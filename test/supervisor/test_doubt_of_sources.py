"""What is doubted of a measurement: by its vertical speed, by which of several sources told it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import pytest
from story import Story, shipped

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits, Measured, Sample

#: A height that may change by 60 m/s and by 10 m besides.
HEIGHT = Limits(-500.0, 500.0, rate=60.0, jump=10.0, max_age=1.0, stuck_after=5.0)


def heights(*samples: tuple[float, float]) -> Measured:
    """What is known after these (m, time of measurement)."""
    known = Measured()
    for value, at in samples:
        known = known.with_sample(Sample(value, at), HEIGHT)
    return known


# -- a height beside a vertical speed -------------------------------------------------------------


@pytest.mark.parametrize(
    ("step", "speed", "taken"),
    [
        # Without a speed: 10 m and 60 m/s for 0.4 s.
        (-33.9, math.nan, True),
        (-34.1, math.nan, False),
        # Beside one: 10 m and 30 m/s for 0.4 s about what it flew.
        (-21.9, 0.0, True),
        (-22.1, 0.0, False),
        (22.1, 0.0, False),
        (-25.9, -10.0, True),
        (-26.1, -10.0, False),
        (17.9, -10.0, True),
        (18.1, -10.0, False),
        # And never more than without.
        (-34.1, -29.9, False),
        # A speed of more than half the rate denies nothing.
        (-0.1, 29.9, True),
        (0.0, -30.1, True),
        (33.9, -30.1, True),
        (22.1, -30.0, False),
    ],
)
def test_a_height_changes_as_the_vertical_speed_tells(
    step: float, speed: float, taken: bool
) -> None:
    known = heights((100.0, 0.0)).with_sample(Sample(100.0 + step, 0.4), HEIGHT, speed)
    assert (known.rejected == "") is taken
    assert known.doubted_at == pytest.approx(math.nan if taken else 0.4, nan_ok=True)


def test_three_heights_that_agree_are_believed_whatever_the_speed_tells() -> None:
    known = heights((100.0, 0.0))
    for at in (0.3, 0.35, 0.4):
        known = known.with_sample(Sample(75.0 - at, at), HEIGHT, 0.0)
    assert (known.value, known.jumped_at, known.before_jump) == (74.6, 0.4, 100.0)


def test_so_are_those_that_time_makes_possible_and_are_remembered_as_a_jump() -> None:
    """Given a height that the speed denies for 0.4 s after the gap and not for 0.6 s."""
    known = heights((100.0, 0.0))
    for at in (0.4, 0.6):
        known = known.with_sample(Sample(75.0 - at, at), HEIGHT, 0.0)
    assert (known.value, known.jumped_at, known.before_jump) == (74.4, 0.6, 100.0)


@pytest.mark.parametrize(
    ("report", "taken"),
    [
        (lambda told: told, False),
        (lambda told: replace(told, disputed=frozenset({"vertical_speed"})), True),
        (lambda told: replace(told, state=replace(told.state, vertical_speed=math.nan)), True),
        (lambda told: replace(told, state=replace(told.state, vertical_speed=-400.1)), True),
    ],
    ids=["told", "disputed", "not told", "impossible"],
)
def test_only_a_speed_in_no_doubt_denies_a_height(
    report: Callable[[i.VehicleReport], i.VehicleReport], taken: bool
) -> None:
    """Given a gap of 0.4 s in the messages, and a height that is 25 m lower after it."""
    story = Story(shipped("multirotor")).ready().fly(1.0)
    before = story.state.measured("height").value
    story.at(story.t + 0.4, story.heartbeat(), report(story.told(height=before - 25.0)))
    assert (story.state.measured("height").rejected == "") is taken


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
