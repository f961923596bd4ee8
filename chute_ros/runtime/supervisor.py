"""Runtime of a supervisor around its core: heartbeat, lease, arming, reports, saved state.

Every message and request becomes an input of the core, every output an effect of the shell.

What goes wrong inside: an input that the core cannot take is left out, reported, and all goes on.
If the core fails without any input the supervisor falls silent: a standby takes over, and the
device nodes do what on_supervisor_lost says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from typing import Any, Protocol

from chute_ros.model import FIRES, Decision
from chute_ros.protocol.events import Notice, Severity
from chute_ros.runtime.arming import ArmCaller, DeviceArming
from chute_ros.runtime.deferred_work import DeferredWork
from chute_ros.runtime.lease_keeper import LeaseKeeper, LeaseShell
from chute_ros.runtime.supervisor_inputs import input_of
from chute_ros.runtime.topics import (
    DeviceBeat,
    LeaseClaim,
    PastDecision,
    SupervisorBeat,
    safety_told,
)
from chute_ros.supervisor import inputs
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.epochs import epoch_above
from chute_ros.supervisor.lease import LeaseConfig, LeaseEvent
from chute_ros.supervisor.state import Own, State
from chute_ros.supervisor.wakes import next_deadline

HEARTBEAT_INTERVAL = 0.1  # s
STATE_INTERVAL = 1.0  # s, at the latest


@dataclass(frozen=True)
class FinishedTurn:
    """What one update of the core was given and gave, for the black box."""

    now: float
    new: tuple[inputs.Input, ...]
    outputs: tuple[inputs.Output, ...]
    before: State
    after: State


@dataclass(frozen=True)
class Start:
    """epoch: rises from start to start; before: the state that the last one left, None: none that
    is to be gone on with; released, armed: what was released since the last reset, and what said
    last that it is armed, of whatever start; instance: a text that no other supervisor has."""

    epoch: int
    instance: str
    before: State | None = None
    released: frozenset[tuple[str, str]] = frozenset()
    armed: frozenset[tuple[str, str]] = frozenset()
    mode: inputs.Mode = inputs.Mode.ACTIVE


class SupervisorShell(LeaseShell, ArmCaller, Protocol):
    """Carries out what a supervisor does. publish gets decisions, PastDecision, SupervisorBeat,
    SafetyTold and LeaseClaim."""

    def record(self, turn: FinishedTurn) -> None:
        """Keep it in the black box."""

    def keep(self, state: State) -> None:
        """This is what a start anew goes on with."""

    def say(self, said: inputs.LogMessage) -> None:
        """A text of the core for a person."""

    def offer(self, offered: bool) -> None:
        """Offer the services to people, or no longer: they must reach the one that decides."""

    def failed(self, error: Exception, new: tuple[inputs.Input, ...]) -> str:
        """The core could not take this; returns it in words."""


class SupervisorRuntime:
    """One supervisor. now: monotonic s. Call turn once after it was made."""

    def __init__(
        self,
        config: SupervisorConfig,
        lease: LeaseConfig,
        shell: SupervisorShell,
        start: Start,
        now: float,
    ) -> None:
        self.config, self._shell = config, shell
        epoch = epoch_above(start.epoch, lease.rank)
        self.state = State(epoch, now, mode=start.mode, own=Own(leading=not lease.standby))
        self._first: tuple[inputs.Input, ...] = ()
        if start.before is not None:
            self.state = start.before
            if not lease.standby:
                above = epoch_above(max(epoch, start.before.epoch), lease.rank)
                self._first = (inputs.TakeOver(above),)
        released = self.state.released_since_reset | start.released
        self.state = replace(self.state, released_since_reset=released, last_armed=start.armed)
        self.lease = LeaseKeeper(lease, start.instance, shell, self, now)
        self._arming = DeviceArming(shell, self._armed)
        self.afterwards = DeferredWork()
        #: The stamp of the newest heartbeat of each link, ns.
        self._stamps: dict[str, int] = {}
        #: Id of the newest PastDecision.
        self._fired = 0
        self._tokens = count(1)
        self._callers: dict[int, Callable[[inputs.Finish], None]] = {}
        self._beat_at = self._state_at = now
        #: How late the newest heartbeat was, s.
        self.beat_late = 0.0
        #: What was last published of what a person is told at once.
        self._told_at_once: tuple[object, ...] = ()
        #: When the core has something to do, and when what is around it has, monotonic s.
        self.core_due = self.due = now

    # -- what comes -----------------------------------------------------------------------------

    def turn(self, new: tuple[inputs.Input, ...], now: float) -> None:
        """Give the core what came, or let it look at the clock, and do what it says."""
        first, self._first = self._first, ()
        if first:
            self._tell_history()
        self._look((*first, *new), now)

    def heard(self, one: Any, difference: float, now: float) -> None:
        """A device node's word came. difference: the wall clock here less its stamp, s; NaN: it
        has none."""
        self.turn((input_of(one, difference),), now)

    def heard_beat(self, one: DeviceBeat, stamp: int, difference: float, now: float) -> None:
        """A device node's heartbeat came. stamp: its own, ns."""
        if one.link in self.config.links:
            self._stamps[one.link] = stamp
        self.heard(one, difference, now)

    def claim(self, told: LeaseClaim, now: float) -> None:
        """A supervisor's claim came."""
        self.lease.claim(told, now)
        self._set_due(now)

    def ask(
        self,
        make: Callable[[int], inputs.Input],
        answered: Callable[[inputs.Finish], None],
        now: float,
    ) -> None:
        """A person asks for what make makes of a token; answered gets the answer."""
        token = next(self._tokens)
        self._callers[token] = answered
        self.turn((make(token),), now)

    # -- one turn -------------------------------------------------------------------------------

    def _look(self, new: tuple[inputs.Input, ...], now: float) -> None:
        self.lease.look(now)
        outputs = self._update(new, now)
        if outputs is None and new:
            outputs = self._update((), now)
        if outputs is None:
            # The core cannot even look at the clock: silence tells everybody.
            self.afterwards.look(now)
            self.core_due = self.due = now + HEARTBEAT_INTERVAL
            return
        self._carry_out(outputs, now)
        self._arming.give_up(now)
        if now >= self._beat_at:
            self._beat(now)
        self.afterwards.look(now)
        to_tell = now >= self._state_at or self._told_at_once != _at_once(self.state)
        if self.lease.leading and to_tell and not self.afterwards.quiet:
            self._publish_state(now)
        self._set_due(now)

    def _set_due(self, now: float) -> None:
        self.core_due = next_deadline(self.config, self.state, now)
        self.due = min(self.lease.deadline(now), self._beat_at, self.afterwards.until)

    def _update(
        self, new: tuple[inputs.Input, ...], now: float
    ) -> tuple[inputs.Output, ...] | None:
        """One turn of the core, whose decisions leave at once; None: it failed, the state is as
        before, and it was reported."""
        before = self.state
        try:
            self.state, outputs = update(self.config, before, new, now)
        except Exception as error:  # noqa: BLE001 - the loop must go on, and say so
            self._refuse(new, self._shell.failed(error, new))
            return None
        decided = [output for output in outputs if isinstance(output, inputs.Decide)]
        if decided and self.lease.config.standby:
            # Whoever takes over must know of what left.
            self.lease.tell(now)
        # Before anything is kept or told of it: a device waits for this.
        for one in decided:
            self._shell.publish(one.decision)
        self._shell.record(FinishedTurn(now, new, outputs, before, self.state))
        if decided:
            self.afterwards.decided(now)
            self.afterwards.tell(partial(self._tell_decisions, decided, now))
        return outputs

    def _refuse(self, refused: tuple[inputs.Input, ...], why: str) -> None:
        """Who called must not wait for what the core could not take."""
        for token in (getattr(one, "token", 0) for one in refused):
            self._finish(inputs.Finish(token, False, False, f"refused: {why}"))

    def _carry_out(self, outputs: tuple[inputs.Output, ...], now: float) -> None:
        """All but the decisions, which have left by now. Answers first: who waits for one must get
        it, whatever fails besides."""
        for output in sorted(outputs, key=lambda one: not isinstance(one, inputs.Finish)):
            if isinstance(output, inputs.Finish):
                self._finish(output)
            elif isinstance(output, inputs.ArmDevices):
                self._arming.begin(output, now)
            elif isinstance(output, inputs.Refused):
                self.lease.refused(output.newest_epoch, now)
            elif isinstance(output, inputs.LogMessage):
                self.afterwards.tell(partial(self._shell.say, output))

    def _finish(self, output: inputs.Finish) -> None:
        answered = self._callers.pop(output.token, None)
        if answered is not None:
            answered(output)

    def _armed(self, done: inputs.ArmDone, now: float) -> None:
        self.turn((done,), now)

    def _tell_decisions(self, decided: list[inputs.Decide], now: float) -> None:
        self._shell.keep(self.state)
        for output in decided:
            if not output.again:
                self._shell.log(Notice(Severity.WARNING, _told(output.decision)))
                if output.decision.action in FIRES:
                    self._tell_past(PastDecision(output.decision, now))

    def _tell_history(self) -> None:
        """What whoever was before has decided, for whoever comes late."""
        kill = self.state.killing.kill
        for one in (*([kill] if kill else []), *self.state.deploying.deploys):
            self._tell_past(PastDecision(one.decision, one.decided_at))

    def _tell_past(self, past: PastDecision) -> None:
        self._fired = max(self._fired, past.decision.id)
        self._shell.publish(past)

    # -- the lease ------------------------------------------------------------------------------

    def links_heard(self, now: float) -> int:
        """Number of received links."""
        return self.state.links_heard(self.config, now)

    def follow(self, state: State) -> None:
        """The leader's state is ours."""
        self.state = state

    def lease_event(self, event: LeaseEvent, now: float) -> None:
        """The leader has changed."""
        leads = self.lease.leading
        if leads:
            epoch = self.lease.next_epoch()
            text = f"became leader, epoch {epoch}: {event.value}"
            new: inputs.Input = inputs.TakeOver(epoch)
        else:
            text, new = f"became standby: {event.value}", inputs.StepDown(event.value)
        self._shell.log(Notice(Severity.WARNING, text))
        outputs = self._update((new,), now)
        self._shell.offer(leads)
        if leads:
            self._tell_history()
        self._carry_out(outputs or (), now)
        self.lease.tell(now)

    # -- what is told ---------------------------------------------------------------------------

    def _beat(self, now: float) -> None:
        self.beat_late = now - self._beat_at
        self._beat_at = max(self._beat_at + HEARTBEAT_INTERVAL, now)
        self._shell.publish(SupervisorBeat(self.lease.config.name, self.lease.leading))
        self.lease.tell(now)

    def _publish_state(self, now: float) -> None:
        self._told_at_once, self._state_at = _at_once(self.state), now + STATE_INTERVAL
        self._shell.keep(self.state)
        self._shell.publish(
            safety_told(
                self.config,
                self.lease.config.name,
                self.state,
                dict(self._stamps),
                now,
                self._fired,
            )
        )


def _at_once(state: State) -> tuple[object, ...]:
    """What a person is told at once."""
    acted_on = [name for name, evidence in state.rules.items() if evidence.latched]
    alarms = state.alarming.alarms
    return (state.stage, state.mode, state.next_id, alarms, state.device_blocks, acted_on)


def _told(decision: Decision) -> str:
    shadow = " (SHADOW, not sent)" if decision.shadow else ""
    device = f" device {decision.device}" if decision.device else ""
    return (
        f"{decision.named}: {decision.action.name}{shadow} by rule "
        f"'{decision.rule}' to {', '.join(decision.targets)}{device}: "
        f"{'; '.join(decision.reasons)}"
    )
