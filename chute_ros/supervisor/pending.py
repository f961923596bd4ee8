"""What is under way: a decision on its way to the devices, a wish of a device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated

from chute_ros.model import FIRES, Decision, Outcome
from chute_ros.supervisor.config import SupervisorConfig

#: Monotonic s of this host: another one that it is told has a clock of its own.
Time = Annotated[float, "of this host"]
#: Forward, and not.
_STEPS = frozenset({Outcome.SENT, Outcome.ACCEPTED, Outcome.CONFIRMED})
_NOT_NOW = frozenset({Outcome.FAILED, Outcome.REFUSED})
#: A flight block that nobody reports on is sent at least so often, s.
_RAREST_RESEND = 1.0
#: A kill or a deploy is sent again after so long at first, s: of those that a bad way loses the
#: kill must not be later than the deploy that follows it after 0.2 s.
_SOONEST_RESEND = 0.02
#: A device that asks for a kill is taken to want it for so long, s.
ASK_LASTS = 1.0


@dataclass(frozen=True)
class Ask:
    """A device asked for a kill at this monotonic time, s."""

    at: Time
    link: str
    reason: str

    @property
    def ends_at(self) -> float:
        """Until when it is taken to want it, monotonic s."""
        return self.at + ASK_LASTS


@dataclass(frozen=True)
class Pending:
    """A decision on its way, with every outcome that each link reported."""

    decision: Decision
    #: All that shall carry it out; a decision made again may name only those still missing.
    targets: tuple[str, ...]
    decided_at: Time
    sent_at: Time
    outcomes: Mapping[str, frozenset[Outcome]] = field(
        default_factory=lambda: MappingProxyType({})
    )
    details: tuple[str, ...] = ()
    #: Numbers under which the same was decided before; a report on one of them counts.
    earlier: frozenset[tuple[int, int]] = frozenset()
    #: It was said that nothing came of it.
    given_up: bool = False

    @property
    def number(self) -> tuple[int, int]:
        """How the gates of the device nodes order decisions."""
        return self.decision.epoch, self.decision.id

    def of(self, link: str) -> frozenset[Outcome]:
        """What this link reported so far."""
        return self.outcomes.get(link, frozenset())

    def reached(self, outcome: Outcome) -> bool:
        """A link has got this far, or further: one parachute that is out is enough."""
        every = [o for outcomes in self.outcomes.values() for o in outcomes]
        return any(o >= outcome for o in every if o in _STEPS)

    @property
    def confirmed(self) -> bool:
        """A device's own status showed the effect."""
        return self.reached(Outcome.CONFIRMED)

    def all_failed(self) -> bool:
        """Every target has failed, and none was confirmed."""
        failed = all(Outcome.FAILED in self.of(target) for target in self.targets)
        return failed and not self.confirmed

    def all_refused(self) -> bool:
        """Every target has failed, or its device refuses for now, and none was confirmed."""
        refused = all(self.of(target) & _NOT_NOW for target in self.targets)
        return refused and not self.confirmed

    def all_sent(self) -> bool:
        """Every target has at least sent it."""
        return all(self.of(target) & _STEPS for target in self.targets)

    def unreported(self) -> tuple[str, ...]:
        """The targets that have not even said that they have sent it."""
        return tuple(target for target in self.targets if not self.of(target))

    def not_begun(self) -> tuple[str, ...]:
        """The targets that have not reported, or only that they failed."""
        return tuple(t for t in self.targets if not self.of(t) & _STEPS)

    def resend_at(self, config: SupervisorConfig) -> float:
        """When to send it again: ever more rarely, as long as it stays without a report. What
        fires goes from _SOONEST_RESEND to resend_interval, another from there to its rarest."""
        slower = (self.sent_at - self.decided_at) / 4
        if self.decision.action in FIRES:
            return self.sent_at + min(max(_SOONEST_RESEND, slower), config.resend_interval)
        return self.sent_at + max(config.resend_interval, min(slower, _RAREST_RESEND))

    def newest_details(self) -> str:
        """What was reported last, in words."""
        return "; ".join(self.details[-2:])
