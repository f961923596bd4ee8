"""A deploy that was too low for one is put off, not used up: roofs, docks and valleys."""

import pytest
from story import DOWN, Story, falling, pressure_at, shipped

from chute_ros.model import Action, Armed, Outcome
from chute_ros.supervisor import inputs as i

EVERY = 0.1


def from_a_roof(cruise: float, drop: float, barometer: bool = False) -> tuple[Story, float]:
    """It hovers so high over the roof from which it took off, and falls so far below it, m."""
    story = Story(shipped("multirotor")).ready()

    def tell(height: float, **told: object) -> None:
        if barometer:
            told["pressure"] = pressure_at(height + 0.1 * (len(story.turns) % 3))
        if story.fired():
            told["armed"] = Armed.DISARMED
        inputs: list[i.Input] = [story.heartbeat(), story.told(height=height, **told)]
        for one in [d for d in story.decisions() if d.action >= Action.KILL][-1:]:
            inputs.append(story.report(one.action, Outcome.CONFIRMED))
        story.at(story.t + EVERY, *inputs)

    for _ in range(10):
        tell(0.0, **DOWN, vertical_speed=0.0)
    for k in range(40):
        tell(min(cruise, 0.3 * k), vertical_speed=0.0)
    start = story.t
    for k in range(100):
        parts = falling(EVERY * k, cruise)
        if parts["height"] < -drop:
            break
        tell(tilt=min(100.0, 25.0 * k), **parts)
    return story, start


@pytest.mark.parametrize("barometer", [True, False])
@pytest.mark.parametrize("cruise", [3.0, 5.0, 9.0, 12.0])
def test_killed_as_it_looked_too_low_it_is_deployed_once_it_is_below_its_roof(cruise, barometer):
    story, start = from_a_roof(cruise, 60.0, barometer)
    assert story.fired()[:2] == ["KILL", "DEPLOY"]
    assert story.when(Action.DEPLOY) - start < 2.7


def test_the_same_over_level_ground_is_killed_and_no_more():
    story, _ = from_a_roof(9.0, 0.0)
    for _ in range(100):
        story.at(story.t + EVERY, story.heartbeat(), story.told(**DOWN, height=0.0, tilt=100.0))
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize("before", [0.0, 0.1, 0.3])
def test_what_denied_it_and_falls_silent_a_moment_before_all_else_releases_nothing(before):
    """Given a vehicle that tipped over at 5 m and lies on the ground, whose estimator takes itself
    to sink slowly at 19 m, and whose barometer knows better; when its autopilot is heard no more,
    and of it the barometer was heard last a little before (a recorded flight ends so)."""
    story = Story(shipped("multirotor")).ready()

    def tell(height: float, barometer: float | None, **told: object) -> None:
        if barometer is not None:
            told["pressure"] = pressure_at(barometer + 0.1 * (len(story.turns) % 3))
        story.at(story.t + EVERY, story.heartbeat(), story.told(height=height, **told))

    for _ in range(10):
        tell(0.0, 0.0, **DOWN, vertical_speed=0.0)
    for k in range(100):
        tell(0.19 * k, min(5.0, 0.3 * k), vertical_speed=0.5)
    tipped = {"tilt": 100.0, "attitude_error": 100.0, "acceleration": 3.0}
    for k in range(10):
        tell(19.0, max(0.0, 5.0 - 5.0 * (EVERY * k) ** 2), vertical_speed=-0.4 * k, **tipped)
    assert story.fired() == ["KILL"]
    lies = {"tilt": 170.0, "attitude_error": 170.0, "vertical_speed": -2.2}
    for k in range(30):
        tell(19.0 - 0.22 * k, -0.03 * k, acceleration=9.4 + 0.1 * (k % 3), **lies)
    for k in range(round(before / EVERY)):
        tell(12.4 - 0.22 * k, None, acceleration=9.4 + 0.1 * (k % 3), **lies)
    for _ in range(200):
        story.at(story.t + 0.02, story.heartbeat())
    assert story.fired() == ["KILL"]
