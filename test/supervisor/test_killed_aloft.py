"""The motors were stopped in the air, and nothing tells how it falls; or it was said to stand."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import DOWN, LINK, START, Story, shipped

from chute_ros.model import Action, Armed, LandedState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.link_evidence import LinkLimits
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.wakes import next_deadline

D = Action.DEPLOY
BOTH = pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
GROUND = LandedState.ON_GROUND
#: Of a link whose node is heard although it says nothing for long.
PATIENT = MappingProxyType({LINK: LinkLimits(stale_after=20.0, lost_after=30.0)})
#: Nothing of how it moves: its autopilot has hung.
SILENT: dict[str, Any] = {"vertical_speed": math.nan, "acceleration": math.nan}
#: So long nobody can say what the newest measurements are still worth: their age, and the hold, s.
WAITS = 1.0 + 0.3


def killed(profile: str, height: float, **told: Any) -> Story:
    """It flew, and a person stopped its motors at t + 2.0."""
    story = Story(shipped(profile)).flying().fly(2.0, **{"height": height, **told})
    story.at(2.0, i.KillRequest(1, "operator", "a person saw it"))
    assert story.fired() == ["KILL"]
    return story


def silence(story: Story, until: float) -> Story:
    """Only the heartbeats of the nodes."""
    for _ in range(round((until - story.t) / 0.05)):
        story.at(story.t + 0.05, story.heartbeat())
    return story


@BOTH
def test_what_is_silent_since_its_motors_were_stopped_high_is_deployed(profile):
    story = silence(killed(profile, 80.0), 4.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    (deploy,) = story.decisions(D)
    assert deploy.rule == "killed aloft and silent"
    assert any("killed aloft" in reason and "70.2" not in reason for reason in deploy.reasons)


@pytest.mark.parametrize(
    ("later", "told", "deploys"),
    [
        (0.1, {}, True),
        (1.0, {}, True),
        (1.1, {}, False),
        (0.1, {"height": math.nan}, False),
        (0.1, {"vertical_speed": math.nan}, False),
        # It is 11 m high then, and may be lower than 10 m once it counts as silent.
        (0.1, {"height": 11.0}, False),
    ],
)
def test_one_that_was_not_heard_as_it_was_killed_is_counted_from_its_next_word(
    later, told, deploys
):
    """Given a node that was started anew, and a kill before it hears of the vehicle."""
    story = silence(Story(shipped("multirotor")).flying().fly(2.0, height=80.0), 3.5)
    story.at(3.5, i.KillRequest(1, "operator", "a person saw it"))
    assert math.isnan(story.state.killing.killed_height)
    silence(story, 3.5 + later - 0.05)
    falls = {"height": 79.0, "vertical_speed": -2.0, "acceleration": 1.0, **told}
    story.at(3.5 + later, story.told(**falls))
    silence(story, 8.0)
    assert story.fired() == ["KILL", "DEPLOY"][: 1 + deploys]


def test_what_was_told_after_a_kill_does_not_change_what_was_told_at_it():
    story = killed("multirotor", 80.0)
    kept = story.state.killing.killed_height, story.state.killing.killed_sinking
    story.at(2.1, story.told(height=79.9, vertical_speed=-1.0, acceleration=0.5))
    assert (story.state.killing.killed_height, story.state.killing.killed_sinking) == kept


def test_one_that_was_killed_as_it_stood_is_not_in_the_air_by_a_height_told_later():
    story = Story(shipped("multirotor")).ready()
    story.at(2.0, i.KillRequest(1, "operator", "on the ground"))
    story.at(2.1, story.told(**DOWN, height=50.0, vertical_speed=0.0))
    assert math.isnan(story.state.killing.killed_height)
    assert "DEPLOY" not in silence(story, 6.0).fired()


def test_it_waits_until_the_newest_measurements_are_too_old_and_no_longer():
    story = silence(killed("multirotor", 80.0), 2.0 + WAITS - 0.1)
    assert story.fired() == ["KILL"]
    silence(story, 2.0 + WAITS + 0.1)
    assert story.state.deploying.deploy_rule == "killed aloft and silent"


def test_nothing_needs_to_come_for_it():
    """The supervisor wakes by itself when the measurements become too old, and at the hold."""
    config = shipped("multirotor", link_limits=PATIENT)
    story = Story(config).flying().fly(2.0, height=80.0)
    story.at(2.0, i.KillRequest(1, "operator", "a person saw it"))
    while not story.state.deploying.deploy_rule and story.t < 9.0:
        due = next_deadline(story.config, story.state, START + story.t)
        assert due < math.inf
        story.at(due - START)
    assert story.t == pytest.approx(2.0 + WAITS, abs=0.01)


def test_where_nobody_is_heard_it_is_not_the_vehicle_that_is_silent():
    story = killed("multirotor", 80.0)
    story.at(9.0)
    assert story.fired() == ["KILL"]


def test_one_that_was_not_heard_before_its_kill_tells_nothing_by_its_silence():
    """A supervisor that has heard of the kill, and never of the vehicle."""
    story = killed("multirotor", 80.0)
    story.state = replace(story.state, heard=replace(story.state.heard, vehicle_received=math.nan))
    assert silence(story, 5.0).fired() == ["KILL"]


@pytest.mark.parametrize("height", [60.0, 600.0])
def test_one_that_comes_down_on_a_hill_and_is_unplugged_is_not_deployed(height):
    """Its motors were stopped before the land detector spoke."""
    story = killed("multirotor", height)
    stands = {**DOWN, "vertical_speed": 0.0, "acceleration": 9.8, "height": height}
    story.fly(2.4, height=height, vertical_speed=0.0).fly(3.5, **stands)
    assert silence(story, 15.0).fired() == ["KILL"]


def test_one_that_has_come_down_stays_down_though_nothing_but_its_word_said_so():
    story = killed("multirotor", 600.0)
    story.fly(4.0, **{**DOWN, **SILENT, "height": 600.0})
    assert math.isnan(story.state.killing.killed_height)
    assert silence(story, 15.0).fired() == ["KILL"], "its word is old by then"


def test_one_whose_kill_failed_and_that_flew_on_is_not_deployed():
    story = killed("multirotor", 80.0)
    story.at(2.1, story.report(Action.KILL, Outcome.FAILED))
    story.fly(4.0, height=80.0)
    assert silence(story, 15.0).fired() == ["KILL"]


def test_one_whose_speed_or_force_is_told_is_judged_by_that():
    for still in ("vertical_speed", "acceleration"):
        told = {name: value for name, value in SILENT.items() if name != still}
        story = killed("multirotor", 80.0).fly(6.0, height=math.nan, **told)
        assert story.fired() == ["KILL"], f"{still} says that it flies on"


@pytest.mark.parametrize(
    ("height", "sinking", "deploys"),
    [
        # After WAITS, by half a g t^2, 8.3 m are gone.
        (10.0 + 8.4, 0.0, True),
        (10.0 + 8.1, 0.0, False),
        (10.0 + 8.1 + 13.0, 10.0, False),
        (10.0 + 8.6 + 13.0, 10.0, True),
        # That it climbed is not counted on.
        (10.0 + 8.1, -10.0, False),
        (0.0, 0.0, False),
    ],
)
def test_it_must_still_be_above_the_minimum_height_without_any_drag(height, sinking, deploys):
    story = Story(shipped("multirotor")).flying().fly(1.0, height=60.0)
    story.fly(2.0, every=0.01, height=height, vertical_speed=-sinking)
    story.at(2.0, i.KillRequest(1, "operator", "a person saw it"))
    silence(story, 9.0)
    assert story.fired() == (["KILL", "DEPLOY"] if deploys else ["KILL"])


@pytest.mark.parametrize("told", [{"height": math.nan}, DOWN])
def test_one_of_unknown_height_or_that_said_that_it_stood_is_not(told):
    story = Story(shipped("multirotor")).flying().fly(1.0, height=60.0).fly(1.9, **told)
    story.at(2.0, i.KillRequest(1, "operator", "a person saw it"))
    assert silence(story, 9.0).fired() == ["KILL"]


def test_one_that_was_unplugged_after_its_landing_is_not():
    story = Story(shipped("multirotor")).flying().fly(2.0).fly(5.0, height=0.2, **DOWN)
    story.at(5.0, i.KillRequest(1, "operator", "to be sure"))
    assert silence(story, 20.0).fired() == ["KILL"]


def test_one_that_was_said_to_stand_when_it_was_killed_and_falls_is_deployed():
    story = Story(shipped("fixed_wing")).flying().fly(2.0, height=80.0)
    story.fly(8.0, height=80.0, landed_state=GROUND)
    assert story.state.stage is Stage.LANDED
    story.at(8.0, i.KillRequest(1, "operator", "a person saw it"))
    story.fall(12.0, 80.0, landed_state=GROUND, armed=Armed.DISARMED)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert START + 8.0 < story.state.flight.airborne_since < START + 9.0
    assert "it falls since the kill, although it was reported to stand" in story.alarms()


def test_one_that_stands_when_it_is_killed_and_is_carried_away_is_not():
    story = Story(shipped("fixed_wing")).ready()
    story.fly(2.0, height=0.0, **DOWN)
    story.at(2.0, i.KillRequest(1, "operator", "a test"))
    # Somebody takes it up, and sets it down not very softly.
    for speed, force in ((1.5, 9.8), (-1.5, 8.0), (-3.0, 9.0), (0.0, 14.0)):
        story.fly(story.t + 0.5, height=1.0, vertical_speed=speed, acceleration=force, **DOWN)
    assert story.fired() == ["KILL"]
    assert not story.state.killing.killed_in_flight
