"""The rules at work, word for word and at their limits."""

import math
from dataclasses import replace
from typing import Any

import pytest
from story import SINKS, START, TILTS, Story, rule, vehicle, with_rules

from chute_ros.model import Action, Armed, LandedState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.base import JUST_AFTER
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import JUMP_DOUBTED, Measured
from chute_ros.supervisor.policy import judge, rule_deadlines
from chute_ros.supervisor.rules import BelowMinimum, Clears, Rule

K, ALARM = Action.KILL, Action.NONE
LOW = {"minimum_height": 10.0, "below_minimum": BelowMinimum.NOTHING}


def flying(*rules: Rule, **profile: Any) -> Story:
    return Story(with_rules(*rules, profile=profile)).flying()


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
def test_it_cannot_be_said_while_what_is_not_known_could_be_enough(
    told: dict[str, float], holds: bool | None
) -> None:
    assert judged(rule(TILTS, SINKS), **told) is holds


def test_what_was_never_known_is_not_waited_for() -> None:
    story = Story(with_rules(one := rule(TILTS, SINKS)))
    story.at(0.0, vehicle(tilt=90.0))
    assert judge(story.config, story.state, one, START).evidence.holds is False


@pytest.mark.parametrize("rounding", [0.0, 1e-9])
def test_weights_that_miss_by_the_rounding_are_enough(rounding: float) -> None:
    one = rule(replace(TILTS, weight=2.0), needed=2.0 + rounding)
    assert judged(one, tilt=90.0) is True
    assert judged(one) is None


@pytest.mark.parametrize(("doubted", "holds"), [(1.0, True), (0.5, False)])
def test_a_sign_in_doubt_counts_for_the_rules_part_of_it(doubted: float, holds: bool) -> None:
    story = Story(with_rules(one := rule(SINKS, doubted=doubted)))
    story.at(0.0, vehicle(vertical_speed=-14.0))
    assert judge(story.config, story.state, one, START).evidence.holds is True
    state = replace(
        story.state, heard=replace(story.state.heard, disputed=frozenset({"vertical_speed"}))
    )
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
def test_what_is_only_taken_to_be_so_is_in_doubt_with_what_it_stands_beside(
    disputed: tuple[str, ...], told: dict[str, float], holds: bool
) -> None:
    """Given a sink, heights that tell no rate, and one more sign."""
    presumed = MeasurementCondition("climb_rate", below=-6.0, if_unknown=True)
    one = rule(SINKS, presumed, TILTS, needed=1.5, doubted=0.5)
    story = Story(with_rules(one))
    story.at(0.0, vehicle(**told))
    state = replace(story.state, heard=replace(story.state.heard, disputed=frozenset(disputed)))
    assert judge(story.config, state, one, START).evidence.holds is holds


def test_heights_that_tell_a_sink_are_a_whole_sign_beside_one_in_doubt() -> None:
    told = MeasurementCondition("climb_rate", below=-6.0, if_unknown=True)
    one = rule(SINKS, told, needed=1.5, doubted=0.5)
    story = Story(with_rules(one))
    for step in range(12):
        story.at(step * 0.1, vehicle(vertical_speed=-14.0 - step * 1e-3, height=90.0 - step))
    state = replace(
        story.state, heard=replace(story.state.heard, disputed=frozenset({"vertical_speed"}))
    )
    judged = judge(story.config, state, one, START + story.t)
    assert "climb_rate -10.00" in judged.findings[1].text
    assert judged.evidence.holds is True


def test_a_rule_is_looked_at_when_a_doubt_of_what_it_rests_on_ends() -> None:
    story = flying(rule(SINKS, doubted=0.5))
    jumped = {"vertical_speed": Measured(jumped_at=START)}
    state = replace(story.state, heard=replace(story.state.heard, measurements=jumped))
    assert START + JUMP_DOUBTED + JUST_AFTER in rule_deadlines(
        story.config, state, START + story.t
    )


def test_a_sample_that_is_looked_at_twice_showed_it_once() -> None:
    story = Story(with_rules(one := rule(TILTS, SINKS, samples=2, needed=1.0)))
    story.at(0.0, vehicle(tilt=90.0, vertical_speed=0.0))
    for _ in range(3):
        evidence = judge(story.config, story.state, one, START).evidence
        assert (evidence.shown, evidence.seen) == ((1.0, 0.0), (1, 1))
        story.state = replace(story.state, rules={"tested": evidence})


# -- what follows, in words ----------------------------------------------------------------------


def test_an_alarm_says_all_its_reasons_once_and_again_behind_its_words() -> None:
    silent = rule(TILTS, SINKS, action=ALARM, name="falls")
    why = "tilt_deg 90.00 (above 60); vertical_speed -14.00 (below -12)"
    story = flying(silent, replace(silent, name="told", says="it falls"))
    story.fly(0.05, tilt=90.0, vertical_speed=-14.0)
    assert story.alarms() == [f"rule 'falls': {why} ({why})", f"rule 'told': it falls ({why})"]


def test_a_kill_names_its_rule_and_its_reasons() -> None:
    story = flying(rule(SINKS, action=K, name="sinks")).fly(0.05, vertical_speed=-14.0)
    kill = story.newest(K)
    assert (kill.rule, kill.reasons) == ("sinks", ("vertical_speed -14.00 (below -12)",))


@pytest.mark.parametrize(
    ("height", "why"),
    [
        (9.0, "height 9.0 m is below the minimum 10 m"),
        (math.nan, "it was never seen at the minimum height, 10 m"),
    ],
)
def test_a_denial_is_told_with_all_reasons_and_remembered_with_all_its_words(
    height: float, why: str
) -> None:
    story = flying(rule(TILTS, SINKS), **LOW)
    story.fly(0.05, tilt=90.0, vertical_speed=-14.0, height=height)
    reasons = "tilt_deg 90.00 (above 60); vertical_speed -14.00 (below -12)"
    assert f"rule 'tested' wants a deploy ({reasons}): denied, {why}" in story.said().splitlines()
    assert story.state.rule("tested").denied == why


def test_a_denial_that_is_not_said_again_is_remembered_with_the_newest_height() -> None:
    story = flying(rule(SINKS), **LOW)
    for height in (9.0, 8.0):
        story.fly(story.t + 0.05, vertical_speed=-14.0, height=height)
        why = f"height {height:.1f} m is below the minimum 10 m"
        assert story.state.rule("tested").denied == why
    assert story.said().count("wants a deploy") == 1
    story.fly(story.t + 0.05, vertical_speed=-14.0, height=11.0)
    assert story.fired() == ["KILL"]
    assert story.state.rule("tested").denied == "", "it was acted on"


def test_the_height_does_not_hide_a_graver_reason_against_a_deploy() -> None:
    story = flying(rule(TILTS), **LOW)
    story.fly(0.05, tilt=90.0, height=9.0, armed=Armed.DISARMED)
    why = "the motors are disarmed, and nothing says that it falls"
    assert story.state.rule("tested").denied == why


# -- who acts ------------------------------------------------------------------------------------


def test_an_inhibited_rule_warns_nobody_and_is_acted_on_once_it_may() -> None:
    story = flying(rule(TILTS, action=ALARM))
    story.at(0.0, i.ModeRequest(1, i.Mode.INHIBITED, force=True))
    story.fly(0.5, tilt=90.0)
    assert story.alarms() == []
    story.at(0.5, i.ModeRequest(2, i.Mode.ACTIVE, force=True))
    story.fly(0.6, tilt=90.0)
    assert len(story.alarms()) == 1


def test_one_that_follows_leaves_a_rule_to_the_one_that_leads() -> None:
    story = flying(rule(TILTS, action=ALARM))
    story.state = replace(story.state, own=replace(story.state.own, leading=False))
    story.fly(0.5, tilt=90.0)
    assert story.alarms() == []
    story.at(0.5, i.TakeOver(9))
    story.fly(0.6, tilt=90.0)
    assert len(story.alarms()) == 1


def test_a_rule_of_another_state_does_not_hide_the_next() -> None:
    grounded = rule(TILTS, states=(Stage.READY,), name="grounded")
    off = rule(AutopilotCondition(AutopilotFact.DISARMED), action=K, hold=0.7, name="off")
    story = flying(grounded, off)
    story.at(0.1, story.told(armed=Armed.DISARMED))
    deadlines = rule_deadlines(story.config, story.state, START + 0.1)
    assert deadlines == pytest.approx([START + 0.8, START + 2.6])
    story.at(2.0)
    assert story.when(K) == pytest.approx(0.8, abs=1e-5)


def test_a_rule_is_looked_at_again_when_what_it_rests_on_is_too_old() -> None:
    story = flying(rule(SINKS, hold=5.0))
    story.fly(0.1, vertical_speed=-14.0)
    deadlines = rule_deadlines(story.config, story.state, START + 0.1)
    assert deadlines == pytest.approx([START + 5.05, START + 1.1])


def test_where_one_word_is_enough_no_sample_of_a_measurement_is_awaited() -> None:
    off = AutopilotCondition(AutopilotFact.DISARMED)
    story = flying(rule(off, TILTS, action=K, needed=1.0, hold=0.2, samples=2))
    story.fly(1.0, armed=Armed.DISARMED, tilt=math.nan)
    assert story.fired() == ["KILL"]


def test_a_rule_that_rests_on_no_measurement_waits_for_no_samples() -> None:
    off = AutopilotCondition(AutopilotFact.DISARMED)
    story = flying(rule(off, action=K, hold=0.2, samples=9))
    story.at(0.1, story.told(armed=Armed.DISARMED))
    story.at(1.0)
    assert story.when(K) == pytest.approx(0.3, abs=1e-5)


# -- when it is done with ------------------------------------------------------------------------


@pytest.mark.parametrize(("clears", "alarms"), [(Clears.NEVER, 1), (Clears.BY_ITSELF, 2)])
def test_after_a_bounce_only_one_that_never_clears_is_still_done_with(
    clears: Clears, alarms: int
) -> None:
    story = flying(rule(TILTS, action=ALARM, states=(Stage.IN_FLIGHT,), clears=clears))
    story.fly(0.2, tilt=90.0)
    story.fly(0.4, tilt=90.0, landed_state=LandedState.ON_GROUND)
    assert story.state.stage is Stage.LANDED
    assert story.state.rule("tested").latched is (clears is Clears.NEVER)
    story.fly(0.6, tilt=90.0)
    assert len(story.alarms()) == alarms


def test_one_that_was_acted_on_keeps_its_counter_and_clears_once_that_has_leaked() -> None:
    story = flying(rule(TILTS, action=ALARM, hold=0.5, leak=0.5, clears=Clears.BY_ITSELF))
    while not story.alarms():
        story.fly(story.t + 0.05, tilt=90.0)
    assert story.state.rule("tested").level == pytest.approx(0.5)
    story.fly(story.t + 0.9)
    assert "has cleared" not in story.said()
    story.fly(story.t + 0.2)
    assert "rule 'tested' has cleared" in story.said().splitlines()
    assert story.state.rule("tested").latched is False
