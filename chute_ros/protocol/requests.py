"""Requests under way: goals with their loops, transactions and the messages they wait for."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

from chute_ros.model import Outcome
from chute_ros.protocol.effect import (
    NO_ANSWER,
    Answer,
    EffectFinished,
    EffectLimits,
    EffectLoop,
    Goal,
    Report,
)
from chute_ros.protocol.events import Event, RequestFinished, RequestReport


class Watch(Protocol):
    """Waits for one message of one device."""

    @property
    def message(self) -> Any:
        """It; None: it has not come."""

    def offer(self, *said: Any) -> None:
        """A device said something, in the link's own terms: keep it if it is the one."""


class Finished(Answer, Protocol):
    """The end of a transaction, with what it belongs to."""

    @property
    def token(self) -> int:
        """Number of the transaction."""

    @property
    def command(self) -> Any:
        """What was sent."""


class Send(Protocol):
    """Put this on the wire."""

    @property
    def token(self) -> int | None:
        """Number of the transaction; None: of none."""

    @property
    def command(self) -> Any:
        """What is to be sent."""


SendT = TypeVar("SendT", bound=Send)


class Transactions(Protocol[SendT]):
    """Commands of one protocol: sent, resent, answered or given up."""

    def start(self, token: int, command: Any, now: float, urgent: bool, family: int) -> None:
        """Begin one, at the latest when those before it to the same device have ended."""

    def send_once(self, command: Any, now: float) -> None:
        """Send one whose answer does not matter."""

    def cancel(self, token: int, now: float) -> None:
        """It is not needed any more."""

    def update(self, now: float) -> None:
        """Look at the clock."""

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""

    def take_finished(self) -> list[Any]:
        """The ended ones (Finished); each is handed out once."""

    def take_output(self) -> list[SendT]:
        """What is to be sent; each is handed out once."""


TransactionsT = TypeVar("TransactionsT", bound=Transactions[Any])


@dataclass(frozen=True)
class _Running:
    loop: EffectLoop[Any]
    #: Marks the tries of this goal among the commands.
    family: int
    watch: Watch | None
    follow_up: tuple[Goal[Any], Watch] | None
    #: How the goal before this follow-up ended.
    first_end: EffectFinished | None = None


class Requests(Generic[TransactionsT]):
    """Each request has a token of its owner's and ends in exactly one RequestFinished."""

    def __init__(self, commands: TransactionsT, limits: EffectLimits) -> None:
        self.commands = commands
        self._limits = limits
        self._running: dict[int, _Running] = {}
        #: Number of each command under way -> token of its request.
        self._owners: dict[int, int] = {}
        self._last_number = 0
        self._events: list[Event] = []

    def __contains__(self, token: int) -> bool:
        return token in self._running

    def not_sent_yet(self, token: int) -> bool:
        """It is under way, but nothing of it has left."""
        running = self._running.get(token)
        return running is not None and not running.loop.is_sent

    def under_way(self, name: str) -> bool:
        """A goal with this name has not ended yet."""
        return any(running.loop.goal.name == name for running in self._running.values())

    def begin(
        self,
        token: int,
        goal: Goal[Any],
        now: float,
        watch: Watch | None = None,
        follow_up: tuple[Goal[Any], Watch] | None = None,
    ) -> None:
        """Go for goal. watch: the message to hand over at the end. follow_up: what to ask after
        success; it adds its message to the answer, but cannot turn success into failure."""
        loop = EffectLoop(token, goal, self._limits, now)
        self._running[token] = _Running(loop, self._number(), watch, follow_up)

    def abandon(self, token: int, why: str, now: float) -> None:
        """End a request, if it is under way; nothing more is sent for it."""
        running = self._running.get(token)
        if running is not None:
            running.loop.abandon(why, now)

    def make_way_for_release(self, now: float) -> None:
        """End whatever would make a parachute less ready."""
        self.abandon_where(lambda goal: goal.hinders_release, "a release was ordered", now)

    def abandon_where(self, which: Callable[[Goal[Any]], bool], why: str, now: float) -> bool:
        """End the requests whose goal is one of those; whether there was any."""
        found = [token for token, running in self._running.items() if which(running.loop.goal)]
        for token in found:
            self.abandon(token, why, now)
        return bool(found)

    def refuse(self, token: int, why: str) -> None:
        """End a request before anything was sent."""
        self._events.append(RequestReport(Report(token, Outcome.FAILED, why)))
        finished = EffectFinished(token, False, False, NO_ANSWER, why)
        self._events.append(RequestFinished(finished))

    def heard(self, *said: Any) -> None:
        """A device said something: is it what a request waits for?"""
        for running in self._running.values():
            if running.watch is not None:
                running.watch.offer(*said)

    def effects_may_show(self, now: float) -> None:
        """A device said something: look whether it shows an effect."""
        for running in self._running.values():
            running.loop.effect_may_show(now)

    def update(self, now: float) -> None:
        """Look at the clock."""
        self.commands.update(now)
        for running in self._running.values():
            running.loop.update(now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        loops = (running.loop.next_deadline() for running in self._running.values())
        return min((self.commands.next_deadline(), *loops))

    def drive(self, now: float) -> list[Any]:
        """Move what is ready between loops and transactions; returns what is to be sent."""
        send: list[Any] = []
        moved = True
        while moved:
            moved = False
            for finished in self.commands.take_finished():
                loop = self._loop_of(self._owners.pop(finished.token, None))
                if loop is not None and finished.command == loop.goal.commands[-1]:
                    loop.command_finished(finished, now)
            for token, running in list(self._running.items()):
                for command in running.loop.take_commands():
                    number = self._number()
                    self._owners[number] = token
                    urgent = running.loop.goal.urgent
                    self.commands.start(number, command, now, urgent, running.family)
                for command in running.loop.take_refreshes():
                    self.commands.send_once(command, now)
            for out in self.commands.take_output():
                loop = None if out.token is None else self._loop_of(self._owners.get(out.token))
                if loop is not None:
                    loop.command_sent(out.command, now)
                send.append(out)
                moved = True
            for token, running in list(self._running.items()):
                reports = running.loop.take_reports()
                self._events += [RequestReport(report) for report in reports]
                if running.loop.finished is not None:
                    self._close(token, running, running.loop.finished, now)
                    moved = True
        return send

    def fail_untold(self, tokens: Collection[int], why: str) -> None:
        """What these requests did has turned out not to have been done, before it was told."""
        for at, event in enumerate(self._events):
            if isinstance(event, RequestFinished) and event.finished.token in tokens:
                failed = replace(event.finished, success=False, message=why, sent=False)
                self._events[at] = replace(event, finished=failed)

    def take_events(self) -> list[Event]:
        """Reports and ends, oldest first; each is handed out once."""
        events, self._events = self._events, []
        return events

    def _number(self) -> int:
        self._last_number += 1
        return self._last_number

    def _loop_of(self, token: int | None) -> EffectLoop[Any] | None:
        running = None if token is None else self._running.get(token)
        return None if running is None else running.loop

    def _close(self, token: int, running: _Running, finished: EffectFinished, now: float) -> None:
        del self._running[token]
        for number in [n for n, owner in self._owners.items() if owner == token]:
            # What is not needed any more must not be sent again.
            del self._owners[number]
            self.commands.cancel(number, now)
        if running.follow_up is not None and finished.success:
            goal, watch = running.follow_up
            self.begin(token, goal, now, watch)
            self._running[token] = replace(self._running[token], first_end=finished)
            return
        first = running.first_end
        if first is not None:
            finished = replace(first, message=f"{first.message}; {finished.message}")
        data = None if running.watch is None else running.watch.message
        self._events.append(RequestFinished(finished, data))
