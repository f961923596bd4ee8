"""The leaky counter: up while it holds, down while not, never reset by one good sample."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import SINKS, TILTS, Story, rule, shipped, with_rules

from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.counter import UNKNOWN_STANDS, Look, RuleEvidence
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


@pytest.mark.parametrize(
    ("pattern", "at"),
    [
        # When it has held for so long, and not before.
        ("xxxxxxxxxx", []),
        ("xxxxxxxxxxx", [10]),
        # Full alone is not enough: it must hold now.
        ("x" * 11 + ".", [10]),
        # One sample told for long is not three.
        ("x" + "-" * 30, []),
        ("x" + "-" * 30 + "x-x", [33]),
    ],
)
def test_it_is_fulfilled_when_it_is_full_of_enough_samples(pattern, at):
    assert fulfilled(pattern) == at


def test_without_a_hold_it_is_fulfilled_at_once_and_without_measurements_without_samples():
    assert fulfilled("x", rule(SINKS)) == [0]
    evidence = RuleEvidence()
    for _ in range(12):
        evidence = evidence.counted(RULE, 0.1).seeing(RULE, [Look(True, -1)])
    assert evidence.fulfilled(RULE)


def test_a_good_sample_does_not_reset_it():
    # Full at 1.0 s of bad samples; the good one costs 0.05 s of leak, which one more look pays.
    assert fulfilled("xxxxxxxx.xxxx") == [12]
    assert counted("xxxxxxxx.")[-1].level == pytest.approx(0.8)
    assert counted("xxxxxxxx.x")[-1].level == pytest.approx(0.75)


def test_it_leaks_to_nothing_and_not_below():
    levels = [one.level for one in counted("xx.........x")]
    assert levels[2] == pytest.approx(0.2)
    assert levels[6] == pytest.approx(0.0)
    assert min(levels) == 0.0
    assert levels[-1] == 0.0


def test_it_does_not_count_beyond_full_so_that_it_leaks_at_once():
    assert counted("x" * 100)[-1].level == 1.0
    assert counted("x" * 100 + "..")[-1].level == pytest.approx(0.95)


def test_a_sample_that_denies_it_takes_the_leak_of_one_away():
    assert counted("xx.")[-1].shown == (1.5,)
    assert counted("xx...")[-1].shown == (0.5,)
    assert counted("xx......")[-1].shown == (0.0,)
    assert counted("x" * 9 + ".")[-1].shown == (2.5,), "it holds no more than are needed"
    assert fulfilled("xxx.xx.xx.xx.xxxx") == [16], "two of three are enough"


def test_samples_of_another_condition_do_not_count_for_it():
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


def test_what_was_shown_before_the_rule_held_counts():
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


def test_one_wrong_sample_beside_a_battery_that_is_dead_fires_nothing():
    story = Story(shipped("multirotor")).ready().fly(2.0, battery_remaining=0.04)
    story.fly(2.05, battery_remaining=0.04, vertical_speed=-8.0)
    silent = {"vertical_speed": math.nan, "vertical_speed_age": math.nan}
    story.fly(3.5, battery_remaining=0.04, **silent)
    assert story.fired() == []


def test_a_rule_of_the_same_name_with_other_conditions_begins_anew():
    before = counted("x" * 20)[-1]
    other = rule(SINKS, TILTS, hold=1.0, samples=3)
    assert before.seeing(other, [Look(True, 50), Look(True, 50)]).shown == (1.0, 1.0)


def test_it_has_cleared_once_it_is_empty_and_does_not_hold():
    evidence = counted("x" * 11)[-1]
    assert not evidence.cleared()
    assert not evidence.seeing(RULE, [Look(False, 99)]).cleared()
    assert counted("x" * 11 + "." * 22)[-1].cleared()


def test_it_wakes_the_core_when_it_will_be_full_and_when_empty_but_at_rest_never():
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
def test_its_level_is_that_of_the_seconds_told_and_stays_between_empty_and_full(told, hold, leak):
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
def test_more_bad_samples_never_make_it_less_likely(bad, leak):
    one = rule(SINKS, hold=1.0, leak=leak)
    before = counted("".join("x" if b else "." for b in bad), one)
    for n in range(len(bad)):
        worse = [*bad[:n], True, *bad[n + 1 :]]
        after = counted("".join("x" if b else "." for b in worse), one)
        assert after[-1].level >= before[-1].level - 1e-9


def test_an_attitude_that_swings_through_the_upright_is_counted_all_the_same():
    story = Story(with_rules(rule(SINKS, hold=0.5, leak=0.5, samples=3))).flying()
    for _ in range(10):
        story.fly(story.t + 0.2, vertical_speed=-14.0)
        story.fly(story.t + 0.05, vertical_speed=-11.0)
    # Each round counts 0.2 s up and leaks 0.025 s.
    assert story.fired()[:2] == ["KILL", "DEPLOY"]
    assert story.when(story.decisions()[-1].action) < 1.5


def test_while_nobody_looked_nothing_is_counted():
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


def test_what_cannot_be_said_keeps_what_it_has_shown():
    levels = noisy([True] * 10 + [None] * 40)
    assert levels[10:15] == pytest.approx([0.2] * 5)
    assert levels[-1] == pytest.approx(0.34)


def test_what_cannot_be_said_and_had_shown_nothing_keeps_nothing():
    """Else the few bad ones of a sensor that is noise add up beside one that is silent."""
    assert max(noisy([False] * 10 + [None] * 200)) <= 0.02 + 1e-9


#: Full after 2 s.
SLOW = rule(SINKS, hold=2.0, leak=0.5, samples=3)
LIGHT, HEAVY = replace(SINKS, weight=1.0), replace(SINKS, weight=2.0)
LOST = AutopilotCondition(AutopilotFact.LOST, counted=False)
BOTH = rule(TILTS, SINKS)
UNKNOWN = RuleEvidence(level=1.0, holds=None, shown=(2.0,), seen=(5,))


def test_how_long_nothing_can_be_said_adds_up_and_ends_with_a_word():
    once = UNKNOWN.counted(SLOW, 1.0)
    assert (once.unknown, once.level, once.shown) == (1.0, 1.0, (2.0,))
    assert once.counted(SLOW, 0.5).unknown == 1.5
    assert RuleEvidence(holds=False, unknown=0.5).counted(BOTH, 0.1).unknown == 0.0
    for holds in (True, False):
        assert once.seeing(SLOW, [Look(holds, 6)]).counted(SLOW, 0.5).unknown == 0.0


def test_past_its_stand_it_leaks_for_as_long_as_it_is_past():
    nearly = RuleEvidence(level=1.0, holds=None, unknown=UNKNOWN_STANDS - 0.5)
    assert nearly.counted(SLOW, 1.0).level == 0.75
    past = RuleEvidence(level=1.0, holds=None, unknown=UNKNOWN_STANDS + 1.0)
    assert past.counted(SLOW, 1.0).level == 0.5


def test_what_cannot_be_said_shows_nothing_and_denies_nothing():
    assert UNKNOWN.seeing(SLOW, [Look(None, 6)]).shown == (2.0,)
    assert UNKNOWN.seeing(SLOW, [Look(None, 6)]).holds is None


def test_a_sample_counts_once_also_where_none_has_come_so_far():
    first = RuleEvidence().seeing(SLOW, [Look(True, 0)])
    assert (first.shown, first.seen) == ((1.0,), (0,))
    assert first.seeing(SLOW, [Look(True, 0)]).shown == (1.0,)


@pytest.mark.parametrize(("seen", "enough"), [(-1, True), (0, False), (1, False)])
def test_only_what_has_no_samples_needs_none(seen, enough):
    full = RuleEvidence(level=2.0, shown=(1.0,), seen=(0,)).seeing(SLOW, [Look(True, seen)])
    assert full.holds
    assert full.fulfilled(SLOW) is enough


@pytest.mark.parametrize(
    ("one", "looks", "holds"),
    [
        (rule(LIGHT, HEAVY, needed=2.0), [Look(True), Look(False)], False),
        (rule(LIGHT, HEAVY, needed=2.0), [Look(False), Look(True)], True),
        (rule(LIGHT, HEAVY, needed=2.0), [Look(True), Look(None)], None),
        (rule(LIGHT, HEAVY, needed=2.0), [Look(None), Look(False)], False),
        (rule(LIGHT, HEAVY, needed=2.0), [Look(None), Look(True)], True),
        (rule(LIGHT, HEAVY, needed=2.0), [Look(False), Look(None)], None),
        # What is in doubt counts for its part.
        (rule(SINKS, doubted=0.5), [Look(True, 1)], True),
        (rule(SINKS, doubted=0.5), [Look(True, 1, True)], False),
        (rule(HEAVY, needed=1.0, doubted=0.5), [Look(True, 1, True)], True),
        # What no sample ever told keeps nothing; what rests on none may be so.
        (rule(SINKS), [Look(None, 0)], False),
        (rule(AutopilotCondition(AutopilotFact.LOST)), [Look(None)], None),
        (rule(LOST), [Look(None)], True),
        # A weight that misses by the rounding is enough.
        (rule(replace(SINKS, weight=2.0 - 1e-9), needed=2.0), [Look(True, 1)], True),
    ],
)
def test_it_holds_with_enough_weight_and_cannot_be_said_where_the_rest_could_be(one, looks, holds):
    evidence = RuleEvidence().seeing(one, looks)
    assert evidence.holds is holds


def test_only_the_weight_that_was_shown_by_enough_samples_makes_it_sure():
    one = rule(LIGHT, HEAVY, needed=2.0, samples=2)
    evidence = RuleEvidence().seeing(one, [Look(True, 1), Look(True, 1)])
    assert not evidence.seeing(one, [Look(True, 2), Look(True, 1)]).fulfilled(one)
    assert evidence.seeing(one, [Look(True, 1), Look(True, 2)]).fulfilled(one)
    assert not evidence.seeing(one, [Look(True, 2), Look(False, 2)]).fulfilled(one)


def test_weights_that_miss_by_the_rounding_are_sure_as_well():
    one = rule(SINKS, needed=1.0 + 1e-9)
    assert RuleEvidence().seeing(one, [Look(True, -1)]).fulfilled(one)


def test_the_rounding_itself_is_full_and_empty():
    shortest = rule(SINKS, hold=1e-6, samples=0)
    assert RuleEvidence(level=0.0, sure=True).fulfilled(shortest)
    assert RuleEvidence(level=1e-6).cleared()
    assert not RuleEvidence(level=2e-6).cleared()


@pytest.mark.parametrize(("unknown", "stands"), [(1.0, 2.0), (4.0, 0.0)])
def test_while_nothing_can_be_said_it_is_empty_after_its_stand(unknown, stands):
    waiting = RuleEvidence(level=1.0, holds=None, latched=True, unknown=unknown)
    assert waiting.deadline(SLOW, 10.0) == 12.0 + stands
    known = RuleEvidence(level=1.0, holds=False, latched=True, unknown=unknown)
    assert known.deadline(SLOW, 10.0) == 12.0
    assert RuleEvidence(level=1.0, holds=None).deadline(SLOW, 10.0) == math.inf


def test_what_is_in_doubt_is_not_sure():
    for doubted in (False, True):
        evidence = RuleEvidence().seeing(rule(SINKS, doubted=0.5), [Look(True, 1, doubted)])
        assert evidence.sure is not doubted


@pytest.mark.parametrize("lost", [None, False])
def test_what_is_not_counted_is_waited_for_and_must_be_so_at_the_end(lost):
    one = rule(LOST, SINKS)
    evidence = RuleEvidence().seeing(one, [Look(lost), Look(True, 1)])
    assert (evidence.holds, evidence.sure) == (True, False)
    assert evidence.seeing(one, [Look(True), Look(True, 1)]).sure


def test_one_sample_that_showed_it_is_enough_to_stand():
    shown = RuleEvidence().seeing(rule(SINKS, samples=3), [Look(True, 1)])
    assert shown.shown == (1.0,)
    assert shown.seeing(rule(SINKS, samples=3), [Look(None, 1)]).holds is None


def test_what_was_shown_stands_while_nothing_can_be_said_and_adds_up_with_what_is_so():
    evidence = RuleEvidence().seeing(BOTH, [Look(True, 1), Look(True, 1)])
    looks = [Look(True, 2), Look(None, 1)]
    for seen in (looks, looks[::-1]):
        assert evidence.seeing(BOTH, seen).holds is None
    almost = rule(replace(SINKS, weight=2.0 - 1e-9), needed=2.0)
    shown = RuleEvidence(shown=(1.0,), seen=(0,))
    assert shown.seeing(almost, [Look(None, 0)]).holds is None


def test_a_look_that_shows_nothing_new_changes_nothing():
    """Most of them: nothing is made anew for it."""
    evidence = RuleEvidence().seeing(BOTH, [Look(True, 1), Look(True, 1)])
    assert evidence.seeing(BOTH, [Look(True, 1), Look(True, 1)]) is evidence
    for looks in ([Look(True, 2), Look(True, 1)], [Look(True, 1), Look(True, 1, True)]):
        assert evidence.seeing(rule(TILTS, SINKS, doubted=0.5), looks) is not evidence


def test_a_sample_more_of_what_is_shown_enough_is_still_seen():
    one = rule(SINKS, samples=1)
    evidence = RuleEvidence().seeing(one, [Look(True, 1)])
    later = evidence.seeing(one, [Look(True, 2)])
    assert (later.shown, later.seen) == ((1.0,), (2,))
