"""COMMAND_LONG as a transaction: sent, resent, acknowledged or given up.

Source: MAVLink developer guide, "Command protocol". Sent again with a rising confirmation until an
acknowledgement comes from the component that was addressed; IN_PROGRESS extends the wait, that of
an urgent command only a little: a device that restarts meanwhile has forgotten it.

Which answer is to which send: see unanswered.py. A transaction that must tell its answers from
those to N earlier sends may send N times more.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, field

from chute_ros.links.mavlink.protocol import results
from chute_ros.links.mavlink.protocol.unanswered import UnansweredSends
from chute_ros.settings import Settings, parameter


@dataclass(frozen=True)
class CommandLimits(Settings):
    """Times and tries of a command. Each try has its number in a byte, confirmation."""

    ack_timeout: float = parameter(
        0.2, "wait for an acknowledgement before the command is sent again", 0.02, 60.0, "s"
    )
    tries: int = parameter(
        5, "a command is sent at most this many times", 1, 100, name="ack_tries"
    )
    in_progress_timeout: float = parameter(
        5.0,
        "wait for the result after the answer IN_PROGRESS; a release or a kill is sent again "
        "after effect_timeout",
        0.1,
        600.0,
        "s",
    )
    late_ack_window: float = parameter(
        5.0, "a late acknowledgement may still come within this time", 0.1, 60.0, "s"
    )


@dataclass(frozen=True)
class MavCommand:
    """A MAV_CMD for one component; params are param1 to param7."""

    system_id: int
    component_id: int
    number: int
    params: tuple[float, float, float, float, float, float, float] = (0.0,) * 7


@dataclass(frozen=True)
class Acknowledgement:
    """A COMMAND_ACK with its sender."""

    system_id: int
    component_id: int
    number: int
    result: int


@dataclass(frozen=True)
class SendCommand:
    """Put this command on the wire now."""

    command: MavCommand
    confirmation: int
    #: Of the transaction that it belongs to; None: of none (send_once).
    token: int | None = None


@dataclass(frozen=True)
class CommandFinished:
    """A transaction ended: result is a MAV_RESULT or NO_ACKNOWLEDGEMENT."""

    token: int
    command: MavCommand
    result: int
    sends: int
    seconds: float
    superseded: bool = False

    @property
    def accepted(self) -> bool:
        """The device accepted the command."""
        return self.result == results.ACCEPTED

    @property
    def not_now(self) -> bool:
        """No answer, or one that may be another later: worth another try."""
        return self.result in (results.TEMPORARILY_REJECTED, results.NO_ACKNOWLEDGEMENT)

    def text(self) -> str:
        """What came of it, in words."""
        if self.superseded:
            return f"given up after {self.seconds:.2f} s for a newer command of the same number"
        if self.result == results.NO_ACKNOWLEDGEMENT:
            return f"no acknowledgement after {self.sends} sends in {self.seconds:.2f} s"
        return f"{results.result_text(self.result)} (after {self.seconds:.2f} s)"


_Key = tuple[int, int, int]

#: Family of the sends that nobody waits for.
_NOBODY = 0


def _key(command: MavCommand) -> _Key:
    return (command.system_id, command.component_id, command.number)


@dataclass
class _Transaction:
    """One that waits for its turn since started, or is under way since then."""

    tokens: list[int]
    command: MavCommand
    family: int
    started: float
    urgent: bool
    deadline: float = math.inf
    #: Of its newest send.
    sent: float = math.nan
    in_progress: bool = False
    #: Sends of others that may still be answered, and how often it may be sent itself.
    others: int = 0
    tries: int = 0
    sends: int = 0
    answers: Counter[int] = field(default_factory=Counter)


class CommandTransactions:
    """All commands of one link that are under way. One per component and command number.

    urgent_wait: an urgent one that is IN_PROGRESS is sent again so long after its newest send, s.
    """

    def __init__(self, limits: CommandLimits, urgent_wait: float = math.inf) -> None:
        self.limits = limits
        self._urgent_wait = urgent_wait
        self.late_count = 0
        self.unexpected_count = 0
        self._open: dict[_Key, _Transaction] = {}
        self._sends: dict[_Key, UnansweredSends] = {}
        self._waiting: dict[_Key, deque[_Transaction]] = {}
        self._out: list[SendCommand] = []
        self._finished: list[CommandFinished] = []

    def start(
        self,
        token: int,
        command: MavCommand,
        now: float,
        urgent: bool = False,
        family: int | None = None,
    ) -> None:
        """Send command; its end is reported with token. family: by default the token.

        While one of the same number to the same component is open, a command waits for its turn.
        An urgent one does not: it joins one that asks for the very same, which is sent again at
        once, or takes the place of any other; what waits is given up, lest it undo it.
        """
        key = _key(command)
        new = _Transaction([token], command, token if family is None else family, now, urgent)
        earlier = self._open.get(key)
        if earlier is not None and not urgent:
            self._waiting.setdefault(key, deque()).append(new)
            return
        for other in self._waiting.pop(key, ()):
            self._report(other, results.NO_ACKNOWLEDGEMENT, now, superseded=True)
        if earlier is not None and earlier.command == command:
            earlier.tokens.append(token)
            earlier.urgent = True
            earlier.tries = max(earlier.tries, earlier.sends + self.limits.tries)
            self._send(earlier, now)
            return
        if earlier is not None:
            self._end(key, earlier, results.NO_ACKNOWLEDGEMENT, now, superseded=True)
        self._begin(key, new, now)

    def send_once(self, command: MavCommand, now: float) -> None:
        """Send command once; nobody waits for its answer, and it confirms nothing else."""
        key = _key(command)
        self._out.append(SendCommand(command, 0))
        self._sends_of(key).add(_NOBODY, now)
        if key in self._open:
            self._open[key].others += 1

    def acknowledged(self, ack: Acknowledgement, now: float) -> list[int] | None:
        """An acknowledgement that is addressed to us came. Returns whose command it says to be in
        progress; None: it answers none of ours."""
        key = (ack.system_id, ack.component_id, ack.number)
        sends, transaction = self._sends.get(key), self._open.get(key)
        if sends is None:
            self.unexpected_count += 1
            return None
        others = 0 if transaction is None else self._others_of(key, transaction, now)
        if ack.result == results.IN_PROGRESS:
            sends.in_progress(now, self.limits.in_progress_timeout)
            if transaction is None or others:
                self.late_count += 1
                return []
            self._extend(transaction, now)
            return list(transaction.tokens)
        if not sends.answer(now):
            self.unexpected_count += 1
            return None
        if transaction is None:
            self.late_count += 1
        else:
            transaction.answers[ack.result] += 1
            if others and transaction.answers[ack.result] <= transaction.others:
                self.late_count += 1
            else:
                self._end(key, transaction, ack.result, now)
                self._start_waiting(key, now)
        return []

    def restarted(self, system_id: int, component_id: int, now: float) -> None:
        """This device restarted: what it was at is forgotten, and sent again at once."""
        for (system, component, _), transaction in self._open.items():
            if (system, component) == (system_id, component_id) and transaction.in_progress:
                transaction.deadline = now

    def update(self, now: float) -> None:
        """Look at the clock: send again, or give up."""
        for key, transaction in list(self._open.items()):
            if now < transaction.deadline:
                continue
            others = self._others_of(key, transaction, now)
            if transaction.sends >= min(transaction.tries + others, 256):
                self._end(key, transaction, results.NO_ACKNOWLEDGEMENT, now)
                self._start_waiting(key, now)
            else:
                self._send(transaction, now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return min((t.deadline for t in self._open.values()), default=math.inf)

    def take_output(self) -> list[SendCommand]:
        """The commands to put on the wire, oldest first; each is handed out once."""
        out, self._out = self._out, []
        return out

    def take_finished(self) -> list[CommandFinished]:
        """The transactions that ended, oldest first; each is handed out once."""
        finished, self._finished = self._finished, []
        return finished

    def cancel(self, token: int, now: float) -> None:
        """Whoever started this command does not want it any more: nothing is sent or reported."""
        for key, waiting in list(self._waiting.items()):
            left = deque(entry for entry in waiting if token not in entry.tokens)
            if left:
                self._waiting[key] = left
            else:
                del self._waiting[key]
        for key, transaction in list(self._open.items()):
            if token in transaction.tokens:
                transaction.tokens.remove(token)
                if not transaction.tokens:
                    del self._open[key]
                    self._start_waiting(key, now)

    def _sends_of(self, key: _Key) -> UnansweredSends:
        return self._sends.setdefault(key, UnansweredSends(self.limits.late_ack_window))

    def _others_of(self, key: _Key, transaction: _Transaction, now: float) -> int:
        # Those that were answered before it began are not waited for again.
        return min(transaction.others, self._sends_of(key).of_others(transaction.family, now))

    def _begin(self, key: _Key, transaction: _Transaction, now: float) -> None:
        transaction.started, transaction.tries = now, self.limits.tries
        transaction.others = self._sends_of(key).of_others(transaction.family, now)
        self._open[key] = transaction
        self._send(transaction, now)

    def _send(self, transaction: _Transaction, now: float) -> None:
        confirmation = min(transaction.sends, 255)
        token = transaction.tokens[-1]
        self._out.append(SendCommand(transaction.command, confirmation, token))
        self._sends_of(_key(transaction.command)).add(transaction.family, now)
        transaction.sends += 1
        transaction.sent = now
        transaction.deadline = now + self.limits.ack_timeout

    def _extend(self, transaction: _Transaction, now: float) -> None:
        """It is in progress. An urgent one is not left to a device that may have forgotten it."""
        until = now + self.limits.in_progress_timeout
        if transaction.urgent:
            # No sooner than it would be sent again without any answer.
            until = max(transaction.deadline, min(until, transaction.sent + self._urgent_wait))
        transaction.deadline, transaction.in_progress = until, True

    def _start_waiting(self, key: _Key, now: float) -> None:
        waiting = self._waiting.get(key)
        if not waiting:
            return
        start = waiting.popleft()
        if not waiting:
            del self._waiting[key]
        self._begin(key, start, now)

    def _end(
        self, key: _Key, one: _Transaction, result: int, now: float, superseded: bool = False
    ) -> None:
        del self._open[key]
        self._report(one, result, now, superseded)

    def _report(self, one: _Transaction, result: int, now: float, superseded: bool) -> None:
        seconds = now - one.started
        self._finished += [
            CommandFinished(token, one.command, result, one.sends, seconds, superseded)
            for token in one.tokens
        ]
