"""Decisions of the supervisor on their way into a device node, and reports on their way back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

from builtin_interfaces.msg import Time
from chute_msgs.msg import ActionReport, SafetyDecision
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from chute_ros import model
from chute_ros.nodes import messages, qos
from chute_ros.nodes.plain_border import with_plain_texts
from chute_ros.supervisor.decision_gate import DecisionGate, Verdict, in_order

#: So many decisions are remembered with how far they got, to be reported once more.
MOST_REPORTS = 50


class DecisionCarrier:
    """Lets decisions through the one gate to carry_out, and reports how far they got. age_of:
    how old what has this stamp is, s."""

    def __init__(
        self,
        node: Node,
        max_decision_age: float,
        age_of: Callable[[Time], float],
        carry_out: Callable[[model.Decision], None],
    ) -> None:
        self._node = node
        self._gate = DecisionGate(node.get_name(), max_decision_age)
        self._age_of, self._carry_out = age_of, carry_out
        self._wall = Clock(clock_type=ClockType.SYSTEM_TIME)
        #: The newest report on each of the newest decisions.
        self._reports: dict[tuple[int, int], ActionReport] = {}
        self._verdicts: dict[Verdict, int] = dict.fromkeys(Verdict, 0)
        self._publisher = node.create_publisher(ActionReport, "safety/action", qos.DECISION)

    def begin(self) -> None:
        """Listen to the supervisor from now on."""
        self._subscription = self._node.create_subscription(
            SafetyDecision, "safety/decision", self._woken, qos.newest(qos.DECISION)
        )

    def report(self, decision: model.Decision, outcome: model.Outcome, detail: str) -> None:
        """Tell the supervisor how far a decision got."""
        message = ActionReport()
        message.header.stamp = self._wall.now().to_msg()
        message.epoch, message.id = decision.epoch, decision.id
        message.action, message.outcome = int(decision.action), int(outcome)
        message.link, message.detail = self._node.get_name(), detail
        message.newest_epoch = self._gate.newest_epoch
        message.newest_id = self._gate.newest_id
        self._publisher.publish(message)
        self._reports.pop((message.epoch, message.id), None)
        self._reports[message.epoch, message.id] = message
        while len(self._reports) > MOST_REPORTS:
            del self._reports[next(iter(self._reports))]
        self._node.get_logger().info(f"{_name(decision)}: {outcome.name}: {detail}")

    def counts(self) -> dict[str, object]:
        """What came through the gate and what did not, for diagnostics."""
        counts: dict[str, object] = {
            f"decisions: {verdict.value}": n for verdict, n in self._verdicts.items()
        }
        counts["newest decision"] = f"{self._gate.newest_epoch}.{self._gate.newest_id}"
        return counts

    def _woken(self, first: SafetyDecision) -> None:
        with ExitStack() as each:
            # What one of them does must not keep the others from being looked at.
            waiting = in_order((first, *self._waiting()), lambda message: message)
            for message in reversed(waiting):
                each.callback(self._decision, message)

    def _waiting(self) -> Iterator[SafetyDecision]:
        """What else has come."""
        with self._subscription.handle:
            for _ in range(qos.DECISION.depth):
                taken = self._subscription.handle.take_message(SafetyDecision, False)
                if taken is None:
                    return
                yield with_plain_texts(taken[0])

    def _decision(self, message: SafetyDecision) -> None:
        decision, log = messages.decision_from(message), self._node.get_logger()
        age = self._age_of(message.header.stamp)
        verdict = self._gate.judge(decision, age)
        self._verdicts[verdict] += 1
        if verdict is Verdict.ACT:
            # Told afterwards: the wire comes first.
            self._carry_out(decision)
            log.warning(f"{_name(decision)} ({decision.rule}): {'; '.join(decision.reasons)}")
        elif verdict is Verdict.REPEATED:
            # The supervisor has not heard our report, perhaps because it was not there yet.
            report = self._reports.get((decision.epoch, decision.id))
            if report is not None:
                self._publisher.publish(report)
        elif verdict is Verdict.OLDER:
            self.report(decision, model.Outcome.FAILED, Verdict.OLDER.value)
        elif verdict is Verdict.TOO_LATE:
            log.error(
                f"{_name(decision)} is {age:.3f} s old (limit {self._gate.max_decision_age:g} s): "
                "not acted on; do the hosts' clocks agree? is this host overloaded?",
                # It is sent again and again until somebody answers; diagnostics count.
                throttle_duration_sec=1.0,
            )


def _name(decision: model.Decision) -> str:
    return f"decision {decision.epoch}.{decision.id} {decision.action.name}"
