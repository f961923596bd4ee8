"""Low above the ground a deploy waits for its kill no longer than the ground lets it."""

import copy
import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import START, Story, changed, shipped, with_rules

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.deploying import release_due
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.state import State, ThisFlight
from chute_ros.supervisor.wakes import next_deadline

K, D = Action.KILL, Action.DEPLOY
LOST = {"link_state": LinkState.LOST}
#: What an IMU alone tells: of one that falls, and of one that flies.
IMU_FALLS = {"vertical_speed": math.nan, "height": math.nan, "tilt": 0.0, "acceleration": 2.0}
IMU_FLIES = {**IMU_FALLS, "acceleration": 9.8}


def waited(story: Story) -> float:
    """From the kill to the deploy, s."""
    return round(story.when(D) - story.when(K), 3)


def falls_from(height: float, profile: str = "multirotor", **settings: Any) -> Story:
    """Its motors stop at this height, and nobody confirms the kill."""
    story = Story(shipped(profile, **settings)).flying().fly(1.0, height=height)
    # An aeroplane does not fall flat.
    return story.fall(4.0, height, **({"tilt": 120.0} if profile == "fixed_wing" else {}))


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize(("height", "waits"), [(32.0, 0.2), (70.0, 0.5)])
def test_what_falls_low_is_released_before_the_half_second_is_over(profile, height, waits):
    story = falls_from(height, profile)
    assert waited(story) == waits
    (told,) = [one for one in story.newest(D).reasons if "not confirmed" in one]
    assert told.startswith(f"kill not confirmed after {waits:.2f} s (limit {waits:g} s")
    first = 2 if profile == "multirotor" else 1  # digit of its height by then
    assert (f"below 30 m: {first}" in told) is (waits == 0.2)


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
def test_below_30_m_is_low(profile):
    assert shipped(profile).profile.low_height == 30.0


@pytest.mark.parametrize(
    ("delay", "low", "waits"), [(0.5, 0.3, 0.3), (0.1, 0.2, 0.1), (0.2, 0.2, 0.2), (0.5, 0.0, 0.0)]
)
def test_how_long_can_be_set_and_it_is_never_longer_than_elsewhere(delay, low, waits):
    settings = {"kill_to_deploy_delay": delay, "low_kill_to_deploy_delay": low}
    story = falls_from(30.5, **settings)
    assert waited(story) == waits
    assert ("below 30 m" in "; ".join(story.newest(D).reasons)) is (low < delay)


def test_what_comes_low_as_it_waits_waits_no_longer():
    """A few decimetres more of height must not put the release off by three tenths."""
    waits = [waited(falls_from(height / 10.0)) for height in range(320, 420, 4)]
    assert waits == sorted(waits)
    assert {0.2, 0.5} < set(waits)


@pytest.mark.parametrize(("height", "waits"), [(45.0, 0.2), (90.0, 0.5)])
def test_what_fell_silent_is_taken_to_have_fallen_since(height, waits):
    """Given an IMU that tells the fall, and an autopilot that told the height 2.5 s ago."""
    story = Story(shipped("multirotor")).ready().fly(1.0, height=height)
    story.fly(story.t + 2.6, **IMU_FALLS)
    story.fly(story.t + 1.5, **IMU_FALLS, **LOST)
    assert story.newest(K).rule == "autopilot lost and falling"
    assert waited(story) == waits
    if waits == 0.2:
        assert f"{height:.1f} m reported 2." in "; ".join(story.newest(D).reasons)


@pytest.mark.parametrize("silent", [1.0, 3.0, 10.0])
def test_what_was_low_stays_so_however_long_its_height_is_not_told(silent):
    story = Story(shipped("multirotor")).ready().fly(1.0, height=25.0)
    story.fly(story.t + silent, **IMU_FLIES)
    story.fly(story.t + 2.6, **IMU_FALLS, **LOST)
    story.fly(story.t + 1.0, **IMU_FALLS, **LOST)
    assert waited(story) == 0.2


def test_what_a_person_wants_down_is_not_taken_to_fall():
    """Its motors may turn, and its words alone not arrive."""
    story = Story(shipped("multirotor")).ready().fly(1.0, height=45.0)
    story.alive(story.t + 2.0)
    story.at(story.t, i.DeployRequest(5, False, "I do not hear it any more"))
    story.alive(story.t + 1.0)
    assert waited(story) == 0.5


def test_a_person_who_wants_it_as_well_as_a_rule_makes_it_no_later():
    story = Story(shipped("multirotor")).ready().fly(1.0, height=45.0)
    story.fly(story.t + 2.6, **IMU_FALLS)
    while not story.state.deploying.deploy_rule:
        asked = copy.copy(story)
        asked.outputs, asked.turns = list(story.outputs), list(story.turns)
        story.at(story.t + 0.05, story.heartbeat(), story.told(**IMU_FALLS, **LOST))
    person = i.DeployRequest(5, False, "it falls")
    asked.at(asked.t + 0.05, person, asked.heartbeat(), asked.told(**IMU_FALLS, **LOST))
    for one in (story, asked):
        one.fly(one.t + 1.0, **IMU_FALLS, **LOST)
        assert waited(one) == 0.2
    assert asked.newest(D).rule == "operator"


@pytest.mark.parametrize(("height", "waits"), [(29.9, 0.2), (30.1, 0.5)])
def test_what_a_person_sees_low_is_released_as_soon(height, waits):
    story = Story(shipped("multirotor")).flying().fly(2.0, height=height)
    story.at(2.0, i.DeployRequest(5, False, "it burns"))
    story.fly(3.0, height=height)
    assert waited(story) == waits


def test_what_stands_is_not_low_as_people_stand_beside_its_motors():
    story = Story(shipped("multirotor")).ready()
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, True, "bench test"))
    story.alive(2.0)
    assert waited(story) == 0.5


@pytest.mark.parametrize(
    ("height", "waits"), [(-29.9, 0.2), (-30.1, 0.5), (math.nan, 0.5), (0.0, 0.2)]
)
def test_far_below_the_take_off_or_unknown_is_not_low(height, waits):
    story = Story(with_rules(profile={"low_height": 30.0})).flying()
    story.fly(1.0, height=height)
    story.at(1.0, i.DeployRequest(5, False, "it burns"))
    story.fly(2.0, height=height)
    assert waited(story) == waits


def test_without_a_low_height_in_its_profile_nothing_is_low():
    story = Story(with_rules()).flying().fly(1.0, height=0.5)
    story.at(1.0, i.DeployRequest(5, False, "it burns"))
    story.fly(2.0, height=0.5)
    assert waited(story) == 0.5


def test_the_wait_counts_from_a_kill_that_was_under_way():
    story = Story(shipped("multirotor")).flying().fly(2.0, height=20.0)
    story.at(2.0, i.KillRequest(4, "operator", "stop"))
    story.at(2.15, i.DeployRequest(5, False, "and now it falls"))
    story.at(2.3)
    assert waited(story) == 0.2
    assert story.state.stage is Stage.DEPLOYING


def test_a_confirmed_kill_is_not_waited_for_low_or_high():
    for height in (20.0, 80.0):
        story = Story(shipped("multirotor")).flying().fly(2.0, height=height)
        story.at(2.0, i.DeployRequest(5, False, "it falls"))
        story.at(2.05, story.report(K, Outcome.CONFIRMED))
        assert waited(story) == 0.05
        assert "kill confirmed after 0.05 s (limit 0.5 s)" in story.newest(D).reasons


def test_it_wakes_by_itself_when_the_fall_may_have_come_low():
    story = Story(shipped("multirotor")).ready().fly(1.0, height=60.0)
    story.fly(story.t + 2.6, **IMU_FALLS)
    while not story.state.deploying.deploy_rule:
        story.at(story.t + 0.05, story.heartbeat(), story.told(**IMU_FALLS, **LOST))
    # 30 m are fallen, from rest, a quarter of a second before the wait is over.
    at = story.state.deploying.deploy_due - 0.25 - math.sqrt(2.0 * 30.0 / flight.GRAVITY)
    state = with_height(story.state, 60.0, at)
    due = release_due(story.config, state, START + story.t)
    assert due == pytest.approx(state.deploying.deploy_due - 0.25, abs=1e-6)
    assert next_deadline(story.config, state, START + story.t) <= due + 1e-6


def known(height: float, at: float = 100.0, **more: Any) -> dict[str, Measured]:
    """Taken once, at this time."""
    return {"height": Measured(value=height, measured_at=at, same_since=at, count=1, **more)}


def with_height(state: State, height: float, at: float) -> State:
    """The same, with this as the only height and no speed."""
    others = {
        name: one
        for name, one in state.heard.measurements.items()
        if name not in ("height", "vertical_speed")
    }
    return replace(
        state,
        heard=replace(state.heard, measurements=MappingProxyType({**others, **known(height, at)})),
    )


def in_flight(height: float, speed: float = math.nan, at: float = 100.0, **besides: Any) -> State:
    """In the air, as this height was told at 100 s and the speed at another time."""
    speeds = {"vertical_speed": Measured(value=speed, measured_at=at, count=1)}
    told = known(height, **besides.pop("told", {})) | speeds
    return changed(State(7, 0.0), airborne=True, measurements=told, **besides)


@pytest.mark.parametrize(
    ("state", "falls", "at"),
    [
        (in_flight(29.9), False, 100.0),
        (in_flight(30.0), False, math.inf),
        (in_flight(29.9), True, 100.0),
        (in_flight(-30.0), True, 100.0),
        (in_flight(-30.1), True, math.inf),
        (in_flight(30.0), True, 100.0),
        (in_flight(49.62), True, 102.0),
        (in_flight(49.62, speed=3.0), True, 102.0),
        (in_flight(59.62, speed=-5.0), True, 102.0),
        (in_flight(59.62, speed=-5.0, at=100.2), True, 102.0),
        (in_flight(49.62, speed=-5.0, at=100.3), True, 102.0),
        (in_flight(49.62, rebooted=True), True, math.inf),
        (in_flight(math.nan), True, math.inf),
        # One that has just jumped up, or down.
        (in_flight(80.0, told={"jumped_at": 99.0, "before_jump": 25.0}), True, 100.0),
        (in_flight(25.0, told={"jumped_at": 99.0, "before_jump": 80.0}), True, 100.0),
        (in_flight(80.0, told={"jumped_at": 80.0, "before_jump": 25.0}), True, 103.193),
        # Armed 60 m below home, and 60 m above that.
        (in_flight(20.0, took_off_height=-60.0, armed_height=-60.0), True, 103.193),
        (in_flight(20.0, took_off_height=0.0), True, 100.0),
        # On a hill: by the height above home, as for the minimum height.
        (in_flight(65.0, took_off_height=40.0, armed_height=40.0), True, 102.671),
    ],
)
def test_since_when_it_is_low(state, falls, at):
    config = shipped("multirotor")
    assert flight.low_at(config, state, falls, 100.5) == pytest.approx(at, abs=1e-3)


def test_a_height_that_claims_to_come_from_the_future_came_just_now():
    config = shipped("multirotor")
    assert flight.low_at(config, in_flight(25.0), True, 96.0) == 96.0
    assert flight.low_at(config, in_flight(49.62), True, 96.0) == pytest.approx(98.0)


def test_one_that_stands_or_was_never_heard_is_not_low():
    config = shipped("multirotor")
    assert (
        flight.low_at(
            config,
            replace(in_flight(5.0), flight=replace(in_flight(5.0).flight, airborne=False)),
            True,
            100.5,
        )
        == math.inf
    )
    assert (
        flight.low_at(config, State(7, 0.0, flight=ThisFlight(airborne=True)), True, 100.5)
        == math.inf
    )


def test_an_old_height_of_what_nobody_saw_fall_says_nothing():
    assert flight.low_at(shipped("multirotor"), in_flight(20.0), False, 101.1) == math.inf
