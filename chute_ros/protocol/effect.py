"""A command with its effect: acknowledged is not done; done is what the device's own status shows.

One closed loop serves release, kill, arming and requests: send (as a transaction), wait for the
acknowledgement, then for the effect; try again while that can help; give up in time and say which
of the two did not come. Nothing more is sent once the effect is there.
"""

from __future__ import annotations

import math
from typing import Generic

from chute_ros.model import Outcome
from chute_ros.protocol.effect_phases import ENDED, TRANSITIONS, Happening, Phase
from chute_ros.protocol.goal import (
    NO_ANSWER,
    Answer,
    CommandT,
    ConfirmedCommand,
    EffectFinished,
    EffectLimits,
    Report,
)
from chute_ros.transitions import after


class EffectLoop(Generic[CommandT]):
    """One goal on its way. The owner sends what take_commands gives and feeds back what comes."""

    def __init__(
        self,
        token: int,
        goal: ConfirmedCommand[CommandT],
        limits: EffectLimits,
        now: float,
        family: int = 0,
    ) -> None:
        self.token = token
        #: Marks the tries of this goal among the commands.
        self.family = family
        self.goal = goal
        self.phase = Phase.WAIT_ACKNOWLEDGEMENT
        self.finished: EffectFinished | None = None
        self._limits = limits
        self._started = now
        self._deadline = math.inf  # of the present phase
        #: When to look at the status, the soonest first.
        self._looks: list[float] = []
        self._patience_until = math.inf
        #: It was refused, not answered in time, or shows no effect: another way is due.
        self.hampered = False
        self._accepted_after = math.nan
        self._sends = 0
        self._result = NO_ANSWER
        self._answer = ""
        #: The newest word that it is at it, as long as no answer came after it.
        self._progress = ""
        self._newest_accepted = self._refused = False
        self._commands: list[CommandT] = []
        self._refreshes: list[CommandT] = []
        self._reports: list[Report] = []
        if goal.shown is not None and not goal.even_if_shown and goal.shown():
            self.phase = Phase.CONFIRMED
            self._end(True, f"{goal.effect} already; nothing was sent")
            return
        self._send()

    @property
    def ended(self) -> bool:
        """Nothing more will come of it."""
        return self.phase in ENDED

    @property
    def is_sent(self) -> bool:
        """Its command left at least once."""
        return self._sends > 0

    @property
    def answer(self) -> str:
        """The newest answer, in words."""
        return self._newest or "not answered"

    @property
    def _newest(self) -> str:
        return "; ".join(part for part in (self._answer, self._progress) if part)

    def command_sent(self, now: float) -> None:
        """The goal's order went out (it may have waited for its turn)."""
        self._sends += 1
        if self._sends == 1:
            self._reports.append(Report(self.token, Outcome.SENT, f"{self.goal.name} sent"))
            self._patience_until = now + self.goal.patience
        if self.goal.unacknowledged and self.phase is Phase.WAIT_ACKNOWLEDGEMENT:
            self._take(Happening.SENT_UNACKNOWLEDGED)
            self._deadline = math.inf if self.goal.once else now + self._limits.effect_timeout
            if self.goal.shown is None:
                self._take(Happening.EFFECT_SHOWN)
                self._end(True, f"{self.goal.name} sent; {self.goal.effect}")

    def command_finished(self, answer: Answer, now: float) -> None:
        """The transaction of the goal's order ended."""
        if self.phase is not Phase.WAIT_ACKNOWLEDGEMENT:
            return
        self._answer = answer.text()
        if answer.result != NO_ANSWER:
            self._result, self._newest_accepted = answer.result, answer.accepted
            self._progress = ""
        if answer.accepted:
            self._take(Happening.ACCEPTED)
            waited = now - self._started
            if math.isnan(self._accepted_after):
                self._accepted_after = waited
            detail = f"{self.goal.name} acknowledged after {waited:.2f} s"
            self._reports.append(Report(self.token, Outcome.ACCEPTED, detail))
            self._deadline = now + self._limits.effect_timeout
            self._patience_until = math.inf
            self._plan_looks(now)
            self.effect_may_show(now)
        elif not self._worth_another_try(answer):
            self._take(Happening.REFUSED)
            self._end(False, f"{self.goal.name} {self._answer}")
            self.hampered = True
        else:
            self._take(Happening.NOT_NOW)
            self._deadline = now + self._limits.retry_interval
            self.hampered = True
            refused = answer.result != NO_ANSWER and not answer.superseded
            if refused:
                # It may have done so already, which its status would show.
                self._plan_looks(now)
            if refused and not self._refused:
                self._refused = True
                detail = f"{self.goal.name} {self._answer}; tried again"
                self._reports.append(Report(self.token, Outcome.REFUSED, detail))

    def in_progress(self, words: str) -> None:
        """The device said that it is still at it."""
        self._progress, self._newest_accepted = words, False

    def effect_may_show(self, now: float) -> None:
        """The device said something: look whether it shows the effect."""
        if self.ended:
            return
        shown = self.goal.shown
        if self.goal.unacknowledged and not self._sends:
            self._shown_by_another(now)
            return
        alone = shown is not None and not self.goal.needs_acknowledgement
        if not alone and math.isnan(self._accepted_after):
            return
        if shown is not None and not shown():
            return
        self._take(Happening.EFFECT_SHOWN)
        acknowledged = "not acknowledged"
        if self.goal.unacknowledged:
            acknowledged = self._sent_text()
        elif not math.isnan(self._accepted_after):
            acknowledged = f"acknowledged after {self._accepted_after:.2f} s"
        if shown is None:
            self._end(True, f"{self.goal.name} {acknowledged}")
        else:
            waited = now - self._started
            self._end(True, f"{self.goal.effect} after {waited:.2f} s; {acknowledged}")

    def _shown_by_another(self, now: float) -> None:
        """The effect came while this one waited for its turn: it is not sent a second time."""
        shown = self.goal.shown is not None and self.goal.shown()
        if self.goal.even_if_shown or not shown or not self.goal.sent_by_another():
            return
        self._take(Happening.EFFECT_SHOWN)
        waited = now - self._started
        self._end(True, f"{self.goal.effect} after {waited:.2f} s; nothing was sent")

    def abandon(self, why: str, now: float) -> None:
        """It is not wanted any more."""
        if self.ended:
            return
        self._take(Happening.GIVE_UP)
        left = self.goal.unacknowledged and self._sends > 0
        sent = f"; it had been {self._sent_text()}" if left else ""
        self._end(False, f"{self.goal.name} given up: {why}{sent}")

    def update(self, now: float) -> None:
        """Look at the clock."""
        if self.ended:
            return
        if now >= self._started + self._limits.give_up_after:
            self._take(Happening.GIVE_UP)
            self._end(False, self._what_did_not_come(now))
            return
        if now >= self._patience_until:
            self._patience_until, self.hampered = math.inf, True
        self._look(now)
        if now < self._deadline:
            return
        if self.phase is Phase.WAIT_EFFECT:
            self.hampered = True
            self._take(Happening.EFFECT_LATE)
        self._take(Happening.RETRY_DUE)
        self._send()

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        if self.ended:
            return math.inf
        give_up = self._started + self._limits.give_up_after
        return min(give_up, self._deadline, self._patience_until, *self._looks[:1])

    def take_commands(self) -> list[CommandT]:
        """Commands to start now, each as a transaction of its own; each is handed out once."""
        commands, self._commands = self._commands, []
        return commands

    def take_refreshes(self) -> list[CommandT]:
        """Commands to send once now, whose acknowledgement does not matter."""
        refreshes, self._refreshes = self._refreshes, []
        return refreshes

    def take_reports(self) -> list[Report]:
        """Steps reached since the last call."""
        reports, self._reports = self._reports, []
        return reports

    def _send(self) -> None:
        self._commands.append(self.goal.commands[-1])
        self._deadline = math.inf
        self._looks = []

    def _plan_looks(self, now: float) -> None:
        if self.goal.refresh is not None:
            self._looks = [now + delay for delay in self.goal.looks]
            self._look(now)

    def _look(self, now: float) -> None:
        """Ask for the status, if it is time; after the last planned look at the usual pace."""
        if not self._looks or now < self._looks[0]:
            return
        assert self.goal.refresh is not None
        self._refreshes.append(self.goal.refresh)
        later = [at for at in self._looks if at > now]
        self._looks = later or [now + self._limits.retry_interval]

    def _worth_another_try(self, answer: Answer) -> bool:
        if answer.superseded:
            return self.goal.urgent
        return self.goal.insist or answer.not_now

    def _what_did_not_come(self, now: float) -> str:
        text = f"{self.goal.name} given up after {now - self._started:.1f} s: "
        not_shown = f"the device's own status never showed that {self.goal.effect}"
        if not math.isnan(self._accepted_after):
            newest = "" if self._newest_accepted else f"; newest answer: {self._newest}"
            acknowledged = f"acknowledged after {self._accepted_after:.2f} s"
            return f"{text}{acknowledged}, but {not_shown}{newest}"
        if not self._sends and self.goal.unacknowledged:
            return f"{text}never sent: its turn did not come, or the wire is closed"
        if not self._sends:
            return f"{text}never sent: an earlier command of the same number was under way"
        if self.goal.unacknowledged:
            return f"{text}{self._sent_text()}, but {not_shown}"
        answer = self._newest or "no acknowledgement came"
        if self.goal.shown is None or self.goal.shown():
            return text + answer
        return f"{text}{answer}, and {not_shown}"

    def _sent_text(self) -> str:
        return "sent once" if self._sends == 1 else f"sent {self._sends} times"

    def _take(self, happening: Happening) -> None:
        self.phase = after(TRANSITIONS, self.phase, happening)

    def _end(self, success: bool, message: str) -> None:
        # What was given up, or has come, needs no other way.
        self.hampered = False
        if not success and (hint := self.goal.hint()):
            message = f"{message}; {hint}"
        if remark := self.goal.remark():
            message = f"{remark}; {message}"
        outcome = Outcome.CONFIRMED if success else Outcome.FAILED
        self._reports.append(Report(self.token, outcome, message))
        # What nobody has fetched yet is not wanted any more.
        self._commands.clear()
        self._refreshes.clear()
        accepted = not math.isnan(self._accepted_after)
        shown = success and self.goal.shown is not None
        self.finished = EffectFinished(
            self.token, success, accepted, self._result, message, self._sends > 0, shown
        )
