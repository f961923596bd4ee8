"""The gate before a device: a decision passes once, if it is addressed, real, new and young."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.model import Action, Decision
from chute_ros.supervisor.decision_gate import DecisionGate, Verdict

LINK = "mavlink_parachute"


def decision(
    epoch: int = 5, number: int = 1, targets: tuple[str, ...] = (LINK,), shadow: bool = False
) -> Decision:
    return Decision(epoch, number, Action.DEPLOY, "rule", ("because",), targets, shadow)


def gate() -> DecisionGate:
    return DecisionGate(LINK, max_decision_age=0.5)


def test_a_young_new_decision_for_us_is_acted_on_once() -> None:
    one = gate()
    assert one.judge(decision(), age=0.01) is Verdict.ACT
    assert one.judge(decision(), age=0.02) is Verdict.REPEATED


def test_a_decision_for_others_is_not_ours() -> None:
    assert gate().judge(decision(targets=("upf_can",)), 0.0) is Verdict.NOT_ADDRESSED
    assert gate().judge(decision(targets=()), 0.0) is Verdict.NOT_ADDRESSED


def test_who_led_before_another_decided_for_others_is_not_obeyed() -> None:
    one = gate()
    assert one.judge(decision(epoch=5, number=3), 0.0) is Verdict.ACT
    assert one.judge(decision(epoch=6, number=9, targets=("upf_can",)), 0.5) is (
        Verdict.NOT_ADDRESSED
    )
    assert one.judge(decision(epoch=5, number=4), 0.0) is Verdict.OLDER
    assert (one.newest_epoch, one.newest_id, one.newest_action) == (6, 0, Action.NONE)
    assert one.judge(decision(epoch=6, number=1), 0.0) is Verdict.ACT
    # Within one term the numbers of others say nothing.
    assert one.judge(decision(epoch=6, number=20, targets=("upf_can",)), 0.0) is (
        Verdict.NOT_ADDRESSED
    )
    assert one.judge(decision(epoch=6, number=2), 0.0) is Verdict.ACT


@pytest.mark.parametrize(("shadow", "age"), [(True, 0.0), (False, 0.51), (False, -0.51)])
def test_what_is_only_said_or_old_shows_no_other_leader(shadow: bool, age: float) -> None:
    one = gate()
    other = decision(epoch=6, number=9, targets=("upf_can",), shadow=shadow)
    assert one.judge(other, age) is Verdict.NOT_ADDRESSED
    assert one.judge(decision(epoch=5, number=1), 0.0) is Verdict.ACT


def test_a_shadow_decision_is_only_said_and_not_remembered() -> None:
    one = gate()
    assert one.judge(decision(number=9, shadow=True), 0.0) is Verdict.SHADOW
    assert one.judge(decision(number=1), 0.0) is Verdict.ACT


def test_an_older_decision_is_refused() -> None:
    one = gate()
    assert one.judge(decision(epoch=5, number=9), 0.0) is Verdict.ACT
    assert one.judge(decision(epoch=5, number=8), 0.0) is Verdict.OLDER
    assert one.judge(decision(epoch=4, number=100), 0.0) is Verdict.OLDER


def test_one_that_was_acted_on_is_a_repetition_even_after_a_newer_one() -> None:
    # Its report was lost: told that it is older, the supervisor would think it was never done.
    one = gate()
    assert one.judge(decision(number=8), 0.0) is Verdict.ACT
    assert one.judge(decision(number=9), 0.0) is Verdict.ACT
    assert one.judge(decision(number=8), 0.0) is Verdict.REPEATED


def test_what_was_acted_on_long_ago_is_older_and_never_done_again() -> None:
    one = gate()
    for number in range(1, 100):
        assert one.judge(decision(number=number), 0.0) is Verdict.ACT
    assert one.judge(decision(number=1), 0.0) is Verdict.OLDER


def test_the_number_that_no_decision_has_is_refused() -> None:
    assert gate().judge(decision(epoch=0, number=0), 0.0) is Verdict.OLDER


def test_a_new_epoch_starts_its_numbers_anew() -> None:
    one = gate()
    assert one.judge(decision(epoch=5, number=9), 0.0) is Verdict.ACT
    assert one.judge(decision(epoch=6, number=1), 0.0) is Verdict.ACT


def test_a_late_decision_is_refused_but_may_be_sent_again_with_a_new_stamp() -> None:
    one = gate()
    assert one.judge(decision(), age=0.51) is Verdict.TOO_LATE
    assert one.judge(decision(), age=0.0) is Verdict.ACT


def test_a_decision_from_far_in_the_future_is_refused() -> None:
    assert gate().judge(decision(), age=-0.51) is Verdict.TOO_LATE
    assert gate().judge(decision(), age=float("nan")) is Verdict.TOO_LATE


@given(
    st.lists(
        st.tuples(
            st.integers(1, 3), st.integers(1, 4), st.booleans(), st.floats(-1, 1), st.booleans()
        )
    )
)
def test_no_decision_is_ever_acted_on_twice_nor_out_of_order(
    sent: list[tuple[int, int, bool, float, bool]],
) -> None:
    one, acted = gate(), []
    for epoch, number, ours, age, shadow in sent:
        targets = (LINK,) if ours else ("other",)
        verdict = one.judge(decision(epoch, number, targets, shadow), age)
        if verdict is Verdict.ACT:
            assert ours
            assert not shadow
            assert abs(age) <= 0.5
            acted.append((epoch, number))
    assert acted == sorted(set(acted))


def test_a_kill_that_was_overtaken_by_its_deploy_is_carried_out_all_the_same() -> None:
    gate = DecisionGate(LINK, 0.5)
    kill = Decision(7, 2, Action.KILL, "r", (), (LINK,))
    deploy = Decision(7, 3, Action.DEPLOY, "r", (), (LINK,))
    assert gate.judge(deploy, 0.0) is Verdict.ACT
    assert gate.judge(kill, 0.6) is Verdict.TOO_LATE
    assert gate.judge(kill, 0.1) is Verdict.ACT
    assert gate.judge(kill, 0.1) is Verdict.REPEATED
    assert gate.judge(deploy, 0.1) is Verdict.REPEATED
    assert (gate.newest_epoch, gate.newest_id) == (7, 3)
    block = Decision(7, 1, Action.FLIGHT_BLOCK, "r", (), (LINK,))
    assert gate.judge(block, 0.0) is Verdict.OLDER
    other_term = Decision(6, 9, Action.KILL, "r", (), (LINK,))
    assert gate.judge(other_term, 0.0) is Verdict.OLDER
