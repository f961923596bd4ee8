"""The one gate through which a decision of the supervisor reaches a device. Default is deny."""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

from chute_ros.model import Action, Decision


class DecisionVerdict(enum.Enum):
    """What a device node does with a decision."""

    ACT = "acts on it"
    NOT_ADDRESSED = "addressed to others"
    SHADOW = "shadow: only reported, not done"
    REPEATED = "the same as one already acted on"
    OLDER = "older than one already seen"
    TOO_LATE = "came too late"


class Numbered(Protocol):
    """A decision, whatever carries it."""

    @property
    def epoch(self) -> int:
        """Of the supervisor's term."""

    @property
    def id(self) -> int:
        """Within it."""


KeptT = TypeVar("KeptT")


def in_order(waiting: Iterable[KeptT], decision: Callable[[KeptT], Numbered]) -> list[KeptT]:
    """What waits for a node that hung, as it is to be looked at: the decisions of an epoch in the
    order in which they were made. They are said again and again, and a deploy may be the first
    that is young enough. An epoch that came before another in what waits stays before it."""
    by_epoch: dict[int, list[KeptT]] = {}
    for one in waiting:
        by_epoch.setdefault(decision(one).epoch, []).append(one)
    groups = by_epoch.values()
    return [one for group in groups for one in sorted(group, key=lambda one: decision(one).id)]


@dataclass
class DecisionGate:
    """Lets a decision through if it is addressed, not shadow, newer than any seen, and young.

    max_decision_age: s. Clocks of two hosts may differ by this much before that becomes a fault.
    """

    link: str
    max_decision_age: float
    newest_epoch: int = 0
    newest_id: int = 0
    newest_action: Action = Action.NONE
    #: The newest that were acted on. One that comes again after a newer one is a repetition, not
    #: a refusal: its outcome is what the supervisor has not heard.
    acted: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=50))

    def judge(self, decision: Decision, age: float) -> DecisionVerdict:
        """What to do with decision, which is age seconds old. Of one for others the epoch is
        remembered, of one for this link that it was acted on."""
        if self.link not in decision.targets:
            self._note_term(decision, age)
            return DecisionVerdict.NOT_ADDRESSED
        if decision.shadow:
            return DecisionVerdict.SHADOW
        order = (decision.epoch, decision.id)
        newer = order > (self.newest_epoch, self.newest_id)
        if order in self.acted:
            return DecisionVerdict.REPEATED
        if not newer and not self._missed_kill(decision):
            return DecisionVerdict.OLDER
        if not self._young(age):
            return DecisionVerdict.TOO_LATE
        if newer:
            self.newest_epoch, self.newest_id = order
            self.newest_action = decision.action
        self.acted.append(order)
        return DecisionVerdict.ACT

    def counts(self, decision: Decision, age: float) -> bool:
        """One for others, judged before, is of who leads now, meant, and new enough to be acted on
        there."""
        return not decision.shadow and self._young(age) and decision.epoch == self.newest_epoch

    def _young(self, age: float) -> bool:
        return -self.max_decision_age <= age <= self.max_decision_age

    def _note_term(self, decision: Decision, age: float) -> None:
        """Who decides for others under a higher epoch leads: who led before it does so no more."""
        if not decision.shadow and self._young(age) and decision.epoch > self.newest_epoch:
            self.newest_epoch, self.newest_id = decision.epoch, 0
            self.newest_action = Action.NONE

    def _missed_kill(self, decision: Decision) -> bool:
        """The kill that belongs before a deploy, and was lost on its way: turning motors tear an
        open canopy, so that it is better late than never."""
        same_term = decision.epoch == self.newest_epoch
        kill = decision.action is Action.KILL
        return kill and same_term and self.newest_action is Action.DEPLOY
