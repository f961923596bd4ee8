"""What the counters of the shipped rules forget, and what they do not: flights, not values."""

from collections.abc import Callable
from itertools import cycle
from typing import Any

import pytest
from story import Story, shipped

TWENTY_HERTZ, FIVE_HERTZ = 0.05, 0.2
#: One profile, the tilt that it ends, a descent that is not fast for it alone, m/s.
TIPS = [("multirotor", 100.0, 5.0), ("fixed_wing", 100.0, 7.0)]


def descending(profile: str, sink: float) -> Story:
    """Upright, ever faster down to this sink, m/s, and some seconds of it."""
    story = Story(shipped(profile)).ready()
    fly(story, 1.0, TWENTY_HERTZ, lambda _: {"vertical_speed": 0.0})
    fly(story, 1.0, TWENTY_HERTZ, lambda step: {"vertical_speed": -sink * step / 20})
    fly(story, 2.0, TWENTY_HERTZ, lambda _: {"vertical_speed": -sink})
    assert story.fired() == []
    return story


def fly(story: Story, seconds: float, every: float, told: Callable[[int], dict[str, Any]]) -> None:
    """For so long; told: what it tells at each step besides that it flies well. The heights follow
    the speed."""
    height = getattr(story, "height", 150.0)
    start = story.t
    for step in range(1, round(seconds / every) + 1):
        parts = told(step)
        height += parts["vertical_speed"] * every
        told_now = story.told(**{"height": height, **parts})
        story.at(start + step * every, story.heartbeat(), told_now)
    story.height = height  # type: ignore[attr-defined]


def tells(tilts: tuple[float, ...], sink: float) -> Callable[[int], dict[str, Any]]:
    """One tilt after another, over and over, in a descent."""
    every = cycle(tilts)
    return lambda _: {"tilt": next(every), "vertical_speed": -sink}


@pytest.mark.parametrize(("profile", "tilt", "sink"), TIPS)
def test_two_wrong_attitudes_in_a_descent_end_no_flight(profile, tilt, sink):
    """At the fewest messages that are enough, two of them last as long as the rule waits."""
    story = descending(profile, sink)
    every = 0.4 if profile == "fixed_wing" else FIVE_HERTZ
    fly(story, 2 * every, every, tells((tilt, tilt), sink))
    fly(story, 2.0, every, tells((0.0,), sink))
    assert story.fired() == []


@pytest.mark.parametrize(("profile", "tilt", "sink"), TIPS)
def test_a_vehicle_that_tumbles_and_is_upright_now_and_again_is_deployed_all_the_same(
    profile, tilt, sink
):
    """Half of the time it is. What forgot as fast as it counted would never decide."""
    story = descending(profile, sink)
    fell_at = story.t
    within = 1.0 if profile == "multirotor" else 2.2
    fly(story, within, TWENTY_HERTZ, tells((tilt, tilt, 20.0, 20.0), sink))
    assert story.fired()[:1] == ["KILL"]
    assert story.t - fell_at <= within + 1e-6


@pytest.mark.parametrize(("profile", "tilt", "sink"), TIPS)
def test_an_attitude_that_is_wrong_one_time_in_ten_ends_no_flight_however_long(
    profile, tilt, sink
):
    """What never forgot would have it together within seconds."""
    story = descending(profile, sink)
    story.height = 500.0  # type: ignore[attr-defined]
    fly(story, 40.0, TWENTY_HERTZ, tells((tilt, *[0.0] * 9), sink))
    assert story.fired() == []


def weightless(low: int, carried: int) -> Callable[[int], dict[str, Any]]:
    """So many samples without weight, then so many with it, over and over, in a gentle descent."""
    forces = cycle((*[1.0] * low, *[9.8] * carried))
    told = {"vertical_speed": -4.6, "attitude_error": 60.0}
    return lambda _: {"acceleration": next(forces), **told}


@pytest.mark.parametrize("lasts", [0.8, 1.3])
def test_an_aeroplane_that_is_pushed_over_to_no_weight_is_not_ended(lasts):
    """Given ArduPlane, which tells no commanded speed, and a pilot's parabola."""
    story = descending("fixed_wing", 0.0)
    start = story.t
    while story.t < start + lasts:
        speed = 9.81 * (lasts / 2.0 - (story.t - start)) - 4.0
        story.fly(story.t + 0.05, vertical_speed=speed, acceleration=0.3, attitude_error=10.0)
    story.fly(story.t + 3.0, vertical_speed=-1.0)
    assert story.fired() == []


def test_an_aeroplane_that_is_thrown_about_in_a_descent_is_not_ended():
    """Pushed over and carried again, each for 0.3 s: nothing of it may be left at the next."""
    story = descending("fixed_wing", 4.6)
    fly(story, 12.0, TWENTY_HERTZ, weightless(6, 6))
    assert story.fired() == []


def test_an_aeroplane_that_falls_is_deployed_though_it_is_carried_now_and_again():
    """One sample of four: a fall that swings."""
    story = descending("fixed_wing", 4.6)
    fly(story, 1.5, TWENTY_HERTZ, weightless(3, 1))
    assert story.fired()[:1] == ["KILL"]
