"""Low above the ground a deploy waits for its kill no longer than the ground lets it."""

from __future__ import annotations

import math
from typing import Any

import pytest
from story import Story, shipped, with_rules

from chute_ros.model import Action, LinkState
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import Measured
from chute_ros.supervisor.state import State

K, D = Action.KILL, Action.DEPLOY
LOST = {"link_state": LinkState.LOST}
#: What an IMU alone tells of one that falls.
IMU_ALONE = {"vertical_speed": math.nan, "height": math.nan, "tilt": 0.0, "acceleration": 2.0}


def waited(story: Story) -> float:
    """From the kill to the deploy, s."""
    return round(story.when(D) - story.when(K), 3)


def falls_from(height: float, profile: str = "multirotor", **settings: Any) -> Story:
    """Its motors stop at this height, and nobody confirms the kill."""
    story = Story(shipped(profile, **settings)).flying().fly(1.0, height=height)
    return story.fall(4.0, height)


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize(("height", "waits"), [(32.0, 0.2), (70.0, 0.5)])
def test_what_falls_low_is_released_before_the_half_second_is_over(
    profile: str, height: float, waits: float
) -> None:
    story = falls_from(height, profile)
    assert waited(story) == waits
    reasons = "; ".join(story.newest(D).reasons)
    assert ("at most 0.2 s for the kill" in reasons) is (waits == 0.2)
    assert f"(limit {waits:g} s)" in reasons


def test_the_reason_tells_the_height_and_what_is_low() -> None:
    (told,) = [one for one in falls_from(32.0).newest(D).reasons if "m are left" in one]
    assert told.startswith("at most 0.2 s for the kill: 2")
    assert told.endswith("(low: 30 m)")


@pytest.mark.parametrize(
    ("delay", "low", "waits"), [(0.5, 0.3, 0.3), (0.1, 0.2, 0.1), (0.2, 0.2, 0.2), (0.5, 0.0, 0.0)]
)
def test_how_long_can_be_set_and_it_is_never_longer_than_elsewhere(
    delay: float, low: float, waits: float
) -> None:
    settings = {"kill_to_deploy_delay": delay, "low_kill_to_deploy_delay": low}
    story = falls_from(32.0, **settings)
    assert waited(story) == waits
    assert ("m are left" in "; ".join(story.newest(D).reasons)) is (low < delay)


@pytest.mark.parametrize(("height", "waits"), [(45.0, 0.2), (90.0, 0.5)])
def test_what_fell_silent_is_taken_to_have_fallen_since(height: float, waits: float) -> None:
    """Given an IMU that tells the fall, and an autopilot that told the height 2.5 s ago."""
    story = Story(shipped("multirotor")).ready().fly(1.0, height=height)
    story.fly(story.t + 2.6, **IMU_ALONE)
    story.fly(story.t + 1.5, **IMU_ALONE, **LOST)
    assert story.newest(K).rule == "autopilot lost and falling"
    assert waited(story) == waits


def test_what_a_person_wants_down_is_not_taken_to_fall() -> None:
    """Its motors may turn, and its words alone not arrive."""
    story = Story(shipped("multirotor")).ready().fly(1.0, height=45.0)
    story.alive(story.t + 2.0)
    story.at(story.t, i.DeployRequest(5, False, "I do not hear it any more"))
    story.alive(story.t + 1.0)
    assert waited(story) == 0.5


@pytest.mark.parametrize(("height", "waits"), [(29.9, 0.2), (30.1, 0.5)])
def test_what_a_person_sees_low_is_released_as_soon(height: float, waits: float) -> None:
    story = Story(shipped("multirotor")).flying().fly(2.0, height=height)
    story.at(2.0, i.DeployRequest(5, False, "it burns"))
    story.fly(3.0, height=height)
    assert waited(story) == waits


@pytest.mark.parametrize(
    ("height", "waits"), [(-29.9, 0.2), (-30.1, 0.5), (math.nan, 0.5), (0.0, 0.2)]
)
def test_far_below_the_take_off_or_unknown_is_not_low(height: float, waits: float) -> None:
    story = Story(with_rules(profile={"low_height": 30.0})).flying()
    story.fly(1.0, height=height)
    story.at(1.0, i.DeployRequest(5, False, "it burns"))
    story.fly(2.0, height=height)
    assert waited(story) == waits


def test_without_a_low_height_in_its_profile_nothing_is_low() -> None:
    story = Story(with_rules()).flying().fly(1.0, height=-0.5)
    story.at(1.0, i.DeployRequest(5, False, "it burns"))
    story.fly(2.0, height=-0.5)
    assert waited(story) == 0.5


def test_the_wait_counts_from_a_kill_that_was_under_way() -> None:
    story = Story(shipped("multirotor")).flying().fly(2.0, height=20.0)
    story.at(2.0, i.KillRequest(4, "operator", "stop"))
    story.at(2.15, i.DeployRequest(5, False, "and now it falls"))
    story.at(2.3)
    assert waited(story) == 0.2
    assert story.state.stage is Stage.DEPLOYING


def told_at(height: float, at: float, **besides: Any) -> State:
    known = Measured(value=height, measured_at=at, same_since=at, count=1)
    return State(7, 0.0, measurements={"height": known}, **besides)


@pytest.mark.parametrize(
    ("falls", "silent", "left"),
    [(True, 0.9, 40.0), (True, 2.0, 20.38), (False, 2.0, math.nan), (True, 3.0, -4.145)],
)
def test_the_height_that_is_left(falls: bool, silent: float, left: float) -> None:
    config = shipped("multirotor")
    state = told_at(40.0, 100.0)
    assert flight.height_left(config, state, falls, 100.0 + silent) == pytest.approx(
        left, nan_ok=True
    )


def test_the_height_of_an_autopilot_that_started_anew_in_flight_says_nothing() -> None:
    config, state = shipped("multirotor"), told_at(40.0, 100.0, rebooted=True)
    assert math.isnan(flight.height_left(config, state, True, 102.0))
    never = State(7, 0.0)
    assert math.isnan(flight.height_left(config, never, True, 102.0))
