"""The rules at work: where they live, which goes first, how they clear, what modes change."""

from typing import Any

import pytest
from story import DOWN, LINK, SINKS, STANDING, START, TILTS, Story, rule, with_rules

from chute_ros.model import Action, Armed, LandedState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import Clears, Rule
from chute_ros.supervisor.wakes import next_deadline

K, D, ALARM = Action.KILL, Action.DEPLOY, Action.NONE
HIGH = MeasurementCondition("height", above=100.0)


def flying(*rules: Rule, **settings: Any) -> Story:
    return Story(with_rules(*rules, **settings)).flying()


def alarms(story: Story) -> int:
    return len(story.alarms())


# -- where a rule lives --------------------------------------------------------------------------


def test_a_rule_is_counted_only_in_its_states() -> None:
    story = Story(with_rules(rule(TILTS, action=ALARM, states=(Stage.IN_FLIGHT,)))).ready()
    story.fly(0.5, tilt=90.0, **DOWN)
    assert alarms(story) == 0
    story.fly(1.0, tilt=90.0)
    assert alarms(story) == 1


def test_what_was_counted_in_another_state_says_nothing_in_the_next() -> None:
    in_both = (Stage.IN_FLIGHT, Stage.LANDED)
    short = rule(TILTS, action=ALARM, states=(Stage.IN_FLIGHT,), hold=1.0, name="short")
    long = rule(TILTS, action=ALARM, states=in_both, hold=1.0, name="long")
    story = flying(short, long)
    story.fly(0.8, tilt=90.0)
    # It bounces: landed for one update.
    story.fly(0.85, tilt=90.0, landed_state=LandedState.ON_GROUND)
    story.fly(1.3, tilt=90.0)
    assert [one.split(":")[0] for one in story.alarms()] == ["rule 'long'"]


def test_a_rule_of_the_killing_state_deploys_after_a_kill_that_did_not_help() -> None:
    story = flying(rule(SINKS, states=(Stage.KILLING,)))
    story.fly(0.5, vertical_speed=-14.0)
    assert story.fired() == []
    story.at(0.5, i.KillRequest(1, "operator", "stop"))
    story.fly(1.2, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY"]


# -- which goes first ----------------------------------------------------------------------------


def test_the_gravest_of_the_fulfilled_goes_first_and_a_deploy_is_one() -> None:
    warns = rule(SINKS, action=ALARM, name="warns")
    kills = rule(SINKS, action=K, name="kills")
    deploys = rule(SINKS, action=D, name="deploys")
    story = flying(warns, kills, deploys)
    story.fly(1.0, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert [story.newest(action).rule for action in (K, D)] == ["deploys", "deploys"]
    assert alarms(story) == 1


def test_one_whose_state_is_left_by_a_graver_one_is_not_acted_on() -> None:
    kills = rule(SINKS, action=K, name="kills")
    warns = rule(SINKS, action=ALARM, states=(Stage.IN_FLIGHT,), name="warns")
    story = flying(warns, kills)
    story.fly(0.3, vertical_speed=-14.0)
    assert story.fired() == ["KILL"]
    assert alarms(story) == 0


def test_of_two_that_want_the_same_the_first_of_the_profile_is_named() -> None:
    story = flying(rule(SINKS, name="first"), rule(TILTS, name="second"))
    story.fly(0.3, vertical_speed=-14.0, tilt=90.0)
    assert story.newest(K).rule == "first"


def test_an_alarm_says_what_it_means_and_why() -> None:
    story = flying(rule(HIGH, action=ALARM, says="too high", name="ceiling"))
    story.fly(0.1, height=101.0)
    assert story.alarms() == ["rule 'ceiling': too high (height 101.00 (above 100))"]


def test_an_alarm_without_words_says_its_reasons() -> None:
    story = flying(rule(HIGH, action=ALARM, name="ceiling"))
    story.fly(0.1, height=101.0)
    assert story.alarms()[0].startswith("rule 'ceiling': height 101.00 (above 100) (")


# -- how it clears -------------------------------------------------------------------------------


def warned(clears: Clears, **told: Any) -> Story:
    """Warned of tilt once; then it flew well for 3 s, saying what is told; then it tilts again."""
    story = flying(rule(TILTS, action=ALARM, hold=0.5, leak=0.5, clears=clears))
    story.fly(1.0, tilt=90.0)
    assert alarms(story) == 1
    story.fly(4.0, **told)
    story.fly(6.0, tilt=90.0)
    return story


def test_one_that_never_clears_is_acted_on_once() -> None:
    assert alarms(warned(Clears.NEVER)) == 1


def test_one_that_clears_by_itself_is_acted_on_again_once_its_counter_was_empty() -> None:
    story = warned(Clears.BY_ITSELF)
    assert alarms(story) == 2
    assert "rule 'tested' has cleared" in story.said()


def test_one_that_clears_by_itself_does_not_while_its_counter_leaks() -> None:
    story = flying(rule(TILTS, action=ALARM, hold=0.5, leak=0.5, clears=Clears.BY_ITSELF))
    story.fly(1.0, tilt=90.0)
    for _ in range(6):  # swings to and fro
        story.fly(story.t + 0.5, tilt=50.0)
        story.fly(story.t + 0.4, tilt=70.0)
    assert alarms(story) == 1


def test_one_that_clears_on_disarm_does_so_then_and_not_before() -> None:
    assert alarms(warned(Clears.ON_DISARM)) == 1
    assert alarms(warned(Clears.ON_DISARM, armed=Armed.DISARMED)) == 2


def test_a_disarm_of_one_that_falls_clears_nothing() -> None:
    story = warned(Clears.ON_DISARM, armed=Armed.DISARMED, acceleration=0.5)
    assert alarms(story) == 1


def test_the_core_wakes_to_clear_a_rule_although_nothing_comes() -> None:
    silent = rule(
        DeviceCondition(DeviceFact.ASKS_FOR_KILL), action=ALARM, hold=0.0, clears=Clears.BY_ITSELF
    )
    story = flying(silent)
    story.at(0.1, i.KillRequest(0, "upf_can 33", "why"))
    assert alarms(story) == 1
    story.at(3.0)
    assert "has cleared" in story.said()


def test_the_core_wakes_when_a_counter_is_full_although_nothing_comes() -> None:
    asks = rule(AutopilotCondition(AutopilotFact.DISARMED), action=K, hold=0.7)
    story = flying(asks)
    story.at(0.1, story.told(armed=Armed.DISARMED))
    story.at(2.0)
    assert story.when(K) == pytest.approx(0.8, abs=1e-5)


def test_the_core_wakes_when_what_a_rule_rests_on_is_too_old() -> None:
    story = flying(rule(SINKS, hold=5.0))
    story.fly(1.0, vertical_speed=-14.0)
    story.at(30.0)
    assert story.fired() == [], "it counted for a second after the last sample, and no longer"
    assert story.state.rule("tested").level < 5.0
    assert not story.state.rule("tested").holds


def test_a_silence_of_the_autopilot_wakes_the_core_at_its_limit() -> None:
    story = flying(rule(AutopilotCondition(AutopilotFact.LOST), action=K))
    story.at(60.0)
    assert story.when(K) == pytest.approx(2.5, abs=1e-5)


# -- modes ---------------------------------------------------------------------------------------


def test_in_shadow_the_whole_logic_runs_and_nothing_is_sent() -> None:
    story = Story(with_rules(rule(SINKS, hold=0.3)), mode=i.Mode.SHADOW).flying()
    story.fly(3.0, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    decisions = [d for d in story.decisions() if d.action >= K]
    assert all(d.shadow for d in decisions)
    assert all("counter 0.30 s of 0.3 s" in d.reasons for d in decisions)
    assert [d.targets for d in decisions] == [(LINK,), (LINK,)]
    assert story.state.stage is Stage.IN_FLIGHT
    assert (story.state.killing.kill, story.state.deploying.deploys) == (None, ())


def test_what_was_only_said_in_shadow_is_done_when_active() -> None:
    story = Story(with_rules(rule(SINKS, hold=0.3)), mode=i.Mode.SHADOW).flying()
    story.fly(1.0, vertical_speed=-14.0)
    story.at(1.0, i.ModeRequest(1, i.Mode.ACTIVE, force=True))
    story.fly(1.25, vertical_speed=-14.0)
    assert len(story.fired()) == 2
    story.fly(2.0, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY", "KILL", "DEPLOY"]
    assert [d.shadow for d in story.decisions() if d.action >= K] == [True, True, False, False]


def test_inhibited_a_rule_only_counts() -> None:
    story = Story(with_rules(rule(SINKS, hold=0.3)), mode=i.Mode.INHIBITED).flying()
    story.fly(3.0, vertical_speed=-14.0)
    assert story.decisions() == []
    assert story.state.rule("tested").level == pytest.approx(0.3)


@pytest.mark.parametrize("mode", [i.Mode.SHADOW, i.Mode.INHIBITED])
def test_in_flight_the_mode_changes_only_by_force(mode: i.Mode) -> None:
    story = flying(rule(SINKS))
    story.at(0.1, i.ModeRequest(1, mode, force=False))
    assert story.answer(1).message == (
        "refused: the vehicle is IN_FLIGHT; force changes it all the same"
    )
    story.fly(0.2, vertical_speed=-14.0)
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize("stage", [Stage.KILLING, Stage.DEPLOYING, Stage.DEPLOYED, Stage.FAULT])
def test_nor_while_something_is_on_its_way_or_was_done(stage: Stage) -> None:
    story = flying()
    story.at(0.1, i.DeployRequest(1, False, "it falls"))
    for wanted, report in (
        (Stage.DEPLOYING, (K, Outcome.CONFIRMED)),
        (Stage.DEPLOYED, (D, Outcome.CONFIRMED)),
        (Stage.FAULT, (D, Outcome.FAILED)),
    ):
        if story.state.stage is not stage and not (
            wanted is Stage.DEPLOYED and stage is Stage.FAULT
        ):
            story.at(story.t + 0.1, story.report(*report))
    assert story.state.stage is stage
    story.at(story.t, i.ModeRequest(2, i.Mode.SHADOW, force=False))
    assert not story.answer(2).success


def test_after_a_deploy_only_a_reset_on_the_ground_leads_back() -> None:
    story = flying(rule(SINKS))
    story.fly(0.2, vertical_speed=-14.0)
    story.at(0.3, story.report(K, Outcome.CONFIRMED))
    story.at(0.4, story.report(D, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYED
    story.fly(3.0, vertical_speed=-5.0)
    story.at(3.0, i.ResetRequest(1))
    assert story.answer(1).message == "refused: the vehicle is in the air"
    story.at(3.1, i.ArmRequest(2, True, 0))
    assert "the vehicle is DEPLOYED (need READY)" in story.answer(2).message
    for n in range(10):
        story.at(3.2 + n * 0.1, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.DEPLOYED
    story.at(4.2, i.ResetRequest(3))
    assert story.answer(3).success
    story.at(4.3, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.READY


def test_at_rest_the_rules_wake_nobody() -> None:
    story = flying(rule(SINKS, hold=1.0), rule(TILTS, clears=Clears.BY_ITSELF, action=ALARM))
    story.fly(1.0)
    story.at(1.0, story.report(Action.FLIGHT_BLOCK_RELEASE, Outcome.CONFIRMED))
    assert next_deadline(story.config, story.state, START + 1.0) >= START + 1.5 - 1e-9
