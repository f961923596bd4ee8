"""COMMAND_LONG as a transaction: sent, resent, acknowledged or given up.

Source: MAVLink developer guide, "Command protocol". Sent again with a rising confirmation until an
acknowledgement comes from the component that was addressed; IN_PROGRESS extends the wait.

COMMAND_ACK names only the number of the command, so an answer to an earlier command of the same
number could be taken for one to a later command. Therefore every send owes one answer: a new
transaction counts as answered only by the first answer beyond those that earlier sends still owe
(they lapse after late_ack_window), and it may send once more for each of them.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from chute_ros.errors import ParameterError
from chute_ros.protocol.mavlink import results


@dataclass(frozen=True)
class CommandLimits:
    """Times (s) and tries of a command."""

    ack_timeout: float = 0.5
    tries: int = 3
    in_progress_timeout: float = 5.0
    late_ack_window: float = 5.0

    def __post_init__(self) -> None:
        for name in ("ack_timeout", "in_progress_timeout", "late_ack_window"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ParameterError(f"{name} is {value}: need a time above 0 s")
        if not 1 <= self.tries <= 255:
            raise ParameterError(f"tries is {self.tries}: need 1 to 255 (confirmation is a byte)")


@dataclass(frozen=True)
class Command:
    """A MAV_CMD for one component; params are param1 to param7."""

    system_id: int
    component_id: int
    number: int
    params: tuple[float, float, float, float, float, float, float] = (0.0,) * 7


@dataclass(frozen=True)
class Acknowledgement:
    """A COMMAND_ACK with its sender. target_* are 0 where the sender does not fill them."""

    system_id: int
    component_id: int
    number: int
    result: int
    progress: int = 255
    target_system: int = 0
    target_component: int = 0


@dataclass(frozen=True)
class SendCommand:
    """Put this command on the wire now."""

    command: Command
    confirmation: int


@dataclass(frozen=True)
class CommandFinished:
    """A transaction ended: result is a MAV_RESULT or NO_ACKNOWLEDGEMENT."""

    token: int
    command: Command
    result: int
    sends: int
    seconds: float
    superseded: bool = False

    @property
    def accepted(self) -> bool:
        """The device accepted the command."""
        return self.result == results.ACCEPTED

    def text(self) -> str:
        """What came of it, in words."""
        if self.superseded:
            return f"given up after {self.seconds:.2f} s for a newer command of the same number"
        if self.result == results.NO_ACKNOWLEDGEMENT:
            return f"no acknowledgement after {self.sends} sends in {self.seconds:.2f} s"
        return f"{results.result_text(self.result)} (after {self.seconds:.2f} s)"


_Key = tuple[int, int, int]


def _key(command: Command) -> _Key:
    return (command.system_id, command.component_id, command.number)


@dataclass
class _Open:
    token: int
    command: Command
    started: float
    deadline: float
    sends: int = 1
    answers_to_pass: int = 0
    send_times: list[float] = field(default_factory=list)


class CommandTransactions:
    """All commands of one link that are under way. One per component and command number."""

    def __init__(self, limits: CommandLimits) -> None:
        self.limits = limits
        self.late_count = 0
        self.unexpected_count = 0
        self._open: dict[_Key, _Open] = {}
        self._owed: dict[_Key, list[float]] = {}
        self._waiting: dict[_Key, deque[tuple[int, Command]]] = {}
        self._out: list[SendCommand] = []
        self._finished: list[CommandFinished] = []

    def start(self, token: int, command: Command, now: float, urgent: bool = False) -> None:
        """Send command; its end is reported with token.

        While one of the same number to the same component is open, an urgent command takes its
        place and any other waits for its turn.
        """
        key = _key(command)
        earlier = self._open.get(key)
        if earlier is not None and not urgent:
            self._waiting.setdefault(key, deque()).append((token, command))
            return
        if earlier is not None:
            self._end(key, earlier, results.NO_ACKNOWLEDGEMENT, now, superseded=True)
        self._begin(key, token, command, now)

    def send_once(self, command: Command, now: float) -> None:
        """Send command once; nobody waits for its acknowledgement, and it confirms nothing else."""
        key = _key(command)
        self._out.append(SendCommand(command, 0))
        self._owed.setdefault(key, []).append(now)
        if key in self._open:
            self._open[key].answers_to_pass += 1

    def _begin(self, key: _Key, token: int, command: Command, now: float) -> None:
        transaction = _Open(
            token,
            command,
            started=now,
            deadline=now + self.limits.ack_timeout,
            send_times=[now],
        )
        transaction.answers_to_pass = len(self._still_owed(key, now))
        self._open[key] = transaction
        self._out.append(SendCommand(command, 0))

    def acknowledged(self, ack: Acknowledgement, now: float) -> None:
        """An acknowledgement that is addressed to us came."""
        key = (ack.system_id, ack.component_id, ack.number)
        transaction = self._open.get(key)
        if transaction is None:
            if self._still_owed(key, now):
                self._owed[key].pop(0)
                self.late_count += 1
            else:
                self.unexpected_count += 1
            return
        if ack.result == results.IN_PROGRESS:
            if transaction.answers_to_pass:
                self.late_count += 1
            else:
                transaction.deadline = now + self.limits.in_progress_timeout
            return
        if transaction.answers_to_pass:
            owed = self._still_owed(key, now)
            if owed:
                owed.pop(0)
            transaction.answers_to_pass -= 1
            self.late_count += 1
            return
        # This answer settles one of the sends; the others may still be answered late.
        transaction.send_times.pop(0)
        self._end(key, transaction, ack.result, now)
        self._start_waiting(key, now)

    def update(self, now: float) -> None:
        """Look at the clock: send again, or give up."""
        for key, transaction in list(self._open.items()):
            if now < transaction.deadline:
                continue
            still_owed = len(self._still_owed(key, now))
            transaction.answers_to_pass = min(transaction.answers_to_pass, still_owed)
            if transaction.sends >= min(self.limits.tries + transaction.answers_to_pass, 256):
                self._end(key, transaction, results.NO_ACKNOWLEDGEMENT, now)
                self._start_waiting(key, now)
                continue
            self._out.append(SendCommand(transaction.command, transaction.sends))
            transaction.sends += 1
            transaction.send_times.append(now)
            transaction.deadline = now + self.limits.ack_timeout

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
        """Whoever started this command does not want it any more."""
        for waiting in self._waiting.values():
            for entry in [entry for entry in waiting if entry[0] == token]:
                waiting.remove(entry)
        for key, transaction in list(self._open.items()):
            if transaction.token == token:
                self._end(key, transaction, results.NO_ACKNOWLEDGEMENT, now, superseded=True)
                self._start_waiting(key, now)

    def _start_waiting(self, key: _Key, now: float) -> None:
        waiting = self._waiting.get(key)
        if not waiting:
            return
        token, command = waiting.popleft()
        if not waiting:
            del self._waiting[key]
        self._begin(key, token, command, now)

    def _still_owed(self, key: _Key, now: float) -> list[float]:
        since = now - self.limits.late_ack_window
        owed = [time for time in self._owed.get(key, []) if time > since]
        if owed:
            self._owed[key] = owed
        else:
            self._owed.pop(key, None)
        return owed

    def _end(
        self, key: _Key, transaction: _Open, result: int, now: float, superseded: bool = False
    ) -> None:
        del self._open[key]
        if transaction.send_times:
            self._owed.setdefault(key, []).extend(transaction.send_times)
        self._finished.append(
            CommandFinished(
                transaction.token,
                transaction.command,
                result,
                transaction.sends,
                now - transaction.started,
                superseded,
            )
        )
