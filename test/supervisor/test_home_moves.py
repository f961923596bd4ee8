"""Heights stand on the altitude above the sea and the take-off's own, whatever home does."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from story import DOWN, Story, falling, shipped

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i

EVERY, SEA = 0.1, 488.0


def standing(profile: str = "multirotor") -> Story:
    story = Story(shipped(profile)).ready()
    for _ in range(5):
        tell(story, 0.0, 0.0, 0.0, **DOWN)
    return story


def tell(story: Story, height: float, home: float, speed: float, **told: object) -> None:
    """height: over the take-off; home: where the autopilot's home is now, over the take-off, m."""
    parts = {"height": height - home, "altitude": SEA + height, "vertical_speed": speed, **told}
    inputs: list[i.Input] = [story.heartbeat(), story.told(**parts)]
    for one in [d for d in story.decisions() if d.action >= Action.KILL][-1:]:
        inputs.append(story.report(one.action, Outcome.CONFIRMED))
    story.at(story.t + EVERY, *inputs)


def hovering(height: float, home: float = 0.0, profile: str = "multirotor") -> Story:
    story = standing(profile)
    for _ in range(20):
        tell(story, height, home, 0.1)
    return story


def fall(story: Story, height: float, homes: list[float], **told: object) -> float:
    """How long after its motors stopped it is deployed, s; infinity: it is not."""
    start = story.t
    for k in range(80):
        parts = falling(EVERY * k, height)
        home = homes[k * len(homes) // 80]
        speed, force = parts["vertical_speed"], parts["acceleration"]
        if parts["height"] <= 0.0:
            break
        tell(story, parts["height"], home, speed, acceleration=force, **told)
        if "DEPLOY" in story.fired():
            return story.when(Action.DEPLOY) - start
    return math.inf


def test_disarmed_from_the_ground_a_vehicle_whose_home_falls_with_it_is_deployed():
    """Given PX4: after a forced disarm in the air it says ON_GROUND, and moves home to itself."""
    story, start = hovering(60.0), 0.0
    start = story.t
    for k in range(30):
        parts = falling(EVERY * k, 60.0)
        here, speed = parts["height"], parts["vertical_speed"]
        tell(story, here, here, speed, acceleration=parts["acceleration"], **DOWN)
    assert story.fired()[:2] == ["KILL", "DEPLOY"]
    assert story.when(Action.DEPLOY) - start < 1.0


def test_a_height_that_is_set_to_zero_while_disarmed_hides_no_fall():
    """Given ArduPlane: 45 m become 1 m in a second while it is disarmed."""
    story = hovering(45.0, profile="fixed_wing")
    homes = [min(44.0, 4.4 * k) for k in range(80)]
    assert fall(story, 45.0, homes, **DOWN) < 2.5


@pytest.mark.parametrize(("profile", "lowest"), [("multirotor", 30.0), ("fixed_wing", 60.0)])
@settings(max_examples=25)
@given(
    above=st.floats(0.0, 90.0),
    homes=st.lists(st.floats(-100.0, 200.0), min_size=1, max_size=20),
    slow=st.floats(-2.0, 2.0),
)
def test_whatever_way_home_goes_the_deploy_is_no_later(profile, lowest, above, homes, slow):
    height = lowest + above
    story = hovering(height, profile=profile)
    fixed = fall(story.fork(), height, [0.0])
    assert math.isfinite(fixed)
    drifted = 0.0
    for _ in range(30):
        drifted += EVERY * slow
        tell(story, height, drifted, 0.1)
    assert fall(story, height, homes) <= fixed + 1e-6


@pytest.mark.parametrize("home", [-30.0, 12.0, 49.0])
def test_a_home_that_is_set_elsewhere_in_flight_ends_no_flight(home):
    story = hovering(50.0)
    for _ in range(50):
        tell(story, 50.0, home, 0.1)
    assert story.fired() == []
    assert story.state.measured("height").value == pytest.approx(50.0)
