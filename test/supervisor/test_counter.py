"""The leaky counter: up while it holds, down while not, never reset by one good sample."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import SINKS, TILTS, Story, rule, shipped, with_rules

from chute_ros.supervisor.counter import Look, RuleEvidence
from chute_ros.supervisor.rules import Rule

#: Full after 1 s, empty again after 2 s, and three samples must have shown it.
RULE = rule(SINKS, hold=1.0, leak=0.5, samples=3)


def counted(pattern: str, one: Rule = RULE, every: float = 0.1) -> list[RuleEvidence]:
    """After each look at it: "x" a bad sample, "." a good one, "-" no new sample."""
    evidence, seen, told = RuleEvidence(), 0, []
    for n, mark in enumerate(pattern):
        evidence = evidence.counted(one, every) if n else evidence
        seen += mark != "-"
        holds = evidence.holds if mark == "-" else mark == "x"
        evidence = evidence.seeing(one, [Look(holds, seen)])
        told.append(evidence)
    return told


def fulfilled(pattern: str, one: Rule = RULE) -> list[int]:
    """At which looks it was fulfilled."""
    return [n for n, evidence in enumerate(counted(pattern, one)) if evidence.fulfilled(one)]


def test_it_is_full_when_it_has_held_for_so_long_and_not_before() -> None:
    assert fulfilled("xxxxxxxxxx") == []
    assert fulfilled("xxxxxxxxxxx") == [10]


def test_a_good_sample_does_not_reset_it() -> None:
    # Full at 1.0 s of bad samples; the good one costs 0.05 s of leak, which one more look pays.
    assert fulfilled("xxxxxxxx.xxxx") == [12]
    assert counted("xxxxxxxx.")[-1].level == pytest.approx(0.8)
    assert counted("xxxxxxxx.x")[-1].level == pytest.approx(0.75)


def test_it_leaks_to_nothing_and_not_below() -> None:
    levels = [one.level for one in counted("xx.........x")]
    assert levels[2] == pytest.approx(0.2)
    assert levels[6] == pytest.approx(0.0)
    assert min(levels) == 0.0
    assert levels[-1] == 0.0


def test_it_does_not_count_beyond_full_so_that_it_leaks_at_once() -> None:
    assert counted("x" * 100)[-1].level == 1.0
    assert counted("x" * 100 + "..")[-1].level == pytest.approx(0.95)


def test_full_alone_is_not_enough_it_must_hold_now() -> None:
    assert fulfilled("x" * 11 + ".") == [10]


def test_one_sample_told_for_long_is_not_three() -> None:
    assert fulfilled("x" + "-" * 30) == []
    assert fulfilled("x" + "-" * 30 + "x-x") == [33]


def test_a_sample_that_denies_it_takes_the_leak_of_one_away() -> None:
    assert counted("xx.")[-1].shown == (1.5,)
    assert counted("xx...")[-1].shown == (0.5,)
    assert counted("xx......")[-1].shown == (0.0,)
    assert counted("x" * 9 + ".")[-1].shown == (2.5,), "it holds no more than are needed"
    assert fulfilled("xxx.xx.xx.xx.xxxx") == [16], "two of three are enough"


def test_samples_of_another_condition_do_not_count_for_it() -> None:
    both = rule(SINKS, TILTS, samples=3)
    evidence = RuleEvidence()
    for n in range(10):
        # One sample says that it sinks, and no more come; tilt comes all the time.
        evidence = evidence.seeing(both, [Look(True, 1), Look(True, n)])
        assert evidence.holds
        assert not evidence.fulfilled(both)
    for n in (2, 3):
        evidence = evidence.seeing(both, [Look(True, n), Look(True, 9)])
    assert evidence.fulfilled(both)


def test_what_was_shown_before_the_rule_held_counts() -> None:
    """A battery tells once a second; a fall must not wait for three more."""
    both = rule(SINKS, TILTS, samples=3)
    evidence = RuleEvidence()
    for n in range(3):
        evidence = evidence.seeing(both, [Look(False, n), Look(True, n)])
    assert evidence.holds is False
    for n in range(3, 6):
        assert not evidence.fulfilled(both)
        evidence = evidence.seeing(both, [Look(True, n), Look(True, 2)])
    assert evidence.fulfilled(both)


def test_one_wrong_sample_beside_a_battery_that_is_dead_fires_nothing() -> None:
    story = Story(shipped("multirotor")).ready().fly(2.0, battery_remaining=0.04)
    story.fly(2.05, battery_remaining=0.04, vertical_speed=-8.0)
    silent = {"vertical_speed": math.nan, "vertical_speed_age": math.nan}
    story.fly(3.5, battery_remaining=0.04, **silent)
    assert story.fired() == []


def test_a_rule_of_the_same_name_with_other_conditions_begins_anew() -> None:
    before = counted("x" * 20)[-1]
    other = rule(SINKS, TILTS, hold=1.0, samples=3)
    assert before.seeing(other, [Look(True, 50), Look(True, 50)]).shown == (1.0, 1.0)


def test_what_rests_on_no_measurement_needs_no_samples() -> None:
    evidence = RuleEvidence()
    for _ in range(12):
        evidence = evidence.counted(RULE, 0.1).seeing(RULE, [Look(True, -1)])
    assert evidence.fulfilled(RULE)


def test_without_a_hold_it_is_fulfilled_at_once() -> None:
    assert fulfilled("x", rule(SINKS)) == [0]


def test_it_has_cleared_once_it_is_empty_and_does_not_hold() -> None:
    evidence = counted("x" * 11)[-1]
    assert not evidence.cleared()
    assert not evidence.seeing(RULE, [Look(False, 99)]).cleared()
    assert counted("x" * 11 + "." * 22)[-1].cleared()


def test_it_wakes_the_core_when_it_will_be_full_and_when_empty_but_at_rest_never() -> None:
    half = counted("x" + "-" * 5)[-1]
    assert half.deadline(RULE, 7.0) == pytest.approx(7.5)
    assert counted("x" * 13)[-1].deadline(RULE, 7.0) == math.inf
    leaking = RuleEvidence(level=0.5, latched=True)
    assert leaking.deadline(RULE, 7.0) == pytest.approx(8.0)
    assert RuleEvidence(level=0.5).deadline(RULE, 7.0) == math.inf
    assert RuleEvidence(latched=True).deadline(RULE, 7.0) == math.inf
    never_leaks = rule(SINKS, hold=1.0, leak=0.0)
    assert leaking.deadline(never_leaks, 7.0) == math.inf


@given(
    st.lists(st.tuples(st.floats(0.0, 2.0), st.booleans()), max_size=40),
    st.floats(0.0, 3.0),
    st.floats(0.0, 2.0),
)
def test_its_level_is_that_of_the_seconds_told_and_stays_between_empty_and_full(
    told: list[tuple[float, bool]], hold: float, leak: float
) -> None:
    one = rule(SINKS, hold=hold, leak=leak)
    evidence, level = RuleEvidence(), 0.0
    for seen, (passed, holds) in enumerate(told):
        level += passed if evidence.holds else -leak * passed
        level = min(max(level, 0.0), hold)
        evidence = evidence.counted(one, passed).seeing(one, [Look(holds, seen)])
        assert evidence.level == pytest.approx(level)
        assert 0.0 <= evidence.level <= hold
        if evidence.fulfilled(one):
            assert holds
            assert level >= hold - 1e-5


@given(st.lists(st.booleans(), min_size=1, max_size=30), st.floats(0.0, 1.0))
def test_more_bad_samples_never_make_it_less_likely(bad: list[bool], leak: float) -> None:
    one = rule(SINKS, hold=1.0, leak=leak)
    before = counted("".join("x" if b else "." for b in bad), one)
    for n in range(len(bad)):
        worse = [*bad[:n], True, *bad[n + 1 :]]
        after = counted("".join("x" if b else "." for b in worse), one)
        assert after[-1].level >= before[-1].level - 1e-9


def test_an_attitude_that_swings_through_the_upright_is_counted_all_the_same() -> None:
    story = Story(with_rules(rule(SINKS, hold=0.5, leak=0.5, samples=3))).flying()
    for _ in range(10):
        story.fly(story.t + 0.2, vertical_speed=-14.0)
        story.fly(story.t + 0.05, vertical_speed=-11.0)
    # Each round counts 0.2 s up and leaks 0.025 s.
    assert story.fired()[:2] == ["KILL", "DEPLOY"]
    assert story.when(story.decisions()[-1].action) < 1.5


def test_while_nobody_looked_nothing_is_counted() -> None:
    story = Story(with_rules(rule(SINKS, hold=1.0))).flying()
    story.fly(0.1, vertical_speed=-14.0)
    story._update((story.told(vertical_speed=-14.0),), 3.0)  # 2.9 s without a look
    assert story.fired() == []
    assert "silence meanwhile does not count" in story.said()


def noisy(sink: list[bool | None]) -> list[float]:
    """The levels where every fifth attitude is bad, each 20 ms, and the sink is what is told."""
    either = rule(TILTS, SINKS, needed=1.0, hold=0.5, leak=1.0, samples=2)
    evidence, shown, levels = RuleEvidence(), 0, []
    for n, holds in enumerate(sink):
        shown += holds is not None
        evidence = evidence.counted(either, 0.02).seeing(
            either, [Look(n % 5 == 4, n + 1), Look(holds, shown)]
        )
        levels.append(evidence.level)
    return levels


def test_what_cannot_be_said_keeps_what_it_has_shown() -> None:
    levels = noisy([True] * 10 + [None] * 40)
    assert levels[10:15] == pytest.approx([0.2] * 5)
    assert levels[-1] == pytest.approx(0.34)


def test_what_cannot_be_said_and_had_shown_nothing_keeps_nothing() -> None:
    """Else the few bad ones of a sensor that is noise add up beside one that is silent."""
    assert max(noisy([False] * 10 + [None] * 200)) <= 0.02 + 1e-9
