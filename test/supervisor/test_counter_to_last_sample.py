"""The counter to the last sample."""

import math
from dataclasses import replace

import pytest
from story import SINKS, TILTS, rule

from chute_ros.model import Action
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.counter import UNKNOWN_STANDS, Look, RuleEvidence

RULE = rule(SINKS, action=Action.DEPLOY, hold=2.0, leak=0.5, samples=3)
LOST = AutopilotCondition(AutopilotFact.LOST, counted=False)
BOTH = rule(TILTS, SINKS)
UNKNOWN = RuleEvidence(level=1.0, holds=None, shown=(2.0,), seen=(5,))


def test_how_long_nothing_can_be_said_adds_up_and_ends_with_a_word() -> None:
    once = UNKNOWN.counted(RULE, 1.0)
    assert (once.unknown, once.level, once.shown) == (1.0, 1.0, (2.0,))
    assert once.counted(RULE, 0.5).unknown == 1.5
    for holds in (True, False):
        assert once.seeing(RULE, [Look(holds, 6)]).counted(RULE, 0.5).unknown == 0.0


def test_past_its_stand_it_leaks_for_as_long_as_it_is_past() -> None:
    nearly = RuleEvidence(level=1.0, holds=None, unknown=UNKNOWN_STANDS - 0.5)
    assert nearly.counted(RULE, 1.0).level == 0.75
    past = RuleEvidence(level=1.0, holds=None, unknown=UNKNOWN_STANDS + 1.0)
    assert past.counted(RULE, 1.0).level == 0.5


def test_what_cannot_be_said_shows_nothing_and_denies_nothing() -> None:
    assert UNKNOWN.seeing(RULE, [Look(None, 6)]).shown == (2.0,)
    assert UNKNOWN.seeing(RULE, [Look(None, 6)]).holds is None


def test_a_sample_counts_once_also_where_none_has_come_so_far() -> None:
    first = RuleEvidence().seeing(RULE, [Look(True, 0)])
    assert (first.shown, first.seen) == ((1.0,), (0,))
    assert first.seeing(RULE, [Look(True, 0)]).shown == (1.0,)


@pytest.mark.parametrize(("seen", "enough"), [(-1, True), (0, False), (1, False)])
def test_only_what_has_no_samples_needs_none(seen: int, enough: bool) -> None:
    full = RuleEvidence(level=2.0, shown=(1.0,), seen=(0,)).seeing(RULE, [Look(True, seen)])
    assert full.holds
    assert full.fulfilled(RULE) is enough


def test_it_holds_with_enough_weight_and_cannot_be_said_where_the_rest_could_be() -> None:
    light, heavy = replace(SINKS, weight=1.0), replace(SINKS, weight=2.0)
    one = rule(light, heavy, needed=2.0)
    for found, holds in (
        ([True, False], False),
        ([False, True], True),
        ([True, None], None),
        ([None, False], False),
        ([None, True], True),
        ([False, None], None),
    ):
        pairs = [Look(each) for each in found]
        assert RuleEvidence().seeing(one, pairs).holds is holds


def test_only_the_weight_that_was_shown_by_enough_samples_makes_it_sure() -> None:
    light, heavy = replace(SINKS, weight=1.0), replace(SINKS, weight=2.0)
    one = rule(light, heavy, needed=2.0, samples=2)
    evidence = RuleEvidence().seeing(one, [Look(True, 1), Look(True, 1)])
    assert not evidence.seeing(one, [Look(True, 2), Look(True, 1)]).fulfilled(one)
    assert evidence.seeing(one, [Look(True, 1), Look(True, 2)]).fulfilled(one)
    assert not evidence.seeing(one, [Look(True, 2), Look(False, 2)]).fulfilled(one)


def test_weights_that_miss_by_the_rounding_are_sure_as_well() -> None:
    one = rule(SINKS, needed=1.0 + 1e-9)
    assert RuleEvidence().seeing(one, [Look(True, -1)]).fulfilled(one)


def test_the_rounding_itself_is_full_and_empty() -> None:
    shortest = rule(SINKS, hold=1e-6, samples=0)
    assert RuleEvidence(level=0.0, sure=True).fulfilled(shortest)
    assert RuleEvidence(level=1e-6).cleared()
    assert not RuleEvidence(level=2e-6).cleared()


@pytest.mark.parametrize(("unknown", "stands"), [(1.0, 2.0), (4.0, 0.0)])
def test_while_nothing_can_be_said_it_is_empty_after_its_stand(
    unknown: float, stands: float
) -> None:
    waiting = RuleEvidence(level=1.0, holds=None, latched=True, unknown=unknown)
    assert waiting.deadline(RULE, 10.0) == 12.0 + stands
    known = RuleEvidence(level=1.0, holds=False, latched=True, unknown=unknown)
    assert known.deadline(RULE, 10.0) == 12.0
    assert RuleEvidence(level=1.0, holds=None).deadline(RULE, 10.0) == math.inf


def test_once_it_is_known_again_it_is_no_longer_unknown() -> None:
    assert RuleEvidence(holds=False, unknown=0.5).counted(BOTH, 0.1).unknown == 0.0


@pytest.mark.parametrize(("doubted", "holds"), [(False, True), (True, False)])
def test_what_is_in_doubt_counts_for_its_part(doubted: bool, holds: bool) -> None:
    one = rule(SINKS, doubted=0.5)
    evidence = RuleEvidence().seeing(one, [Look(True, 1, doubted)])
    assert (evidence.holds, evidence.sure) == (holds, holds)


def test_twice_the_weight_in_doubt_is_as_much_as_once() -> None:
    twice = MeasurementCondition("tilt_deg", above=60.0, weight=2.0)
    one = rule(twice, needed=1.0, doubted=0.5)
    assert RuleEvidence().seeing(one, [Look(True, 1, doubted=True)]).holds is True


@pytest.mark.parametrize("lost", [None, False])
def test_what_is_not_counted_is_waited_for_and_must_be_so_at_the_end(lost: bool | None) -> None:
    one = rule(LOST, SINKS)
    evidence = RuleEvidence().seeing(one, [Look(lost), Look(True, 1)])
    assert (evidence.holds, evidence.sure) == (True, False)
    assert evidence.seeing(one, [Look(True), Look(True, 1)]).sure


def test_what_no_sample_ever_told_keeps_nothing() -> None:
    assert RuleEvidence().seeing(rule(SINKS), [Look(None, 0)]).holds is False


def test_what_rests_on_no_samples_may_be_so() -> None:
    assert RuleEvidence().seeing(rule(LOST), [Look(None)]).holds is True
    counted = AutopilotCondition(AutopilotFact.LOST)
    assert RuleEvidence().seeing(rule(counted), [Look(None)]).holds is None


def test_one_sample_that_showed_it_is_enough_to_stand() -> None:
    shown = RuleEvidence().seeing(rule(SINKS, samples=3), [Look(True, 1)])
    assert shown.shown == (1.0,)
    assert shown.seeing(rule(SINKS, samples=3), [Look(None, 1)]).holds is None


@pytest.mark.parametrize("sure_first", [True, False])
def test_what_is_so_and_what_may_be_so_add_up(sure_first: bool) -> None:
    evidence = RuleEvidence().seeing(BOTH, [Look(True, 1), Look(True, 1)])
    looks = [Look(True, 2), Look(None, 1)]
    assert evidence.seeing(BOTH, looks if sure_first else looks[::-1]).holds is None


@pytest.mark.parametrize(("look", "holds"), [(Look(True, 1), True), (Look(None, 0), None)])
def test_a_weight_that_misses_by_the_rounding_is_enough(look: Look, holds: bool | None) -> None:
    almost = MeasurementCondition("tilt_deg", above=60.0, weight=2.0 - 1e-9)
    one = rule(almost, needed=2.0)
    evidence = RuleEvidence(shown=(1.0,), seen=(0,))
    assert evidence.seeing(one, [look]).holds is holds


def test_a_look_that_shows_nothing_new_changes_nothing() -> None:
    """Most of them: nothing is made anew for it."""
    evidence = RuleEvidence().seeing(BOTH, [Look(True, 1), Look(True, 1)])
    assert evidence.seeing(BOTH, [Look(True, 1), Look(True, 1)]) is evidence
    for looks in ([Look(True, 2), Look(True, 1)], [Look(True, 1), Look(True, 1, True)]):
        assert evidence.seeing(rule(TILTS, SINKS, doubted=0.5), looks) is not evidence


def test_a_sample_more_of_what_is_shown_enough_is_still_seen() -> None:
    one = rule(SINKS, samples=1)
    evidence = RuleEvidence().seeing(one, [Look(True, 1)])
    later = evidence.seeing(one, [Look(True, 2)])
    assert (later.shown, later.seen) == ((1.0,), (2,))
