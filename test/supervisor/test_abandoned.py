"""A deploy that was begun and came to nothing: while it falls, something must still be tried."""

from dataclasses import replace
from typing import Any

import pytest
from story import SINKS, Story, falling, parachute, rule, shipped, with_rules

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import Clears

K, D = Action.KILL, Action.DEPLOY


def falls_for(story: Story, seconds: float, autopilot: bool = True) -> Story:
    """From 2000 m, since t = 1; without its autopilot another source tells the fall."""
    until = story.t + seconds
    while story.t < until:
        since = story.t + 0.05 - 1.0
        told = story.told(**falling(since, 2000.0), tilt=70.0)
        if not autopilot:
            ages: dict[str, Any] = {"armed_age": since, "landed_state_age": since}
            state = replace(told.state, link_state=LinkState.LOST, **ages)
            told = i.VehicleReport(state)
        kill = story.state.killing.kill
        killed = story.state.stage is Stage.KILLING and kill is not None and not kill.confirmed
        reports = [story.report(K, Outcome.CONFIRMED)] if killed else []
        story.at(story.t + 0.05, story.heartbeat(), told, *reports)
    return story


def at_its_end(autopilot: bool = True) -> Story:
    """Nothing came of the deploy."""
    story = Story(shipped("multirotor")).ready().fly(1.0, height=2000.0)
    while story.state.stage is not Stage.DEPLOYING:
        falls_for(story, 0.05, autopilot)
    story.at(story.t, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.FAULT
    return story


@pytest.mark.parametrize("autopilot", [True, False])
def test_it_is_tried_again_whoever_tells_the_fall(autopilot):
    story = falls_for(at_its_end(autopilot), 10.0, autopilot)
    assert len(story.decisions(D)) == 2


def test_without_a_word_that_it_falls_it_is_not_tried_again():
    story = at_its_end(autopilot=False)
    for _ in range(200):
        state = story.told(vertical_speed=0.0).state
        since = story.t - 1.0
        told = replace(state, link_state=LinkState.LOST, armed_age=since, landed_state_age=since)
        story.at(story.t + 0.05, story.heartbeat(), i.VehicleReport(told))
    assert len(story.decisions(D)) == 1


@pytest.mark.parametrize(
    "kill",
    [i.KillRequest(9, "operator", "stop"), i.KillRequest(0, "upf_can 33", "about to launch")],
)
def test_a_kill_after_its_end_does_not_end_the_tries(kill):
    story = at_its_end()
    falls_for(story, 1.0).at(story.t, kill)
    falls_for(story, 0.2)
    assert len(story.decisions(K)) == 2
    assert story.state.stage is Stage.FAULT
    falls_for(story, 10.0)
    assert len(story.decisions(D)) == 2


def test_a_person_who_kills_after_its_end_is_answered():
    story = at_its_end()
    story.at(story.t + 0.1, i.KillRequest(9, "operator", "stop"))
    story.at(story.t + 0.1, story.report(K, Outcome.CONFIRMED))
    assert story.answer(9).success


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
def test_a_wrong_word_of_an_open_parachute_leaves_no_rule_dead(profile):
    """Given a rule that has just killed, as a parachute says for a moment that it is out."""
    story = Story(shipped(profile)).ready().fly(1.0, height=2000.0)
    while story.state.stage is not Stage.KILLING:
        falls_for(story, 0.05)
    first = story.newest(K).rule
    story.at(story.t, story.heartbeat(), parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    story.at(story.t, story.heartbeat(), parachute(deployed=False))
    assert story.state.stage is Stage.IN_FLIGHT
    assert not story.state.rule(first).latched
    falls_for(story, 3.0)
    assert story.decisions(D) != []


def test_an_alarm_that_was_said_is_not_said_again_for_it():
    alarm = rule(SINKS, action=Action.NONE, clears=Clears.NEVER, name="alarm")
    story = Story(with_rules(alarm)).flying().fly(3.0, vertical_speed=-14.0)
    story.at(story.t, story.heartbeat(), parachute(deployed=True))
    story.at(story.t, story.heartbeat(), parachute(deployed=False))
    assert story.state.stage is Stage.IN_FLIGHT
    story.fly(6.0, vertical_speed=-14.0)
    assert len([one for one in story.alarms() if "'alarm'" in one]) == 1


def test_inhibited_as_a_deploy_is_under_way_and_active_again_the_rules_live():
    story = Story(shipped("multirotor")).ready().fly(1.0, height=100.0)
    story.at(1.02, story.heartbeat(), i.DeployRequest(5, False, "a test"))
    story.at(1.1, story.heartbeat(), story.report(K, Outcome.FAILED, detail="DENIED"))
    story.fly(1.7, height=100.0)
    assert story.state.stage is Stage.DEPLOYING
    story.at(1.72, story.told(height=100.0), i.ModeRequest(6, i.Mode.INHIBITED, True))
    story.fly(7.0, height=100.0)
    story.at(story.t + 0.02, story.told(height=100.0), i.ModeRequest(7, i.Mode.ACTIVE, True))
    story.fly(60.0, every=0.1, height=100.0)
    assert len(story.decisions(D)) == 1
    story.fall(story.t + 3.0, height=100.0)
    assert len(story.decisions(D)) == 2
