"""Requests under way: goals with their loops, transactions and the messages they wait for."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

from chute_ros.model import Outcome
from chute_ros.protocol.effect import EffectLoop
from chute_ros.protocol.events import EventLog, RequestFinished, RequestReport, ended
from chute_ros.protocol.goal import ConfirmedCommand, EffectFinished, EffectLimits


class Watch(Protocol):
    """Waits for one message of one device."""

    @property
    def message(self) -> Any:
        """It; None: it has not come."""

    def offer(self, *said: Any) -> None:
        """A device said something, in the link's own terms: keep it if it is the one."""


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
        """The ended ones: an Answer each, with its token and command; each is handed out once."""

    def take_output(self) -> list[SendT]:
        """What is to be sent; each is handed out once."""


TransactionsT = TypeVar("TransactionsT", bound=Transactions[Any])


@dataclass(frozen=True)
class _Running:
    #: Of the goal, and of those that were begun beside it (ConfirmedCommand.otherwise).
    loops: list[EffectLoop[Any]]
    watch: Watch | None
    follow_up: tuple[ConfirmedCommand[Any], Watch] | None
    #: How the goal before this follow-up ended.
    first_end: EffectFinished | None = None

    def end(self) -> EffectLoop[Any] | None:
        """The loop that tells how the request ended; None: it goes on."""
        shown = [loop for loop in self.loops if loop.finished and loop.finished.success]
        if shown:
            # Where two ways show the same effect, the one that was accepted brought it about, or
            # else the newest: the one before it was refused.
            accepted = [loop for loop in shown if loop.finished and loop.finished.accepted]
            return (accepted or shown)[-1]
        all_ended = all(loop.ended for loop in self.loops)
        return self.loops[-1] if all_ended else None

    def text(self, end: EffectLoop[Any]) -> str:
        """What came of the request: of the way that tells it, and of those beside it."""
        assert end.finished is not None
        if len(self.loops) == 1:
            return end.finished.message
        others = [f"{loop.goal.name}: {loop.answer}" for loop in self.loops if loop is not end]
        return "; ".join([f"{end.goal.name}: {end.finished.message}", *others])


class Requests(EventLog, Generic[TransactionsT]):
    """Each request has a token of its owner's and ends in exactly one RequestFinished."""

    def __init__(self, commands: TransactionsT, limits: EffectLimits) -> None:
        super().__init__()
        self.commands = commands
        self._limits = limits
        self._running: dict[int, _Running] = {}
        #: Number of each command under way -> the loop that it is for.
        self._owners: dict[int, EffectLoop[Any]] = {}
        self._last_number = 0

    def __contains__(self, token: int) -> bool:
        return token in self._running

    def not_sent_yet(self, token: int) -> bool:
        """It is under way, but nothing of it has left."""
        running = self._running.get(token)
        return running is not None and not any(loop.is_sent for loop in running.loops)

    def under_way(self, name: str) -> bool:
        """A goal with this name has not ended yet."""
        return any(loop.goal.name == name for loop in self._loops())

    def begin(
        self,
        token: int,
        goal: ConfirmedCommand[Any],
        now: float,
        watch: Watch | None = None,
        follow_up: tuple[ConfirmedCommand[Any], Watch] | None = None,
    ) -> None:
        """Go for goal. watch: the message to hand over at the end. follow_up: what to ask after
        success; it adds its message to the answer, but cannot turn success into failure."""
        self._running[token] = _Running([self._loop(token, goal, now)], watch, follow_up)

    def abandon(self, token: int, why: str, now: float) -> None:
        """End a request, if it is under way; nothing more is sent for it."""
        running = self._running.get(token)
        for loop in running.loops if running is not None else ():
            loop.abandon(why, now)

    def make_way_for_release(self, now: float) -> None:
        """End whatever would make a parachute less ready."""
        self.abandon_where(lambda goal: goal.hinders_release, "a release was ordered", now)

    def abandon_where(
        self, which: Callable[[ConfirmedCommand[Any]], bool], why: str, now: float
    ) -> bool:
        """End the requests whose goal is one of those; whether there was any."""
        found = [
            token
            for token, running in self._running.items()
            if any(which(loop.goal) for loop in running.loops)
        ]
        for token in found:
            self.abandon(token, why, now)
        return bool(found)

    def refuse(self, token: int, why: str) -> None:
        """End a request before anything was sent."""
        self._events += ended(token, Outcome.FAILED, why)

    def heard(self, *said: Any) -> None:
        """A device said something: is it what a request waits for?"""
        for running in self._running.values():
            if running.watch is not None:
                running.watch.offer(*said)

    def effects_may_show(self, now: float) -> None:
        """A device said something: look whether it shows an effect."""
        for loop in self._loops():
            loop.effect_may_show(now)

    def update(self, now: float) -> None:
        """Look at the clock."""
        self.commands.update(now)
        for loop in self._loops():
            loop.update(now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        deadlines = (loop.next_deadline() for loop in self._loops())
        return min((self.commands.next_deadline(), *deadlines))

    def drive(self, now: float) -> list[Any]:
        """Move what is ready between loops and transactions; returns what is to be sent."""
        send: list[Any] = []
        moved = True
        while moved:
            moved = False
            for finished in self.commands.take_finished():
                loop = self._owners.pop(finished.token, None)
                if loop is not None and finished.command == loop.goal.commands[-1]:
                    loop.command_finished(finished, now)
            for token, running in self._running.items():
                self._try_otherwise(token, running, now)
                for loop in running.loops:
                    self._start_commands(loop, now)
            for out in self.commands.take_output():
                loop = None if out.token is None else self._owners.get(out.token)
                if loop is not None:
                    loop.command_sent(out.command, now)
                send.append(out)
                moved = True
            for token, running in list(self._running.items()):
                end = running.end()
                self._tell_reports(running, end)
                if end is not None and end.finished is not None:
                    finished = replace(end.finished, message=running.text(end))
                    self._close(token, running, finished, now)
                    moved = True
        return send

    def fail_untold(self, tokens: Collection[int], why: str) -> None:
        """What these requests did has turned out not to have been done, before it was told."""
        for at, event in enumerate(self._events):
            if isinstance(event, RequestFinished) and event.finished.token in tokens:
                failed = replace(event.finished, success=False, message=why, sent=False)
                self._events[at] = replace(event, finished=failed)

    def _number(self) -> int:
        self._last_number += 1
        return self._last_number

    def _loops(self) -> list[EffectLoop[Any]]:
        return [loop for running in self._running.values() for loop in running.loops]

    def _loop(self, token: int, goal: ConfirmedCommand[Any], now: float) -> EffectLoop[Any]:
        return EffectLoop(token, goal, self._limits, now, self._number())

    def _try_otherwise(self, token: int, running: _Running, now: float) -> None:
        end, newest = running.end(), running.loops[-1]
        done = end is not None and end.finished is not None and end.finished.success
        if newest.hampered and not done:
            goal = newest.goal.otherwise()
            if goal is not None:
                running.loops.append(self._loop(token, goal, now))

    def _start_commands(self, loop: EffectLoop[Any], now: float) -> None:
        for command in loop.take_commands():
            number = self._number()
            self._owners[number] = loop
            self.commands.start(number, command, now, loop.goal.urgent, loop.family)
        for command in loop.take_refreshes():
            self.commands.send_once(command, now)

    def _tell_reports(self, running: _Running, end: EffectLoop[Any] | None) -> None:
        """The steps of all ways; the end of one that is not the request's is none of them."""
        for loop in running.loops:
            for report in loop.take_reports():
                ends = report.outcome in (Outcome.CONFIRMED, Outcome.FAILED)
                if ends and end is None:
                    report = replace(report, outcome=Outcome.REFUSED)
                elif ends and loop is not end:
                    continue
                elif ends:
                    report = replace(report, detail=running.text(loop))
                self._events.append(RequestReport(report))

    def _close(self, token: int, running: _Running, finished: EffectFinished, now: float) -> None:
        del self._running[token]
        for number in [n for n, owner in self._owners.items() if owner in running.loops]:
            # What is not needed any more must not be sent again.
            del self._owners[number]
            self.commands.cancel(number, now)
        if running.follow_up is not None and finished.success:
            goal, watch = running.follow_up
            loop = self._loop(token, goal, now)
            self._running[token] = _Running([loop], watch, None, first_end=finished)
            return
        first = running.first_end
        if first is not None:
            finished = replace(first, message=f"{first.message}; {finished.message}")
        data = None if running.watch is None else running.watch.message
        self._events.append(RequestFinished(finished, data))
