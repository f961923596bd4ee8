"""What a command of any link is for: what to send, and how to see that it worked.

effect.py carries a goal through to its end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from chute_ros.model import Outcome
from chute_ros.settings import Settings, parameter

#: Result of a command that nobody answered: beside the eight bits of any protocol's results.
NO_ANSWER = 255


@dataclass(frozen=True)
class EffectLimits(Settings):
    """How long a command may take, and when it is sent again."""

    effect_timeout: float = parameter(
        1.5,
        "wait for the effect of an acknowledged command before the command is sent again",
        0.05,
        60.0,
        "s",
    )
    retry_interval: float = parameter(
        0.25,
        "interval before a command that was refused or not answered is sent again, and between "
        "two requests for the status that shows its effect",
        0.02,
        60.0,
        "s",
    )
    give_up_after: float = parameter(
        5.0, "time limit of a command with all its repetitions", 0.1, 600.0, "s"
    )


class Commanded:
    """Settings of a link whose commands have an effect."""

    effect: EffectLimits

    @property
    def give_up_after(self) -> float:
        """Limit for all tries of a command together, s."""
        return self.effect.give_up_after


#: A command of the link's protocol; the loop only compares them.
CommandT = TypeVar("CommandT")


class Answer(Protocol):
    """How the transaction of one command ended, whatever the protocol."""

    @property
    def accepted(self) -> bool:
        """The device accepted the command."""

    @property
    def not_now(self) -> bool:
        """No answer, or one that may be another later: worth another try."""

    @property
    def superseded(self) -> bool:
        """Given up for a newer command."""

    @property
    def result(self) -> int:
        """The protocol's result, or NO_ANSWER."""

    def text(self) -> str:
        """What came of it, in words."""


@dataclass(frozen=True)
class ConfirmedCommand(Generic[CommandT]):
    """What to send and how to see that it worked.

    commands: the last one is the order, whose answer counts. Those before it prepare it: each time
    it leaves, they leave right before it, and what is answered to them neither ends nor delays it.
    shown: True once the device's own status shows the effect; None: the acknowledgement is all
    that there is to see. refresh: asks the device for the status that shows it.
    insist: no refusal but time ends the tries. urgent: does not queue behind another command.
    hinders_release: makes the parachute less ready; gives way to a release.
    needs_acknowledgement: the effect alone, which may have come by itself, does not count.
    unacknowledged: the protocol acknowledges nothing; the effect counts once it was sent.
    once: never sent a second time, though the effect does not show.
    even_if_shown: sent although the status shows the effect already.
    sent_by_another: the same has left for another request, and may have had the effect.
    hint: what may be the cause of a refusal, by what the device says of itself; empty: unknown.
    remark: what whoever reads the end must know first; empty: nothing.
    looks: delays after each answer, s, at which refresh is sent; then each retry_interval. An
    answer that comes before the device's own status changes would else be looked at too early.
    otherwise: another goal with the same effect. It is begun beside this one once this one is
    refused, has no answer within patience (s after it was sent), or shows no effect in time.
    None: there is none, or not now; it is asked for again.
    """

    name: str
    commands: tuple[CommandT, ...]
    effect: str
    shown: Callable[[], bool] | None = None
    refresh: CommandT | None = None
    insist: bool = False
    urgent: bool = False
    hinders_release: bool = False
    needs_acknowledgement: bool = False
    unacknowledged: bool = False
    once: bool = False
    even_if_shown: bool = False
    sent_by_another: Callable[[], bool] = bool
    hint: Callable[[], str] = str
    remark: Callable[[], str] = str
    looks: tuple[float, ...] = (0.0,)
    otherwise: Callable[[], ConfirmedCommand[CommandT] | None] = lambda: None
    patience: float = math.inf


@dataclass(frozen=True)
class Report:
    """A step that the loop reached."""

    token: int
    outcome: Outcome
    detail: str


@dataclass(frozen=True)
class EffectFinished:
    """The end of a loop. result: the protocol's result of the newest answer, or NO_ANSWER.

    sent: the command left at least once. shown: the device's own status showed the effect.
    """

    token: int
    success: bool
    accepted: bool
    result: int
    message: str
    sent: bool = False
    shown: bool = False
