"""When which token is written: one a write, spaced, the heartbeat in between, the urgent first.

The flight computer takes a packet for one token, sleeps 100 ms after each command and acknowledges
nothing. So two tokens never leave together, and each write waits for the one before.

    slot free:  heartbeat that is overdue  >  urgent  >  heartbeat that is due  >  the others

Sources: Umbilical Reference, sections 1 and 2; the receiver's own behaviour, measured.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from chute_ros.protocol.goal import NO_ANSWER
from chute_ros.settings import Settings, parameter


@dataclass(frozen=True)
class Command:
    """A command by its name in the reference, and its token on the wire."""

    name: str
    token: bytes


HEARTBEAT = Command("heartbeat", b"<H>")


@dataclass(frozen=True)
class SchedulerLimits(Settings):
    """When tokens are written. most_waiting: commands that wait at most."""

    spacing: float = parameter(
        0.12,
        "interval between two writes; the receiver sleeps 0.1 s after each command",
        0.1,
        1.0,
        "s",
        name="command_spacing",
    )
    heartbeat_interval: float = parameter(
        1.0,
        "interval between two <H> to the flight computer; its own limit is 3 to 15 s",
        0.25,
        5.0,
        "s",
        name="umbilical_heartbeat_interval",
    )
    heartbeat_slack: float = parameter(
        0.5,
        "a <H> may be late by this time to let <V>, <D> and <d> go first",
        0.0,
        10.0,
        "s",
        name="umbilical_heartbeat_slack",
    )
    most_waiting: int = 32

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.heartbeat_interval < 2 * self.spacing:
            why = "commands must fit in between; need an interval of at least two spacings"
            raise self.contradiction(why, "heartbeat_interval", "spacing")

    @property
    def latest_heartbeat(self) -> float:
        """Longest time between two heartbeats, s, while the owner is alive and the wire open."""
        return self.heartbeat_interval + self.heartbeat_slack + self.spacing


@dataclass(frozen=True)
class SendToken:
    """Write this command's token. token: number of the request's command; None: of none."""

    command: Command
    token: int | None = None


@dataclass(frozen=True)
class NotSent:
    """A command that found no place to wait: how its transaction ended."""

    token: int
    command: Command
    most_waiting: int

    accepted = False
    not_now = False
    superseded = False
    result = NO_ANSWER

    def text(self) -> str:
        """What came of it, in words."""
        return f"not sent: {self.most_waiting} commands are waiting already"


class CommandScheduler:
    """The commands on their way to the wire; sends them, and nothing ever comes back."""

    def __init__(self, limits: SchedulerLimits) -> None:
        self.limits = limits
        self.heartbeats_sent = 0
        self.commands_sent = 0
        self.last_heartbeat = math.nan
        self.is_open = False
        #: No heartbeat is sent for now, whoever is alive.
        self.heartbeats_held = False
        self._urgent: deque[SendToken] = deque()
        self._others: deque[SendToken] = deque()
        self._heartbeats_until = -math.inf
        self._free_at = -math.inf
        self._heartbeat_at = -math.inf
        self._output: list[SendToken] = []
        self._finished: list[NotSent] = []

    @property
    def waiting(self) -> int:
        """Commands that have not been sent yet."""
        return len(self._urgent) + len(self._others)

    def wire_opened(self, now: float) -> None:
        """Tokens can be written. Whoever had the port before may just have written one."""
        self.is_open = True
        self._free_at = max(self._free_at, now + self.limits.spacing)
        self._heartbeat_at = now

    def wire_closed(self) -> None:
        """Nothing can be written; what waits goes on waiting."""
        self.is_open = False

    def owner_alive(self, until: float) -> None:
        """Heartbeats may be sent until then: a hung owner must look dead from outside."""
        self._heartbeats_until = until

    # -- as Requests wants it (Transactions) -----------------------------------------------------

    def start(self, token: int, command: Command, now: float, urgent: bool, family: int) -> None:
        """Queue a command of a request."""
        if self.waiting >= self.limits.most_waiting and not urgent:
            self._finished.append(NotSent(token, command, self.limits.most_waiting))
            return
        queue = self._urgent if urgent else self._others
        queue.append(SendToken(command, token))

    def send_once(self, command: Command, now: float) -> None:
        """Queue a command that belongs to no request's loop."""
        self._others.append(SendToken(command))

    def cancel(self, token: int, now: float) -> None:
        """It is not needed any more: it does not leave if it has not yet."""
        for queue in (self._urgent, self._others):
            for waiting in [one for one in queue if one.token == token]:
                queue.remove(waiting)

    def withdraw(self, which: Callable[[Command], bool]) -> None:
        """Those of send_once that are not needed any more do not leave if they have not yet."""
        for waiting in [one for one in self._others if one.token is None and which(one.command)]:
            self._others.remove(waiting)

    def update(self, now: float) -> None:
        """Nothing ends by time here. What leaves does so by send_next, after all has been
        cancelled that is not needed any more."""

    def send_next(self, now: float) -> None:
        """Look at the clock: at most one token becomes ready."""
        if now >= self._heartbeats_until:
            self._heartbeats_until = -math.inf
        if not self.is_open or now < self._free_at:
            return
        beats = self._heartbeats_until > -math.inf and not self.heartbeats_held
        late = self.limits.heartbeat_slack
        if beats and now >= self._heartbeat_at + late:
            self._beat(now)
        elif self._urgent:
            self._send(self._urgent.popleft(), now)
        elif beats and now >= self._heartbeat_at:
            self._beat(now)
        elif self._others:
            self._send(self._others.popleft(), now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        if not self.is_open:
            return math.inf
        if self._urgent or self._others:
            return self._free_at
        if self._heartbeat_at < self._heartbeats_until and not self.heartbeats_held:
            return max(self._free_at, self._heartbeat_at)
        return math.inf

    def take_finished(self) -> list[NotSent]:
        """Commands that found no place; each is handed out once."""
        finished, self._finished = self._finished, []
        return finished

    def take_output(self) -> list[SendToken]:
        """What is to be written; each is handed out once."""
        output, self._output = self._output, []
        return output

    # -- inside ----------------------------------------------------------------------------------

    def _beat(self, now: float) -> None:
        self.heartbeats_sent += 1
        self.last_heartbeat = now
        self._heartbeat_at = now + self.limits.heartbeat_interval
        self._emit(SendToken(HEARTBEAT), now)

    def _send(self, waiting: SendToken, now: float) -> None:
        self.commands_sent += 1
        self._emit(waiting, now)

    def _emit(self, send: SendToken, now: float) -> None:
        self._free_at = now + self.limits.spacing
        self._output.append(send)
