"""The gate before a device: a decision passes once, if it is addressed, real, new and young."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.model import Action, Decision
from chute_ros.supervisor.decision_gate import DecisionGate, DecisionVerdict

LINK = "mavlink_parachute"


def decision(
    epoch: int = 5, number: int = 1, targets: tuple[str, ...] = (LINK,), shadow: bool = False
) -> Decision:
    return Decision(epoch, number, Action.DEPLOY, "rule", ("because",), targets, shadow)


def gate() -> DecisionGate:
    return DecisionGate(LINK, max_decision_age=0.5)


OTHERS = ("upf_can",)


def kind(action: Action, epoch: int, number: int) -> Decision:
    return Decision(epoch, number, action, "rule", ("because",), (LINK,))


KILL, DEPLOY = kind(Action.KILL, 7, 2), kind(Action.DEPLOY, 7, 3)


@pytest.mark.parametrize(
    "told",
    [
        # A young new decision for us is acted on once.
        [(decision(), 0.01, DecisionVerdict.ACT), (decision(), 0.02, DecisionVerdict.REPEATED)],
        # One for others is not ours.
        [(decision(targets=OTHERS), 0.0, DecisionVerdict.NOT_ADDRESSED)],
        [(decision(targets=()), 0.0, DecisionVerdict.NOT_ADDRESSED)],
        # A shadow's is only said, and not remembered.
        [
            (decision(5, 9, shadow=True), 0.0, DecisionVerdict.SHADOW),
            (decision(5, 1), 0.0, DecisionVerdict.ACT),
        ],
        # An older one is refused, as is the number that no decision has.
        [
            (decision(5, 9), 0.0, DecisionVerdict.ACT),
            (decision(5, 8), 0.0, DecisionVerdict.OLDER),
            (decision(4, 100), 0.0, DecisionVerdict.OLDER),
        ],
        [(decision(0, 0), 0.0, DecisionVerdict.OLDER)],
        # One that was acted on is a repetition even after a newer one. Its report was lost: told
        # that it is older, the supervisor would think it was never done.
        [
            (decision(5, 8), 0.0, DecisionVerdict.ACT),
            (decision(5, 9), 0.0, DecisionVerdict.ACT),
            (decision(5, 8), 0.0, DecisionVerdict.REPEATED),
        ],
        # What was acted on long ago is older, and never done again.
        [
            *[(decision(5, number), 0.0, DecisionVerdict.ACT) for number in range(1, 100)],
            (decision(5, 1), 0.0, DecisionVerdict.OLDER),
        ],
        # A new epoch starts its numbers anew.
        [(decision(5, 9), 0.0, DecisionVerdict.ACT), (decision(6, 1), 0.0, DecisionVerdict.ACT)],
        # A late one may be sent again with a new stamp.
        [(decision(), 0.51, DecisionVerdict.TOO_LATE), (decision(), 0.0, DecisionVerdict.ACT)],
        # From the future by no more than two clocks may differ.
        [(decision(), -0.51, DecisionVerdict.TOO_LATE)],
        [(decision(), -0.5, DecisionVerdict.ACT)],
        [(decision(), 0.5, DecisionVerdict.ACT)],
        [(decision(), float("nan"), DecisionVerdict.TOO_LATE)],
        # What is only said or old shows no other leader.
        *[
            [
                (decision(6, 9, OTHERS, shadow), age, DecisionVerdict.NOT_ADDRESSED),
                (decision(5, 1), 0.0, DecisionVerdict.ACT),
            ]
            for shadow, age in ((True, 0.0), (False, 0.51), (False, -0.51))
        ],
        # A kill that was overtaken by its deploy is carried out all the same.
        [
            (DEPLOY, 0.0, DecisionVerdict.ACT),
            (KILL, 0.6, DecisionVerdict.TOO_LATE),
            (KILL, 0.1, DecisionVerdict.ACT),
            (KILL, 0.1, DecisionVerdict.REPEATED),
            (DEPLOY, 0.1, DecisionVerdict.REPEATED),
            (kind(Action.FLIGHT_BLOCK, 7, 1), 0.0, DecisionVerdict.OLDER),
            (kind(Action.KILL, 6, 9), 0.0, DecisionVerdict.OLDER),
        ],
    ],
)
def test_each_decision_is_judged_by_those_before_it(told):
    one = gate()
    for each, age, verdict in told:
        assert one.judge(each, age) is verdict, (each, age)
    if DEPLOY in [each for each, _, _ in told]:
        assert (one.newest_epoch, one.newest_id) == (7, 3)


def test_who_led_before_another_decided_for_others_is_not_obeyed():
    one = gate()
    assert one.judge(decision(5, 3), 0.0) is DecisionVerdict.ACT
    assert one.judge(decision(6, 9, OTHERS), 0.5) is DecisionVerdict.NOT_ADDRESSED
    assert one.judge(decision(5, 4), 0.0) is DecisionVerdict.OLDER
    assert (one.newest_epoch, one.newest_id, one.newest_action) == (6, 0, Action.NONE)
    assert one.judge(decision(6, 1), 0.0) is DecisionVerdict.ACT
    # Within one term the numbers of others say nothing.
    assert one.judge(decision(6, 20, OTHERS), 0.0) is DecisionVerdict.NOT_ADDRESSED
    assert one.judge(decision(6, 2), 0.0) is DecisionVerdict.ACT


@given(
    st.lists(
        st.tuples(
            st.integers(1, 3), st.integers(1, 4), st.booleans(), st.floats(-1, 1), st.booleans()
        )
    )
)
def test_no_decision_is_ever_acted_on_twice_nor_out_of_order(sent):
    one, acted = gate(), []
    for epoch, number, ours, age, shadow in sent:
        targets = (LINK,) if ours else ("other",)
        verdict = one.judge(decision(epoch, number, targets, shadow), age)
        if verdict is DecisionVerdict.ACT:
            assert ours
            assert not shadow
            assert abs(age) <= 0.5
            acted.append((epoch, number))
    assert acted == sorted(set(acted))
