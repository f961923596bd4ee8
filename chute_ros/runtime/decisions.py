"""Decisions of the supervisor on their way into a device node, and reports on their way back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import ExitStack

from chute_ros.model import Decision, Outcome
from chute_ros.protocol.events import Notice, Severity
from chute_ros.runtime.shell import Shell
from chute_ros.runtime.topics import ActionTold
from chute_ros.supervisor.decision_gate import DecisionGate, DecisionVerdict, in_order
from chute_ros.supervisor.inputs import ActionReport

#: So many decisions are remembered with how far they got, to be reported once more.
MOST_REPORTS = 50
#: A late one is said again and again until somebody answers: one line within so many s.
_COMPLAIN_EACH = 1.0


class DecisionCarrier:
    """Lets decisions through the one gate to carry_out, and reports how far they got. age: how
    old (s) what came is, by the wall clock here less its stamp (s). for_others is told of those
    that others carry out."""

    def __init__(
        self,
        name: str,
        max_decision_age: float,
        shell: Shell,
        age: Callable[[float], float],
        carry_out: Callable[[Decision], None],
        for_others: Callable[[Decision], None],
    ) -> None:
        self._gate = DecisionGate(name, max_decision_age)
        self._shell, self._age, self._carry_out = shell, age, carry_out
        self._for_others = for_others
        #: The newest report on each of the newest decisions.
        self._reports: dict[tuple[int, int], ActionTold] = {}
        #: How many of those that came were judged so.
        self.verdicts: dict[DecisionVerdict, int] = dict.fromkeys(DecisionVerdict, 0)
        self._complained = -math.inf

    def heard(self, waiting: Iterable[tuple[Decision, float]], now: float) -> None:
        """Decisions came, each with the wall clock here less its stamp, s. What one of them does
        must not keep the others from being looked at."""
        with ExitStack() as each:  # from the last to the first, each whatever the others raise
            for decision, difference in reversed(in_order(waiting, lambda one: one[0])):
                each.callback(self._judge, decision, self._age(difference), now)

    def report(self, decision: Decision, outcome: Outcome, detail: str) -> None:
        """Tell the supervisor how far a decision got."""
        gate, key = self._gate, (decision.epoch, decision.id)
        report = ActionReport(*key, gate.link, outcome, detail, gate.newest_epoch, gate.newest_id)
        told = ActionTold(decision.action, report)
        self._shell.publish(told)
        self._reports.pop(key, None)
        self._reports[key] = told
        while len(self._reports) > MOST_REPORTS:
            del self._reports[next(iter(self._reports))]
        self._log(Severity.INFO, f"{_name(decision)}: {outcome.name}: {detail}")

    def counts(self) -> dict[str, object]:
        """What came through the gate and what did not, for diagnostics."""
        counts: dict[str, object] = {
            f"decisions: {verdict.value}": n for verdict, n in self.verdicts.items()
        }
        counts["newest decision"] = f"{self._gate.newest_id} of epoch {self._gate.newest_epoch}"
        return counts

    def _judge(self, decision: Decision, age: float, now: float) -> None:
        verdict = self._gate.judge(decision, age)
        self.verdicts[verdict] += 1
        if verdict is DecisionVerdict.ACT:
            # Told afterwards: the wire comes first.
            self._carry_out(decision)
            why = f"({decision.rule}): {'; '.join(decision.reasons)}"
            self._log(Severity.WARNING, f"{_name(decision)} {why}")
        elif verdict is DecisionVerdict.NOT_ADDRESSED and self._gate.counts(decision, age):
            self._for_others(decision)
        elif verdict is DecisionVerdict.REPEATED:
            # The supervisor has not heard our report, perhaps because it was not there yet.
            told = self._reports.get((decision.epoch, decision.id))
            if told is not None:
                self._shell.publish(told)
        elif verdict is DecisionVerdict.OLDER:
            self.report(decision, Outcome.FAILED, DecisionVerdict.OLDER.value)
        elif verdict is DecisionVerdict.TOO_LATE and now - self._complained >= _COMPLAIN_EACH:
            self._complained = now
            self._log(
                Severity.ERROR,
                f"{_name(decision)} is {age:.3f} s old (limit {self._gate.max_decision_age:g} s): "
                "not carried out; check that the hosts' clocks agree and this host is not "
                "overloaded",
            )

    def _log(self, severity: Severity, text: str) -> None:
        self._shell.log(Notice(severity, text))


def _name(decision: Decision) -> str:
    return f"{decision.named}, {decision.action.name}"
