"""The rules at work: where they live, which goes first, what follows in words, how they clear."""

import math
from dataclasses import replace
from typing import Any

import pytest
from story import (
    DOWN,
    LINK,
    SINKS,
    STANDING,
    START,
    TILTS,
    Story,
    changed,
    rule,
    vehicle,
    with_rules,
)

from chute_ros.model import Action, Armed, LandedState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.base import JUST_AFTER
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import JUMP_DOUBTED, Measured
from chute_ros.supervisor.policy import judge, rule_deadlines
from chute_ros.supervisor.rules import BelowMinimum, Clears, Rule
from chute_ros.supervisor.wakes import next_deadline

K, D, ALARM = Action.KILL, Action.DEPLOY, Action.NONE


def flying(*rules: Rule, **settings: Any) -> Story:
    return Story(with_rules(*rules, **settings)).flying()


def alarms(story: Story) -> int:
    return len(story.alarms())


# -- where a rule lives --------------------------------------------------------------------------


def test_a_rule_is_counted_only_in_its_states():
    story = Story(with_rules(rule(TILTS, action=ALARM, states=(Stage.IN_FLIGHT,)))).ready()
    story.fly(0.5, tilt=90.0, **DOWN)
    assert alarms(story) == 0
    story.fly(1.0, tilt=90.0)
    assert alarms(story) == 1


def test_what_was_counted_in_another_state_says_nothing_in_the_next():
    in_both = (Stage.IN_FLIGHT, Stage.LANDED)
    short = rule(TILTS, action=ALARM, states=(Stage.IN_FLIGHT,), hold=1.0, name="short")
    long = rule(TILTS, action=ALARM, states=in_both, hold=1.0, name="long")
    story = flying(short, long)
    story.fly(0.8, tilt=90.0)
    # It bounces: landed for one update.
    story.fly(0.85, tilt=90.0, landed_state=LandedState.ON_GROUND)
    story.fly(1.3, tilt=90.0)
    assert [one.split(":")[0] for one in story.alarms()] == ["rule 'long'"]


def test_a_rule_of_the_killing_state_deploys_after_a_kill_that_did_not_help():
    story = flying(rule(SINKS, states=(Stage.KILLING,)))
    story.fly(0.5, vertical_speed=-14.0)
    assert story.fired() == []
    story.at(0.5, i.KillRequest(1, "operator", "stop"))
    story.fly(1.2, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY"]


# -- which goes first ----------------------------------------------------------------------------


def test_the_gravest_of_the_fulfilled_goes_first_and_a_deploy_is_one():
    warns = rule(SINKS, action=ALARM, name="warns")
    kills = rule(SINKS, action=K, name="kills")
    deploys = rule(SINKS, action=D, name="deploys")
    story = flying(warns, kills, deploys)
    story.fly(1.0, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert [story.newest(action).rule for action in (K, D)] == ["deploys", "deploys"]
    assert alarms(story) == 1


def test_one_whose_state_is_left_by_a_graver_one_is_not_acted_on():
    kills = rule(SINKS, action=K, name="kills")
    warns = rule(SINKS, action=ALARM, states=(Stage.IN_FLIGHT,), name="warns")
    story = flying(warns, kills)
    story.fly(0.3, vertical_speed=-14.0)
    assert story.fired() == ["KILL"]
    assert alarms(story) == 0


def test_of_two_that_want_the_same_the_first_of_the_profile_is_named():
    story = flying(rule(SINKS, name="first"), rule(TILTS, name="second"))
    story.fly(0.3, vertical_speed=-14.0, tilt=90.0)
    kill = story.newest(K)
    assert (kill.rule, kill.reasons) == ("first", ("vertical_speed -14.00 (below -12)",))


# -- how it clears -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("clears", "told", "acted"),
    [
        (Clears.NEVER, {}, 1),
        (Clears.BY_ITSELF, {}, 2),
        (Clears.ON_DISARM, {}, 1),
        (Clears.ON_DISARM, {"armed": Armed.DISARMED}, 2),
        # A disarm of one that falls clears nothing.
        (Clears.ON_DISARM, {"armed": Armed.DISARMED, "acceleration": 0.5}, 1),
    ],
)
def test_a_rule_is_acted_on_again_once_it_has_cleared(clears, told, acted):
    """Warned of tilt once; then it flies well for 3 s, saying this; then it tilts again."""
    story = flying(rule(TILTS, action=ALARM, hold=0.5, leak=0.5, clears=clears))
    story.fly(1.0, tilt=90.0)
    assert alarms(story) == 1
    story.fly(4.0, **told)
    story.fly(6.0, tilt=90.0)
    assert alarms(story) == acted
    assert ("rule 'tested' has cleared" in story.said()) is (acted == 2)


def test_one_that_clears_by_itself_does_not_while_its_counter_leaks():
    story = flying(rule(TILTS, action=ALARM, hold=0.5, leak=0.5, clears=Clears.BY_ITSELF))
    story.fly(1.0, tilt=90.0)
    for _ in range(6):  # swings to and fro
        story.fly(story.t + 0.5, tilt=50.0)
        story.fly(story.t + 0.4, tilt=70.0)
    assert alarms(story) == 1


def test_the_core_wakes_to_clear_a_rule_although_nothing_comes():
    silent = rule(
        DeviceCondition(DeviceFact.ASKS_FOR_KILL), action=ALARM, hold=0.0, clears=Clears.BY_ITSELF
    )
    story = flying(silent)
    story.at(0.1, i.KillRequest(0, "upf_can 33", "why"))
    assert alarms(story) == 1
    story.at(3.0)
    assert "has cleared" in story.said()


def test_the_core_wakes_when_what_a_rule_rests_on_is_too_old():
    story = flying(rule(SINKS, hold=5.0))
    story.fly(0.1, vertical_speed=-14.0)
    deadlines = rule_deadlines(story.config, story.state, START + 0.1)
    assert deadlines == pytest.approx([START + 5.05, START + 1.1])
    story.fly(1.0, vertical_speed=-14.0)
    story.at(30.0)
    assert story.fired() == [], "it counted for a second after the last sample, and no longer"
    assert story.state.rule("tested").level < 5.0
    assert not story.state.rule("tested").holds


def test_a_silence_of_the_autopilot_wakes_the_core_at_its_limit():
    story = flying(rule(AutopilotCondition(AutopilotFact.LOST), action=K))
    story.at(60.0)
    assert story.when(K) == pytest.approx(2.5, abs=1e-5)


# -- modes ---------------------------------------------------------------------------------------


def test_in_shadow_the_whole_logic_runs_and_nothing_is_sent():
    story = Story(with_rules(rule(SINKS, hold=0.3)), mode=i.Mode.SHADOW).flying()
    story.fly(3.0, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    decisions = [d for d in story.decisions() if d.action >= K]
    assert all(d.shadow for d in decisions)
    assert all("counter 0.30 s of 0.3 s" in d.reasons for d in decisions)
    assert [d.targets for d in decisions] == [(LINK,), (LINK,)]
    assert story.state.stage is Stage.IN_FLIGHT
    assert (story.state.killing.kill, story.state.deploying.deploys) == (None, ())


def test_what_was_only_said_in_shadow_is_done_when_active():
    story = Story(with_rules(rule(SINKS, hold=0.3)), mode=i.Mode.SHADOW).flying()
    story.fly(1.0, vertical_speed=-14.0)
    story.at(1.0, i.ModeRequest(1, i.Mode.ACTIVE, force=True))
    story.fly(1.25, vertical_speed=-14.0)
    assert len(story.fired()) == 2
    story.fly(2.0, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY", "KILL", "DEPLOY"]
    assert [d.shadow for d in story.decisions() if d.action >= K] == [True, True, False, False]


def test_inhibited_a_rule_only_counts():
    story = Story(with_rules(rule(SINKS, hold=0.3)), mode=i.Mode.INHIBITED).flying()
    story.fly(3.0, vertical_speed=-14.0)
    assert story.decisions() == []
    assert "wants a deploy" not in story.said()
    assert story.state.rule("tested").level == pytest.approx(0.3)


@pytest.mark.parametrize("follows", [False, True])
def test_a_rule_of_one_that_is_inhibited_or_follows_is_acted_on_once_it_may(follows):
    story = flying(rule(TILTS, action=ALARM))
    if follows:
        story.follows()
    else:
        story.at(0.0, i.ModeRequest(1, i.Mode.INHIBITED, force=True))
    story.fly(0.5, tilt=90.0)
    assert story.alarms() == []
    story.at(0.5, i.TakeOver(9) if follows else i.ModeRequest(2, i.Mode.ACTIVE, force=True))
    story.fly(0.6, tilt=90.0)
    assert len(story.alarms()) == 1


@pytest.mark.parametrize(
    ("outcomes", "stage"),
    [
        ((), Stage.KILLING),
        ((Outcome.CONFIRMED,), Stage.DEPLOYING),
        ((Outcome.CONFIRMED, Outcome.CONFIRMED), Stage.DEPLOYED),
        ((Outcome.CONFIRMED, Outcome.FAILED), Stage.FAULT),
    ],
)
def test_the_mode_is_not_changed_while_something_is_on_its_way_or_was_done(outcomes, stage):
    story = flying()
    story.at(0.1, i.DeployRequest(1, False, "it falls"))
    for action, outcome in zip((K, D), outcomes, strict=False):
        story.at(story.t + 0.1, story.report(action, outcome))
    assert story.state.stage is stage
    story.at(story.t, i.ModeRequest(2, i.Mode.SHADOW, force=False))
    assert not story.answer(2).success


def test_after_a_deploy_only_a_reset_on_the_ground_leads_back():
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


def test_at_rest_the_rules_wake_nobody():
    story = flying(rule(SINKS, hold=1.0), rule(TILTS, clears=Clears.BY_ITSELF, action=ALARM))
    story.fly(1.0)
    story.at(1.0, story.report(Action.FLIGHT_BLOCK_RELEASE, Outcome.CONFIRMED))
    assert next_deadline(story.config, story.state, START + 1.0) >= START + 1.5 - 1e-9


LOW = {"minimum_height": 10.0, "below_minimum": BelowMinimum.NOTHING}


# -- what a rule makes of its conditions ---------------------------------------------------------


def judged(one: Rule, since: float = 2.0, **told: float) -> bool | None:
    """Does it hold where only this is told, and all was told, and showed it, since s ago?"""
    story = Story(with_rules(one))
    story.at(0.0, vehicle(tilt=90.0, vertical_speed=-14.0))
    seen = judge(story.config, story.state, one, START).evidence
    story.at(since, vehicle(**told))
    story.state = replace(story.state, rules={one.name: seen})
    return judge(story.config, story.state, one, START + since).evidence.holds


@pytest.mark.parametrize(
    ("told", "holds"),
    [
        ({"tilt": 90.0, "vertical_speed": -14.0}, True),
        ({"tilt": 90.0}, None),
        ({"vertical_speed": -14.0}, None),
        ({}, None),
        ({"tilt": 5.0}, False),
        ({"tilt": 90.0, "vertical_speed": 0.0}, False),
    ],
)
def test_it_cannot_be_said_while_what_is_not_known_could_be_enough(told, holds):
    assert judged(rule(TILTS, SINKS), **told) is holds


def test_what_was_never_known_is_not_waited_for():
    story = Story(with_rules(one := rule(TILTS, SINKS)))
    story.at(0.0, vehicle(tilt=90.0))
    assert judge(story.config, story.state, one, START).evidence.holds is False


@pytest.mark.parametrize("rounding", [0.0, 1e-9])
def test_weights_that_miss_by_the_rounding_are_enough(rounding):
    one = rule(replace(TILTS, weight=2.0), needed=2.0 + rounding)
    assert judged(one, tilt=90.0) is True
    assert judged(one) is None


@pytest.mark.parametrize(("doubted", "holds"), [(1.0, True), (0.5, False)])
def test_a_sign_in_doubt_counts_for_the_rules_part_of_it(doubted, holds):
    story = Story(with_rules(one := rule(SINKS, doubted=doubted)))
    story.at(0.0, vehicle(vertical_speed=-14.0))
    assert judge(story.config, story.state, one, START).evidence.holds is True
    state = changed(story.state, disputed=frozenset({"vertical_speed"}))
    assert judge(story.config, state, one, START).evidence.holds is holds


@pytest.mark.parametrize(
    ("disputed", "told", "holds"),
    [
        ((), {"vertical_speed": -14.0}, True),
        (("vertical_speed",), {"vertical_speed": -14.0}, False),
        (("vertical_speed",), {"vertical_speed": -14.0, "tilt": 90.0}, True),
        (("attitude",), {"vertical_speed": -14.0, "tilt": 90.0}, True),
        # A sign that does not hold puts none in doubt, whatever is doubted of it.
        (("attitude",), {"vertical_speed": -14.0, "tilt": 5.0}, True),
    ],
)
def test_what_is_only_taken_to_be_so_is_in_doubt_with_what_it_stands_beside(disputed, told, holds):
    """Given a sink, heights that tell no rate, and one more sign."""
    presumed = MeasurementCondition("climb_rate", below=-6.0, if_unknown=True)
    one = rule(SINKS, presumed, TILTS, needed=1.5, doubted=0.5)
    story = Story(with_rules(one))
    story.at(0.0, vehicle(**told))
    state = changed(story.state, disputed=frozenset(disputed))
    assert judge(story.config, state, one, START).evidence.holds is holds


def test_heights_that_tell_a_sink_are_a_whole_sign_beside_one_in_doubt():
    told = MeasurementCondition("climb_rate", below=-6.0, if_unknown=True)
    one = rule(SINKS, told, needed=1.5, doubted=0.5)
    story = Story(with_rules(one))
    for step in range(12):
        story.at(step * 0.1, vehicle(vertical_speed=-14.0 - step * 1e-3, height=90.0 - step))
    state = changed(story.state, disputed=frozenset({"vertical_speed"}))
    judged = judge(story.config, state, one, START + story.t)
    assert "climb_rate -10.00" in judged.findings[1].text
    assert judged.evidence.holds is True


def test_a_rule_is_looked_at_when_a_doubt_of_what_it_rests_on_ends():
    story = flying(rule(SINKS, doubted=0.5))
    jumped = {"vertical_speed": Measured(jumped_at=START)}
    state = changed(story.state, measurements=jumped)
    deadlines = rule_deadlines(story.config, state, START + story.t)
    assert START + JUMP_DOUBTED + JUST_AFTER in deadlines


def test_a_sample_that_is_looked_at_twice_showed_it_once():
    story = Story(with_rules(one := rule(TILTS, SINKS, samples=2, needed=1.0)))
    story.at(0.0, vehicle(tilt=90.0, vertical_speed=0.0))
    for _ in range(3):
        evidence = judge(story.config, story.state, one, START).evidence
        assert (evidence.shown, evidence.seen) == ((1.0, 0.0), (1, 1))
        story.state = replace(story.state, rules={"tested": evidence})


# -- what follows, in words ----------------------------------------------------------------------


def test_an_alarm_says_all_its_reasons_once_and_again_behind_its_words():
    silent = rule(TILTS, SINKS, action=ALARM, name="falls")
    why = "tilt_deg 90.00 (above 60); vertical_speed -14.00 (below -12)"
    story = flying(silent, replace(silent, name="told", says="it falls"))
    story.fly(0.05, tilt=90.0, vertical_speed=-14.0)
    assert story.alarms() == [f"rule 'falls': {why} ({why})", f"rule 'told': it falls ({why})"]


@pytest.mark.parametrize(
    ("height", "why"),
    [
        (9.0, "height 9.0 m is below the minimum 10 m"),
        (math.nan, "it was never seen at the minimum height, 10 m"),
    ],
)
def test_a_denial_is_told_with_all_reasons_and_remembered_with_all_its_words(height, why):
    story = flying(rule(TILTS, SINKS), profile=LOW)
    story.fly(0.05, tilt=90.0, vertical_speed=-14.0, height=height)
    reasons = "tilt_deg 90.00 (above 60); vertical_speed -14.00 (below -12)"
    assert f"rule 'tested' wants a deploy ({reasons}): denied, {why}" in story.said().splitlines()
    assert story.state.rule("tested").denied == why


def test_a_denial_that_is_not_said_again_is_remembered_with_the_newest_height():
    story = flying(rule(SINKS), profile=LOW)
    for height in (9.0, 8.0):
        story.fly(story.t + 0.05, vertical_speed=-14.0, height=height)
        why = f"height {height:.1f} m is below the minimum 10 m"
        assert story.state.rule("tested").denied == why
    assert story.said().count("wants a deploy") == 1
    story.fly(story.t + 0.05, vertical_speed=-14.0, height=11.0)
    assert story.fired() == ["KILL"]
    assert story.state.rule("tested").denied == "", "it was acted on"


def test_the_height_does_not_hide_a_graver_reason_against_a_deploy():
    story = flying(rule(TILTS), profile=LOW)
    story.fly(0.05, tilt=90.0, height=9.0, armed=Armed.DISARMED)
    why = "the motors are disarmed, and nothing says that it falls"
    assert story.state.rule("tested").denied == why


def test_a_rule_of_another_state_does_not_hide_the_next():
    grounded = rule(TILTS, states=(Stage.READY,), name="grounded")
    off = rule(AutopilotCondition(AutopilotFact.DISARMED), action=K, hold=0.7, name="off")
    story = flying(grounded, off)
    story.at(0.1, story.told(armed=Armed.DISARMED))
    deadlines = rule_deadlines(story.config, story.state, START + 0.1)
    assert deadlines == pytest.approx([START + 0.8, START + 2.6])
    story.at(2.0)
    assert story.when(K) == pytest.approx(0.8, abs=1e-5)


def test_no_sample_of_a_measurement_is_awaited_where_one_word_is_enough():
    off = AutopilotCondition(AutopilotFact.DISARMED)
    story = flying(rule(off, TILTS, action=K, needed=1.0, hold=0.2, samples=2))
    story.fly(1.0, armed=Armed.DISARMED, tilt=math.nan)
    assert story.fired() == ["KILL"]
    story = flying(rule(off, action=K, hold=0.2, samples=9))
    story.at(0.1, story.told(armed=Armed.DISARMED))
    story.at(1.0)
    assert story.when(K) == pytest.approx(0.3, abs=1e-5)


# -- when it is done with ------------------------------------------------------------------------


@pytest.mark.parametrize(("clears", "alarms"), [(Clears.NEVER, 1), (Clears.BY_ITSELF, 2)])
def test_after_a_bounce_only_one_that_never_clears_is_still_done_with(clears, alarms):
    story = flying(rule(TILTS, action=ALARM, states=(Stage.IN_FLIGHT,), clears=clears))
    story.fly(0.2, tilt=90.0)
    story.fly(0.4, tilt=90.0, landed_state=LandedState.ON_GROUND)
    assert story.state.stage is Stage.LANDED
    assert story.state.rule("tested").latched is (clears is Clears.NEVER)
    story.fly(0.6, tilt=90.0)
    assert len(story.alarms()) == alarms


def test_one_that_was_acted_on_keeps_its_counter_and_clears_once_that_has_leaked():
    story = flying(rule(TILTS, action=ALARM, hold=0.5, leak=0.5, clears=Clears.BY_ITSELF))
    while not story.alarms():
        story.fly(story.t + 0.05, tilt=90.0)
    assert story.state.rule("tested").level == pytest.approx(0.5)
    story.fly(story.t + 0.9)
    assert "has cleared" not in story.said()
    story.fly(story.t + 0.2)
    assert "rule 'tested' has cleared" in story.said().splitlines()
    assert story.state.rule("tested").latched is False
