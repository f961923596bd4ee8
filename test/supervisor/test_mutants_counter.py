"""What make mutate asked for: counter.py, each of its weights and limits."""

import pytest
from story import SINKS, rule

from chute_ros.supervisor.counter import Look, RuleEvidence
from chute_ros.supervisor.rules import AutopilotCondition, AutopilotFact, MeasurementCondition

TILTS = MeasurementCondition("tilt_deg", above=60.0)
LOST = AutopilotCondition(AutopilotFact.LOST, counted=False)
BOTH = rule(TILTS, SINKS)


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
