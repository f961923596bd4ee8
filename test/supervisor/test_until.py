"""A sign that filled its rule's counter goes on until it is over: `until`."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from story import Story, rule, shipped, with_rules

from chute_ros.model import Action, LinkState
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import MeasurementCondition

LOST = {"link_state": LinkState.LOST}
#: What an IMU alone does not tell; and a tilt that says nothing, as it is in doubt.
IMU_ALONE = {"vertical_speed": math.nan, "height": math.nan, "tilt": 0.0}
#: Falls below 4 for 0.5 s, and then until 8.
FALLS = rule(
    MeasurementCondition("acceleration", below=4.0, until=8.0),
    action=Action.NONE,
    hold=0.5,
    leak=1.0,
)


def flying(profile: str = "multirotor") -> Story:
    return Story(shipped(profile)).ready().fly(0.3)


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize(
    ("lasts", "then", "fires"),
    [
        # It falls, and drag carries it ever more while the silence is waited for.
        (1.2, 5.0, True),
        (1.2, 8.4, True),
        # It was a gust: what flies well is carried again.
        (1.2, 8.6, False),
        (1.2, 9.8, False),
        # The counter was not full.
        (0.6, 5.0, False),
    ],
)
def test_a_fall_that_was_seen_counts_while_drag_carries_less_than_the_weight(
    profile: str, lasts: float, then: float, fires: bool
) -> None:
    """Given an IMU alone, whose force falls as its autopilot falls silent."""
    story = flying(profile)
    story.fly(story.t + lasts, **IMU_ALONE, acceleration=2.0)
    story.fly(story.t + 1.0, **IMU_ALONE, acceleration=then)
    assert story.fired() == []
    story.fly(story.t + 1.0, **IMU_ALONE, **LOST, acceleration=then)
    assert bool(story.fired()) is fires
    if fires:
        reasons = " ".join(story.newest(Action.KILL).reasons)
        assert f"acceleration {then:.2f}" in reasons
        assert ", then until 8.5)" in reasons


def test_once_carried_it_must_fall_for_long_again() -> None:
    story = flying().fly(1.6, **IMU_ALONE, acceleration=2.0)
    story.fly(story.t + 0.1, **IMU_ALONE, acceleration=9.8)
    story.fly(story.t + 1.0, **IMU_ALONE, **LOST, acceleration=5.0)
    assert story.fired() == []
    story.fly(story.t + 1.0, **IMU_ALONE, **LOST, acceleration=2.0)
    assert story.fired()[0] == "KILL"


def test_what_has_been_kept_is_kept_with_its_counter() -> None:
    story = Story(with_rules(FALLS)).flying()
    name = FALLS.name

    def fly(seconds: float, force: float) -> None:
        story.fly(story.t + seconds, acceleration=force)

    fly(0.4, 3.0)
    assert story.state.rule(name).kept == ()
    fly(0.2, 3.0)
    assert story.state.rule(name).kept == (True,)
    fly(1.0, 7.0)
    evidence = story.state.rule(name)
    assert (evidence.level, evidence.holds, evidence.kept) == (0.5, True, (True,))
    fly(0.05, 8.5)
    assert story.state.rule(name).holds is False
    fly(0.05, 7.0)
    evidence = story.state.rule(name)
    assert (evidence.holds, evidence.kept) == (False, ())
    assert evidence.level == pytest.approx(0.45)


@pytest.mark.parametrize(("slept", "goes_on"), [(0.1, True), (2.0, False)])
def test_a_counter_that_was_emptied_has_kept_nothing(slept: float, goes_on: bool) -> None:
    """Given a supervisor that sleeps for longer than half of the silence that it waits for."""
    name = "autopilot lost and falling"
    story = flying().fly(1.6, **IMU_ALONE, acceleration=2.0)
    told = {**IMU_ALONE, **LOST, "acceleration": 5.0}
    story._update((story.heartbeat(), story.told(**told)), story.t + slept)
    evidence = story.state.rule(name)
    assert (evidence.level > 0.0, evidence.kept != ()) == (goes_on, goes_on)
    assert (evidence.holds is not False) is goes_on
    story.fly(story.t + 2.0, **told)
    assert bool(story.fired()) is goes_on


def test_a_counter_that_leaks_has_kept_nothing() -> None:
    """Given two signs, of which the second ends for a moment while the first goes on."""
    both = replace(
        FALLS,
        conditions=(*FALLS.conditions, MeasurementCondition("tilt_deg", above=45.0)),
        needed=2.0,
    )
    story = Story(with_rules(both)).flying()
    story.fly(story.t + 0.7, acceleration=3.0, tilt=60.0)
    story.fly(story.t + 0.05, acceleration=7.0, tilt=60.0)
    assert story.state.rule(both.name).holds is True
    story.fly(story.t + 0.05, acceleration=7.0, tilt=10.0)
    assert story.state.rule(both.name).holds is False
    story.fly(story.t + 0.05, acceleration=7.0, tilt=60.0)
    evidence = story.state.rule(both.name)
    assert (evidence.holds, evidence.kept) == (False, ())


def test_where_nothing_is_told_nothing_goes_on() -> None:
    story = Story(with_rules(FALLS)).flying()
    story.fly(story.t + 0.7, acceleration=3.0)
    story.fly(story.t + 0.7, acceleration=math.nan)
    assert story.state.rule(FALLS.name).kept != (True,)
    story.fly(story.t + 0.1, acceleration=7.0)
    assert story.state.rule(FALLS.name).holds is False


def test_another_rule_of_the_name_has_kept_nothing() -> None:
    story = Story(with_rules(FALLS)).flying()
    story.fly(story.t + 0.7, acceleration=3.0)
    two = replace(FALLS, conditions=FALLS.conditions * 2, needed=1.0)
    other = Story(with_rules(two)).flying()
    other.state = replace(other.state, rules=story.state.rules, stage=Stage.IN_FLIGHT)
    other.fly(other.t + 0.1, acceleration=7.0)
    assert other.state.rule(FALLS.name).holds is False
