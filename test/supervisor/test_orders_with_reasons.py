"""Orders with their rule and reasons."""

from dataclasses import replace
from typing import Any

import pytest
from story import FLYING, LINK, SINKS, START, Story, rule, with_rules

from chute_ros.model import Action, Armed, LandedState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import BelowMinimum

K, D = Action.KILL, Action.DEPLOY
UPF = "upf_can"
TILTED = MeasurementCondition("tilt_deg", above=60.0)
DEPLOYS, KILLS = rule(SINKS, hold=0.5, samples=3), rule(SINKS, action=K, hold=0.5, samples=3)
TWO = SupervisorConfig(deploy_links=(LINK, UPF))
DEVICE_ASKS = i.KillRequest(0, "upf_can 33", "about to launch")


def deploying(config: SupervisorConfig = TWO) -> Story:
    """In flight; a deploy is asked for at 1.0 (token 5), its kill confirmed as well."""
    story = Story(config).flying()
    story.at(0.9, story.heartbeat(), story.heartbeat(UPF))
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.0, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    return story


# -- every word ----------------------------------------------------------------------------------


def test_in_shadow_a_kill_and_a_deploy_are_said_with_their_rule_and_reasons() -> None:
    story = Story(with_rules(DEPLOYS), mode=i.Mode.SHADOW).flying()
    story.at(0.1, i.KillRequest(5, "operator", "stop"))
    story.at(0.2, i.DeployRequest(6, False, "it falls"))
    said = [(d.action, d.rule, d.reasons) for d in story.decisions() if d.action >= K]
    assert said == [
        (K, "operator", ("operator: stop",)),
        (K, "operator", ("operator: it falls",)),
        (D, "operator", ("operator: it falls",)),
    ]
    assert all(d.shadow for d in story.decisions())


@pytest.mark.parametrize("wanted", [KILLS, DEPLOYS])
def test_the_log_says_what_a_rule_saw(wanted: object) -> None:
    story = Story(with_rules(wanted)).flying().fly(1.0, vertical_speed=-13.0)
    (kill,) = story.decisions(K)
    assert kill.rule == "tested"
    assert kill.reasons[0] == "vertical_speed -13.00 (below -12)"
    assert kill.reasons[1].startswith("counter 0.5")
    assert f"IN_FLIGHT -> KILLING: a kill was decided ({'; '.join(kill.reasons)})" in story.said()


def test_the_log_says_what_a_person_wanted() -> None:
    story = Story().flying()
    story.at(0.1, i.KillRequest(5, "operator", "stop"))
    assert "IN_FLIGHT -> KILLING: a kill was decided (operator: stop)" in story.said()
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert story.answer(5).success


# -- another deploy ------------------------------------------------------------------------------


def test_a_person_who_insists_after_a_confirmation_gets_the_next_parachute_alone() -> None:
    story = deploying()
    story.at(1.1, story.report(D, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYED
    both = (story.heartbeat(), story.heartbeat(UPF))
    story.at(1.2, *both, i.DeployRequest(6, True, "it did not open"))
    assert story.answers(6) == []
    story.at(1.3, story.report(K, Outcome.CONFIRMED))
    assert [d.targets for d in story.decisions(D)] == [(LINK,), (UPF,)]
    story.at(1.4, story.report(D, Outcome.CONFIRMED, UPF))
    assert story.answer(6).success


def test_a_confirmation_that_comes_with_another_request_is_its_answer() -> None:
    story = deploying(SupervisorConfig())
    story.at(1.1, story.report(D, Outcome.ACCEPTED))
    story.at(1.2, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.FAULT
    late = story.report(D, Outcome.CONFIRMED)
    story.at(1.3, late, i.DeployRequest(6, False, "again"))
    assert story.answer(6).success
    assert story.fired() == ["KILL", "DEPLOY"]


def test_an_acknowledgement_of_the_last_deploy_is_not_that_of_the_next() -> None:
    story = deploying(SupervisorConfig())
    story.at(1.1, story.report(D, Outcome.ACCEPTED))
    story.at(1.2, story.report(D, Outcome.FAILED))
    story.at(1.3, i.DeployRequest(6, False, "again"))
    story.at(1.4, story.report(K, Outcome.CONFIRMED))
    assert story.fired() == ["KILL", "DEPLOY", "KILL", "DEPLOY"]
    assert story.answers(6) == []


# -- another kill --------------------------------------------------------------------------------


def test_a_device_that_asks_again_is_obeyed_again_at_the_limit() -> None:
    story = Story().flying()
    story.at(1.0, DEVICE_ASKS)
    story.at(1.5, story.report(K, Outcome.CONFIRMED))
    story.at(6.9375, DEVICE_ASKS)
    assert len(story.decisions(K)) == 1
    story.at(7.0, DEVICE_ASKS)
    assert len(story.decisions(K)) == 2, "the kill's time is over"


def test_a_device_that_asks_again_soon_after_a_failure_is_obeyed() -> None:
    story = Story().flying()
    story.at(1.0, DEVICE_ASKS)
    story.at(1.05, story.report(K, Outcome.FAILED))
    story.at(1.06, DEVICE_ASKS)
    assert len(story.decisions(K)) == 1, "not for each of its messages"
    story.at(1.5, DEVICE_ASKS)
    assert len(story.decisions(K)) == 2


@pytest.mark.parametrize(
    ("after", "age", "kills"), [(0.2, 0.0, 1), (0.25, 0.0, 2), (1.0, 0.75, 2), (1.0, 0.9, 1)]
)
def test_only_what_the_vehicle_says_well_after_the_kill_undoes_it(
    after: float, age: float, kills: int
) -> None:
    story = Story().flying()
    story.at(1.0, DEVICE_ASKS)
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    said = (START + 1.0 + after) - START
    story.at(said, i.VehicleReport(replace(FLYING, armed_age=age)), DEVICE_ASKS)
    assert len(story.decisions(K)) == kills


def test_a_person_who_joins_a_rules_deploy_is_held_back_by_no_height() -> None:
    minimum: dict[str, Any] = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}
    story = Story(with_rules(rule(SINKS), profile=minimum)).flying().fly(0.95, height=11.0)
    story.at(1.0, story.told(height=11.0, vertical_speed=-13.0))
    saw = story.newest(K).reasons
    for token in (5, 6):
        story.at(1.1, i.DeployRequest(token, False, f"it falls {token}"))
    story.at(1.2, story.heartbeat(), story.told(height=9.0, vertical_speed=-13.0))
    story.at(1.6, story.heartbeat())
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == "operator"
    assert story.newest(D).reasons == (
        *saw,
        "operator: it falls 5",
        "kill not confirmed after 0.50 s (limit 0.5 s)",
    )
    story.at(1.7, story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).success
    assert story.answer(6).success


def test_a_rule_that_joins_a_persons_deploy_leaves_it_theirs() -> None:
    story = Story(with_rules(rule(SINKS))).flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.told(vertical_speed=-13.0))
    story.at(1.6)
    assert story.newest(D).rule == "operator"
    assert story.newest(D).reasons[0] == "operator: it falls"


@pytest.mark.parametrize(
    "said", [{"landed_state": LandedState.ON_GROUND}, {"armed": Armed.DISARMED}]
)
def test_what_it_said_before_a_kill_is_not_its_effect(said: dict[str, Any]) -> None:
    config = with_rules(rule(TILTED), profile={"landed_hold": 5.0})
    story = Story(config).flying().fly(0.95).fly(1.95, **said)
    story.at(2.0, story.heartbeat(), i.KillRequest(5, "operator", "it lies on its side"))
    story.at(2.1, story.report(K, Outcome.CONFIRMED))
    story.fly(4.0, **{**said, "armed": Armed.DISARMED, "tilt": 90.0})
    assert story.fired() == ["KILL"]
    upright = Story(config).flying().fly(1.95)
    upright.at(2.0, upright.heartbeat(), i.KillRequest(5, "operator", "it flies away"))
    upright.at(2.1, upright.report(K, Outcome.CONFIRMED))
    upright.fly(4.0, **{**said, "armed": Armed.DISARMED, "tilt": 90.0})
    assert upright.fired()[:2] == ["KILL", "DEPLOY"]


def test_a_kill_after_a_failed_test_on_the_ground_is_none_in_flight() -> None:
    story = Story().ready()
    story.at(0.1, i.DeployRequest(5, True, "test"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    story.at(0.3, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.FAULT
    story.at(0.4, i.KillRequest(6, "operator", "stop"))
    story.at(0.5, story.report(K, Outcome.CONFIRMED))
    assert story.answer(6).success
    assert story.state.stage is Stage.FAULT
    assert not story.state.killing.killed_in_flight
