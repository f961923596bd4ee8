"""A link at its very limits, and each part of what is known of it."""

import math

import pytest
from story import LINK

from chute_ros.errors import ParameterError
from chute_ros.model import LinkState, ParachuteStatus
from chute_ros.supervisor.inputs import LinkHeartbeat
from chute_ros.supervisor.link_evidence import LinkEvidence, LinkJudgement, LinkLimits

LIMITS = LinkLimits(stale_after=0.5, lost_after=1.0, regain_after=1.0, startup_grace=10.0)
NEED = "need a number (1.0, not 1) from"


def beat(seq: int = 1, state: LinkState = LinkState.OK, difference: float = 0.0) -> LinkHeartbeat:
    return LinkHeartbeat(LINK, state, True, seq, clock_difference=difference)


def heard(*beats: tuple[float, LinkHeartbeat]) -> LinkEvidence:
    evidence = LinkEvidence()
    for t, one in beats:
        evidence = evidence.with_heartbeat(one, LIMITS, t)
    return evidence


def test_limits_may_reach_their_ends() -> None:
    for ends in (LinkLimits(0.5, 600.0, 60.0, 60.0), LinkLimits(0.5, 1.0, 0.0, 0.0)):
        assert ends.stale_after == 0.5


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ((0.04, 1.0), f"stale_after is 0.04: {NEED} 0.05 to 600 s (silence of a node after"),
        ((0.5, 1.0, 60.5), f"regain_after is 60.5: {NEED} 0 to 60 s (a node whose link"),
        ((0.5, 1.0, 1.0, -0.5), f"startup_grace is -0.5: {NEED} 0 to 60 s (links may take"),
    ],
)
def test_limits_past_their_ends_are_told_in_full(wrong: tuple[float, ...], words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        LinkLimits(*wrong)
    assert str(caught.value).startswith(f"parameter {words}")


def test_a_heartbeat_tells_its_number_its_device_and_its_clock() -> None:
    evidence = heard((1.0, beat(seq=8, difference=0.02)), (1.1, beat(seq=9, difference=0.03)))
    assert (evidence.heard, evidence.seq, evidence.clock_difference) == (1.1, 9, 0.03)
    assert evidence.device_healthy
    assert evidence.reported is LinkState.OK


def test_a_device_that_stays_lost_is_one_loss_and_the_next_another() -> None:
    lost, well = beat(state=LinkState.LOST), beat()
    evidence = heard((1.0, well), (1.2, lost), (1.4, lost), (1.6, lost))
    assert evidence.lost_count == 1
    evidence = heard((1.0, well), (1.2, lost), (1.4, well), (1.6, lost))
    assert evidence.lost_count == 2


def test_a_break_at_the_very_end_of_the_wait_does_not_begin_it_anew() -> None:
    evidence = heard((1.0, beat()), (5.0, beat()), (5.4, beat()), (6.0, beat()))
    assert evidence.judged(LIMITS, 6.0) is LinkJudgement.OK


def test_a_lost_device_that_nobody_knew_counts_as_not_released() -> None:
    told = ParachuteStatus("1/161", LinkState.LOST, deployed=True)
    assert LinkEvidence().with_status(told, 3.0).devices["1/161"].deployed is False


def test_it_is_looked_at_again_when_it_grows_stale_lost_or_is_regained() -> None:
    never = heard((2.0, beat())).deadlines(LIMITS)
    assert never[:2] == (2.5, 3.0)
    assert math.isnan(never[2]), "it was never lost"
    assert math.isnan(never[3]), "none was released"
    regained = heard((2.0, beat()), (8.0, beat()), (8.4, beat())).deadlines(LIMITS)
    assert regained[:3] == (8.9, 9.4, 9.0)
    released = LinkEvidence(released_at=5.0).deadlines(LIMITS)
    assert released[3] == 6.0, "its word counts no longer than its node may be silent"


def clocks(*told: tuple[float, float]) -> LinkEvidence:
    return heard(*((t, beat(seq=n, difference=d)) for n, (t, d) in enumerate(told)))


def test_a_clock_is_judged_by_the_smallest_difference_of_this_spell_and_the_one_before() -> None:
    first = clocks((10.0, 0.5), (10.5, 0.3), (10.9, 0.4))
    assert (first.clock_spell_since, first.clock_least) == (10.0, 0.3)
    assert math.isnan(first.clocks_differ_by), "one spell is not enough"
    second = clocks((10.0, 0.5), (10.5, 0.3), (11.0, 0.6), (11.9, 0.7))
    assert (second.clock_spell_since, second.clock_least) == (11.0, 0.6)
    assert second.clocks_differ_by == 0.3
    third = clocks((10.0, 0.5), (10.5, 0.3), (11.0, 0.6), (12.0, 0.8))
    assert (third.clock_least_before, third.clock_least, third.clocks_differ_by) == (0.6, 0.8, 0.6)


@pytest.mark.parametrize(("pause", "known"), [(2.9, True), (3.0, False), (3.5, False)])
def test_what_was_heard_before_a_long_silence_says_nothing_of_a_clock(
    pause: float, known: bool
) -> None:
    after = clocks((10.0, 0.5), (10.0 + pause, 0.6))
    assert after.clock_least == 0.6
    assert after.clock_least_before == 0.5 if known else math.isnan(after.clock_least_before)
