"""The gate of a device node at its limits."""

import pytest

from chute_ros.model import Action, Decision
from chute_ros.supervisor.decision_gate import DecisionGate, Verdict

LINK = "mavlink_parachute"


@pytest.mark.parametrize("age", [-0.5, 0.5])
def test_a_decision_that_is_just_as_old_as_allowed_is_carried_out(age: float) -> None:
    """From the future by as much as two clocks may differ, or from the past."""
    kill = Decision(7, 1, Action.KILL, "r", (), (LINK,))
    assert DecisionGate(LINK, max_decision_age=0.5).judge(kill, age) is Verdict.ACT
