"""Requests under way: goals with their loops, transactions and the messages they wait for."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

from chute_ros.model import Outcome
from chute_ros.protocol.effect import EffectLoop
from chute_ros.protocol.events import EventLog, RequestFinished, RequestReport, ended
from chute_ros.protocol.goal import ConfirmedCommand, EffectFinished, EffectLimits, Report


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
class _Pursuit:
    """One goal of a request, and those begun beside it (ConfirmedCommand.otherwise): any is
    enough. whose: the device, if the request has several goals."""

    whose: str
    loops: list[EffectLoop[Any]]

    def finished(self) -> EffectFinished | None:
        """How it ended; None: it goes on."""
        end = self._end()
        if end is None or end.finished is None:
            return None
        if len(self.loops) == 1:
            return end.finished
        others = [f"{loop.goal.name}: {loop.answer}" for loop in self.loops if loop is not end]
        text = "; ".join([f"{end.goal.name}: {end.finished.message}", *others])
        return replace(end.finished, message=text)

    def _end(self) -> EffectLoop[Any] | None:
        """The loop that tells how it ended; None: it goes on."""
        shown = [loop for loop in self.loops if loop.finished and loop.finished.success]
        if shown:
            # Where two ways show the same effect, the one that was accepted brought it about, or
            # else the newest: the one before it was refused.
            accepted = [loop for loop in shown if loop.finished and loop.finished.accepted]
            return (accepted or shown)[-1]
        all_ended = all(loop.ended for loop in self.loops)
        return self.loops[-1] if all_ended else None


@dataclass(frozen=True)
class _Running:
    #: Side by side: all must be reached.
    pursuits: list[_Pursuit]
    watch: Watch | None = None
    follow_up: tuple[ConfirmedCommand[Any], Watch] | None = None
    #: How the goal before this follow-up ended.
    first_end: EffectFinished | None = None

    @property
    def loops(self) -> list[EffectLoop[Any]]:
        """Those of all goals."""
        return [loop for pursuit in self.pursuits for loop in pursuit.loops]

    def finished(self) -> EffectFinished | None:
        """How the request ended; None: it goes on. What was not reached is named first."""
        ends = [(pursuit.whose, pursuit.finished()) for pursuit in self.pursuits]
        told = [(whose, end) for whose, end in ends if end is not None]
        if len(told) < len(ends):
            return None
        told.sort(key=lambda one: one[1].success)
        _, first = told[0]
        if len(told) == 1:
            return first
        return replace(
            first,
            accepted=all(end.accepted for _, end in told),
            message="; ".join(f"{whose}: {end.message}" for whose, end in told),
            sent=any(end.sent for _, end in told),
            shown=all(end.shown for _, end in told),
        )


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
        pursuit = self._pursuit(token, "", goal, now)
        self._running[token] = _Running([pursuit], watch, follow_up)

    def begin_all(
        self, token: int, goals: Mapping[str, ConfirmedCommand[Any]], now: float
    ) -> None:
        """Go for all these goals, by the names of their devices; all must be reached."""
        self._running[token] = _Running(
            [self._pursuit(token, whose, goal, now) for whose, goal in goals.items()]
        )

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

    def in_progress(self, number: int, words: str) -> None:
        """A device said that it is still at the command with this number."""
        loop = self._owners.get(number)
        if loop is not None:
            loop.in_progress(words)

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
            for answer in self.commands.take_finished():
                loop = self._owners.pop(answer.token, None)
                if loop is not None:
                    loop.command_finished(answer, now)
            for token, running in self._running.items():
                for pursuit in running.pursuits:
                    self._try_otherwise(token, pursuit, now)
                for loop in running.loops:
                    self._start_commands(loop, now)
            for out in self.commands.take_output():
                loop = None if out.token is None else self._owners.get(out.token)
                if loop is not None:
                    loop.command_sent(now)
                    send += self._prepared(out.command, now)
                send.append(out)
                moved = True
            for token, running in list(self._running.items()):
                finished = running.finished()
                self._tell_reports(token, running, finished)
                if finished is not None:
                    self._close(token, running, finished, now)
                    moved = True
            # What one of several goals has reached, or given up, is not sent again for the others.
            moved |= self._cancel(lambda loop: loop.ended, now)
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

    def _pursuit(
        self, token: int, whose: str, goal: ConfirmedCommand[Any], now: float
    ) -> _Pursuit:
        return _Pursuit(whose, [self._loop(token, goal, now)])

    def _try_otherwise(self, token: int, pursuit: _Pursuit, now: float) -> None:
        end, newest = pursuit.finished(), pursuit.loops[-1]
        if newest.hampered and not (end is not None and end.success):
            goal = newest.goal.otherwise()
            if goal is not None:
                pursuit.loops.append(self._loop(token, goal, now))

    def _prepared(self, command: Any, now: float) -> list[Any]:
        """What any goal under way wants to be sent right before this command."""
        prepare: list[Any] = []
        for loop in self._loops():
            *before, last = loop.goal.commands
            if last == command and not loop.ended:
                prepare += [one for one in before if one not in prepare]
        for one in prepare:
            self.commands.send_once(one, now)
        return self.commands.take_output() if prepare else []

    def _start_commands(self, loop: EffectLoop[Any], now: float) -> None:
        for command in loop.take_commands():
            number = self._number()
            self._owners[number] = loop
            self.commands.start(number, command, now, loop.goal.urgent, loop.family)
        for command in loop.take_refreshes():
            self.commands.send_once(command, now)

    def _tell_reports(
        self, token: int, running: _Running, finished: EffectFinished | None
    ) -> None:
        """The steps of all ways, and one end; the end of one way alone is none."""
        for loop in running.loops:
            for report in loop.take_reports():
                if report.outcome is Outcome.FAILED and finished is None:
                    self._events.append(RequestReport(replace(report, outcome=Outcome.REFUSED)))
                elif report.outcome not in (Outcome.CONFIRMED, Outcome.FAILED):
                    self._events.append(RequestReport(report))
        if finished is not None:
            outcome = Outcome.CONFIRMED if finished.success else Outcome.FAILED
            self._events.append(RequestReport(Report(token, outcome, finished.message)))

    def _cancel(self, which: Callable[[EffectLoop[Any]], bool], now: float) -> bool:
        """What those loops do not need any more must not be sent again; whether there was any."""
        numbers = [number for number, owner in self._owners.items() if which(owner)]
        for number in numbers:
            del self._owners[number]
            self.commands.cancel(number, now)
        return bool(numbers)

    def _close(self, token: int, running: _Running, finished: EffectFinished, now: float) -> None:
        del self._running[token]
        self._cancel(lambda loop: loop in running.loops, now)
        if running.follow_up is not None and finished.success:
            goal, watch = running.follow_up
            pursuit = self._pursuit(token, "", goal, now)
            self._running[token] = _Running([pursuit], watch, first_end=finished)
            return
        first = running.first_end
        if first is not None:
            finished = replace(first, message=f"{first.message}; {finished.message}")
        data = None if running.watch is None else running.watch.message
        self._events.append(RequestFinished(finished, data))
