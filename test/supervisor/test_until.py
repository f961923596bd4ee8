"""A sign that filled its rule's counter goes on until it is over: `until`."""

import math
from dataclasses import replace

import pytest
from story import Story, rule, shipped, with_rules

from chute_ros.model import Action, LinkState
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.counter import LINGERS
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import Rule

LOST = {"link_state": LinkState.LOST}
#: What an IMU alone does not tell; and a tilt that says nothing, as it is in doubt.
IMU_ALONE = {"vertical_speed": math.nan, "height": math.nan, "tilt": 0.0}
LOST_AND_FALLING = "autopilot lost and falling"
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
    profile, lasts, then, fires
):
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


def test_once_carried_it_must_fall_for_long_again():
    story = flying().fly(1.6, **IMU_ALONE, acceleration=2.0)
    story.fly(story.t + 0.1, **IMU_ALONE, acceleration=9.8)
    story.fly(story.t + 1.0, **IMU_ALONE, **LOST, acceleration=5.0)
    assert story.fired() == []
    story.fly(story.t + 1.0, **IMU_ALONE, **LOST, acceleration=2.0)
    assert story.fired()[0] == "KILL"


def test_what_has_been_kept_is_kept_with_its_counter():
    story = Story(with_rules(FALLS)).flying()
    name = FALLS.name

    def fly(seconds: float, force: float) -> None:
        story.fly(story.t + seconds, acceleration=force)

    fly(0.4, 3.0)
    assert story.state.rule(name).kept == ()
    fly(0.2, 3.0)
    assert story.state.rule(name).kept == (LINGERS,)
    fly(1.0, 7.0)
    evidence = story.state.rule(name)
    assert (evidence.level, evidence.holds) == (0.5, True)
    assert evidence.kept == (pytest.approx(LINGERS - 1.0, abs=0.05),)
    fly(0.05, 8.5)
    assert story.state.rule(name).holds is False
    fly(0.05, 7.0)
    evidence = story.state.rule(name)
    assert (evidence.holds, evidence.kept) == (False, ())
    assert evidence.level == pytest.approx(0.45)


@pytest.mark.parametrize(("slept", "goes_on"), [(0.1, True), (2.0, False)])
def test_a_counter_that_was_emptied_has_kept_nothing(slept, goes_on):
    """Given a supervisor that sleeps for longer than half of the silence that it waits for."""
    name = LOST_AND_FALLING
    story = flying().fly(1.6, **IMU_ALONE, acceleration=2.0)
    told = {**IMU_ALONE, **LOST, "acceleration": 5.0}
    story._update((story.heartbeat(), story.told(**told)), story.t + slept)
    evidence = story.state.rule(name)
    assert (evidence.level > 0.0, evidence.kept != ()) == (goes_on, goes_on)
    assert (evidence.holds is not False) is goes_on
    story.fly(story.t + 2.0, **told)
    assert bool(story.fired()) is goes_on


def beside_tilt(needed: float) -> Rule:
    """FALLS, with a tilt as another sign."""
    tilted = MeasurementCondition("tilt_deg", above=45.0)
    return replace(FALLS, conditions=(*FALLS.conditions, tilted), needed=needed)


def test_what_is_kept_outlasts_a_leak_and_ends_with_an_empty_counter():
    """Given two signs, of which the second ends while the first goes on."""
    both = beside_tilt(2.0)
    story = Story(with_rules(both)).flying()
    story.fly(story.t + 0.7, acceleration=3.0, tilt=60.0)
    story.fly(story.t + 0.2, acceleration=7.0, tilt=10.0)
    assert story.state.rule(both.name).holds is False
    story.fly(story.t + 0.05, acceleration=7.0, tilt=60.0)
    assert story.state.rule(both.name).holds is True
    story.fly(story.t + 0.6, acceleration=7.0, tilt=10.0)
    evidence = story.state.rule(both.name)
    assert (evidence.level, evidence.kept) == (0.0, ())
    story.fly(story.t + 0.05, acceleration=7.0, tilt=60.0)
    assert story.state.rule(both.name).holds is False


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize(
    "word",
    [{"acceleration": math.nan}, {"acceleration": 0.0}, {"age": 0.3}],
    ids=["not told", "in doubt", "late"],
)
def test_one_word_that_says_nothing_ends_nothing(profile, word):
    """Given a fall that an IMU saw, and one word of it that is of no use."""
    story = flying(profile)
    story.fly(story.t + 1.3, **IMU_ALONE, acceleration=2.0)
    story.fly(story.t + 0.3, **IMU_ALONE, acceleration=5.0)
    story.fly(story.t + 0.05, **{**IMU_ALONE, "acceleration": 5.0, **word})
    story.fly(story.t + 0.3, **IMU_ALONE, acceleration=5.0)
    assert story.fired() == []
    story.fly(story.t + 3.0, **IMU_ALONE, **LOST, acceleration=5.0)
    assert story.fired()[0] == "KILL"


def test_a_gap_ends_nothing():
    story = flying().fly(1.6, **IMU_ALONE, acceleration=2.0)
    story.fly(story.t + 0.2, **IMU_ALONE, acceleration=5.0)
    story.fly(story.t + 1.0, **{**IMU_ALONE, "acceleration": math.nan})
    story.fly(story.t + 1.0, **IMU_ALONE, **LOST, acceleration=5.0)
    assert story.fired()[0] == "KILL"


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize("force", [2.5, 0.0], ids=["wrong", "in doubt"])
def test_one_sample_keeps_nothing_of_a_counter_that_another_sign_filled(profile, force):
    """Given a vehicle that banks for long, beside one wrong word of its force."""
    story = flying(profile)
    story.fly(story.t + 1.5, **{**IMU_ALONE, "tilt": 75.0}, acceleration=9.8)
    story.fly(story.t + 0.05, **{**IMU_ALONE, "tilt": 75.0}, acceleration=force)
    story.fly(story.t + 1.0, **IMU_ALONE, acceleration=8.0)
    story.fly(story.t + 1.0, **IMU_ALONE, **LOST, acceleration=8.0)
    assert story.fired() == []


def test_it_goes_on_for_five_seconds():
    """Given a force that is told too small for the whole flight, and was a fall's for a while."""
    story = flying().fly(1.6, **IMU_ALONE, acceleration=2.0)
    story.fly(story.t + LINGERS - 0.1, **IMU_ALONE, acceleration=8.4)
    assert story.state.rule(LOST_AND_FALLING).kept != ()
    story.fly(story.t + 0.2, **IMU_ALONE, acceleration=8.4)
    assert story.state.rule(LOST_AND_FALLING).kept == ()
    story.fly(story.t + 3.0, **IMU_ALONE, **LOST, acceleration=8.4)
    assert story.fired() == []


def test_what_is_only_taken_to_be_so_keeps_nothing():
    """Given a force that is not told, and a sign that fills the counter."""
    presumed = replace(FALLS.conditions[0], if_unknown=True)
    both = beside_tilt(1.0)
    both = replace(both, conditions=(presumed, both.conditions[1]))
    story = Story(with_rules(both)).flying()
    story.fly(story.t + 0.7, acceleration=math.nan, tilt=60.0)
    story.fly(story.t + 0.1, acceleration=7.5, tilt=10.0)
    assert story.state.rule(both.name).holds is False


def test_another_rule_of_the_name_has_kept_nothing():
    story = Story(with_rules(FALLS)).flying()
    story.fly(story.t + 0.7, acceleration=3.0)
    two = replace(FALLS, conditions=FALLS.conditions * 2, needed=1.0)
    other = Story(with_rules(two)).flying()
    other.state = replace(other.state, rules=story.state.rules, stage=Stage.IN_FLIGHT)
    other.fly(other.t + 0.1, acceleration=7.0)
    assert other.state.rule(FALLS.name).holds is False
