"""Never seen, ok, stale, lost and regained are different, each with its time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import ParameterError
from chute_ros.model import LinkState
from chute_ros.protocol.liveness import Liveness, LivenessLimits

LIMITS = LivenessLimits(stale_after=2.5, lost_after=5.0)


def test_a_link_that_was_never_heard_is_neither_stale_nor_lost():
    link = Liveness(LIMITS)
    assert link.update(1e9) == []
    assert link.state is LinkState.NEVER_SEEN
    assert math.isnan(link.age(1e9))
    assert link.next_deadline() == math.inf


def test_first_heard_stale_lost_and_regained_each_with_its_time():
    link = Liveness(LIMITS)
    (first,) = link.heard(10.0)
    assert (first.before, first.after) == (LinkState.NEVER_SEEN, LinkState.OK)
    assert not first.regained
    assert link.next_deadline() == 12.5
    (stale,) = link.update(12.5)
    assert (stale.after, stale.at, stale.silence) == (LinkState.STALE, 12.5, 2.5)
    assert link.next_deadline() == 15.0
    (lost,) = link.update(15.0)
    assert lost.after is LinkState.LOST
    assert (lost.at, link.lost_count, link.next_deadline()) == (15.0, 1, math.inf)
    (back,) = link.heard(20.0)
    assert back.regained
    assert back.silence == 10.0
    assert (link.first_heard, link.regained_at, link.since) == (10.0, 20.0, 20.0)


def test_a_stale_link_that_is_heard_is_ok_but_not_regained():
    link = Liveness(LIMITS)
    link.heard(0.0)
    link.update(3.0)
    (back,) = link.heard(3.1)
    assert (back.after, back.regained) == (LinkState.OK, False)


def test_a_late_look_passes_both_limits_one_after_the_other():
    both = [LinkState.STALE, LinkState.LOST]
    for look, passed in ((Liveness.update, both), (Liveness.heard, [*both, LinkState.OK])):
        link = Liveness(LIMITS)
        link.heard(0.0)
        assert [change.after for change in look(link, 60.0)] == passed


def test_limits_that_contradict_each_other_are_refused():
    for stale, lost in ((0.0, 1.0), (2.0, 2.0), (3.0, 2.0), (1.0, math.inf), (math.nan, 1.0)):
        wrong = "lost_after is inf" if math.isinf(lost) else f"stale_after is {stale}"
        with pytest.raises(ParameterError, match=wrong):
            LivenessLimits(stale, lost)


@given(st.lists(st.tuples(st.floats(0, 20), st.booleans()), max_size=50))
def test_the_state_is_what_the_silence_says(steps):
    link, now, heard = Liveness(LIMITS), 0.0, None
    for wait, speaks in steps:
        now += wait
        if speaks:
            link.heard(now)
            heard = now
        link.update(now)
        if heard is None:
            assert link.state is LinkState.NEVER_SEEN
        elif now < heard + LIMITS.stale_after:
            assert link.state is LinkState.OK
        elif now < heard + LIMITS.lost_after:
            assert link.state is LinkState.STALE
        else:
            assert link.state is LinkState.LOST
        assert link.next_deadline() > now
