"""The counter to the last sample: what mutants showed that no story looked at."""

import math

import pytest
from story import SINKS, rule

from chute_ros.model import Action
from chute_ros.supervisor.counter import UNKNOWN_STANDS, RuleEvidence

RULE = rule(SINKS, action=Action.DEPLOY, hold=2.0, leak=0.5, samples=3)
UNKNOWN = RuleEvidence(level=1.0, holds=None, samples=2, seen=5)


def test_how_long_nothing_can_be_said_adds_up_and_ends_with_a_word() -> None:
    once = UNKNOWN.counted(RULE, 1.0)
    assert (once.unknown, once.level, once.samples) == (1.0, 1.0, 2)
    assert once.counted(RULE, 0.5).unknown == 1.5
    for holds in (True, False):
        assert once.seeing(holds, 6).counted(RULE, 0.5).unknown == 0.0


def test_past_its_stand_it_leaks_for_as_long_as_it_is_past() -> None:
    nearly = RuleEvidence(level=1.0, holds=None, samples=2, unknown=UNKNOWN_STANDS - 0.5)
    assert nearly.counted(RULE, 1.0).level == 0.75
    past = RuleEvidence(level=1.0, holds=None, samples=2, unknown=UNKNOWN_STANDS + 1.0)
    assert past.counted(RULE, 1.0).level == 0.5


def test_samples_are_forgotten_with_the_stand_and_with_an_empty_counter() -> None:
    empty = RuleEvidence(level=0.0, holds=None, samples=2, unknown=UNKNOWN_STANDS - 1.0)
    assert empty.counted(RULE, 0.5).samples == 2
    assert empty.counted(RULE, 1.0).samples == 0, "at the end of the stand"
    bad = RuleEvidence(level=1.0, holds=False, samples=2)
    assert bad.counted(RULE, 1.0).samples == 2, "something is left of it"
    assert bad.counted(RULE, 2.0).samples == 0
    assert RuleEvidence(holds=True, samples=2).counted(RULE, 0.0).samples == 2


def test_a_sample_counts_once_also_where_none_has_come_so_far() -> None:
    first = RuleEvidence().seeing(True, 0)
    assert first.samples == 1
    assert first.seeing(True, 0).samples == 1
    told = RuleEvidence().seeing(True, -1)
    assert told.seeing(True, -1).samples == 2, "what has no samples is looked at each time"


@pytest.mark.parametrize(("seen", "enough"), [(-1, True), (0, False), (1, False)])
def test_only_what_has_no_samples_needs_none(seen: int, enough: bool) -> None:
    full = RuleEvidence(level=2.0, holds=True, samples=2, seen=seen)
    assert full.fulfilled(RULE) is enough


def test_the_rounding_itself_is_full_and_empty() -> None:
    shortest = rule(SINKS, hold=1e-6, samples=0)
    assert RuleEvidence(level=0.0, holds=True).fulfilled(shortest)
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
