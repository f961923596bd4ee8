"""What the supervisor and the device nodes report of a deploy, as feedback of an action."""

from __future__ import annotations

from chute_msgs.action import Deploy
from chute_msgs.msg import ActionReport, SafetyDecision

from chute_ros.model import Outcome

_STEPS = {
    SafetyDecision.KILL: Deploy.Feedback.KILLING,
    SafetyDecision.DEPLOY: Deploy.Feedback.DEPLOYING,
}
_NAMES = {SafetyDecision.KILL: "kill", SafetyDecision.DEPLOY: "deploy"}
#: The order has left.
_LEFT = (Outcome.SENT, Outcome.ACCEPTED)


class DeployProgress:
    """Of one goal. Each decision and each report is told once, however often it is resent."""

    def __init__(self) -> None:
        self._told: set[tuple[int | str, ...]] = set()
        self._step = Deploy.Feedback.NONE

    def decided(self, one: SafetyDecision) -> Deploy.Feedback | None:
        """None: it is nothing of a deploy, or it was told."""
        if one.action not in _STEPS or not self._is_new(one.epoch, one.id):
            return None
        self._step = _STEPS[one.action]
        would = "would be " if one.shadow else ""
        why = "; ".join(one.reasons)
        to = ", ".join(one.targets) or "no link"
        text = f"{_NAMES[one.action]} {would}ordered by rule '{one.rule}' to {to}: {why}"
        return self._feedback(text)

    def reported(self, one: ActionReport) -> Deploy.Feedback | None:
        """None: it is nothing of a deploy, or it was told."""
        if one.action not in _STEPS or not self._is_new(one.epoch, one.id, one.link, one.outcome):
            return None
        known = one.outcome in Outcome._value2member_map_
        outcome = Outcome(one.outcome) if known else Outcome.NONE
        if one.action == SafetyDecision.DEPLOY and outcome in _LEFT:
            self._step = Deploy.Feedback.WAITING
        return self._feedback(f"{one.link}: {_NAMES[one.action]} {outcome.name}: {one.detail}")

    def _is_new(self, *key: int | str) -> bool:
        new = key not in self._told
        self._told.add(key)
        return new

    def _feedback(self, text: str) -> Deploy.Feedback:
        return Deploy.Feedback(step=self._step, text=text)
