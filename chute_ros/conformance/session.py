"""Tries one clause after the other. Run by the loop of a wire, or in virtual time."""

from __future__ import annotations

import math
from collections.abc import Collection, Generator, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from chute_ros.conformance.clause import (
    Clause,
    DecidedError,
    Packet,
    Result,
    Risk,
    Trial,
    Verdict,
    Wait,
)


class Bench(Protocol):
    """What speaks to the device. Its methods are those of a link (links/api.py), and:"""

    now: float
    #: When the device was heard last, monotonic s.
    heard_at: float
    traffic: list[Packet]
    #: What the clause that is tried has judged of what came before.
    looked_at: list[Packet]
    #: How often it was seen to start anew.
    starts: int

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """Take in bytes."""

    def stream_ended(self, stream: Hashable) -> None:
        """Forget what is half received."""

    def update(self, now: float) -> None:
        """Do what is due."""

    def next_deadline(self) -> float:
        """Return when update has something to do."""

    def take_output(self) -> list[bytes]:
        """Return what is to be sent."""

    def identity(self) -> Mapping[str, str]:
        """Return what the device has told of itself."""

    def find(self) -> Trial:
        """Find the device, and return who it is in words; ends as FAILED if it is not there."""

    def leave(self) -> Trial:
        """Leave the device disarmed and as it was found; ends as FAILED if that cannot be seen."""


@dataclass(frozen=True)
class Allowed:
    """What the person allows. options: needs of clauses that are met."""

    risk: Risk = Risk.NONE
    options: Collection[str] = ()


@dataclass(frozen=True)
class DeviceFound:
    """The device was found: who it is."""

    text: str


@dataclass(frozen=True)
class Trying:
    """A clause is about to be tried: the so-manieth of how many."""

    clause: Clause[Any]
    number: int
    of: int


@dataclass(frozen=True)
class Ended:
    """All is over. problem: why the device could not be tried, or was not left disarmed; empty:
    neither."""

    problem: str


#: A device may pause for so long between two clauses, s; after this, it is awaited for so long.
_PAUSE, _SILENCE = 3.0, 5.0
BenchT = TypeVar("BenchT", bound=Bench)
Steps = Generator[Wait, bool, None]


class Session(Generic[BenchT]):
    """A ProtocolLink (transport/loop.py). Its events are DeviceFound, Trying, Result and Ended."""

    def __init__(self, bench: BenchT, clauses: Sequence[Clause[BenchT]], allowed: Allowed) -> None:
        self.bench, self._clauses, self._allowed = bench, clauses, allowed
        self.ended = False
        self._events: list[Any] = []
        self._steps = self._every_step()
        #: None: the steps have not begun.
        self._wait: Wait | None = None
        self._aborted = False

    # -- as the loop wants it -------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        self.bench.receive(data, now, stream)
        self._go_on(now)

    def stream_ended(self, stream: Hashable) -> None:
        self.bench.stream_ended(stream)

    def update(self, now: float) -> None:
        self.bench.update(now)
        self._go_on(now)

    def next_deadline(self) -> float:
        if self.ended:
            return math.inf
        until = self._wait.until if self._wait is not None else -math.inf
        return min(until, self.bench.next_deadline())

    def take_output(self) -> list[bytes]:
        return self.bench.take_output()

    def take_events(self) -> list[Any]:
        events, self._events = self._events, []
        return events

    # -- for a person ----------------------------------------------------------------------------

    def abort(self, why: str, now: float) -> None:
        """Try nothing more; the device is left disarmed if it may have been armed."""
        if self.ended or self._aborted:
            return
        self._aborted = True
        self._steps.close()
        self._steps, self._wait = self._end(why), None
        self.update(now)

    # -- in their order --------------------------------------------------------------------------

    def _go_on(self, now: float) -> None:
        while not self.ended:
            ready = self._wait is not None and bool(self._wait.ready())
            if self._wait is not None and not ready and now < self._wait.until:
                return
            try:
                self._wait = next(self._steps) if self._wait is None else self._steps.send(ready)
            except StopIteration:
                self.ended = True

    def _every_step(self) -> Steps:
        try:
            who = yield from self.bench.find()
        except DecidedError as decided:
            self._events.append(Ended(str(decided)))
            return
        self._events.append(DeviceFound(who))
        problem, before, starts = "", "", self.bench.starts
        for number, clause in enumerate(self._clauses, start=1):
            if not problem and (yield from self._silent()):
                problem = f"the device fell silent{before}"
            if why := problem or self._forbidden(clause):
                self._events.append(Result(clause, Verdict.NOT_TRIED, why, (), 0.0))
                continue
            before = f" as {clause.name} was tried"
            self._events.append(Trying(clause, number, len(self._clauses)))
            began, first = self.bench.now, len(self.bench.traffic)
            self.bench.looked_at = []
            verdict, why, proof = yield from self._tried(clause)
            restarted = self.bench.starts > starts and not clause.restarts
            if restarted and verdict is not Verdict.FAILED:
                verdict, why = Verdict.FAILED, f"it restarted meanwhile ({why})"
            starts = self.bench.starts
            shown = proof or self._judged(first)
            took = self.bench.now - began
            self._events.append(Result(clause, verdict, why, shown, took))
        yield from self._end(problem)

    def _judged(self, first: int) -> tuple[Packet, ...]:
        """What the trial has looked at of before, and its own traffic, which begins here."""
        own = self.bench.traffic[first:]
        known = {id(one) for one in own}
        return (*(one for one in self.bench.looked_at if id(one) not in known), *own)

    def _silent(self) -> Generator[Wait, bool, bool]:
        """Nothing comes of it any more, not even after a while: the rest would prove nothing."""
        if self.bench.now - self.bench.heard_at < _PAUSE:
            return False
        heard = self.bench.heard_at
        return not (yield Wait(self.bench.now + _SILENCE, lambda: self.bench.heard_at > heard))

    def _forbidden(self, clause: Clause[BenchT]) -> str:
        """What the person has not allowed of it; empty: nothing."""
        if clause.risk > self._allowed.risk:
            return f"it takes {clause.risk.option}"
        options = self._allowed.options
        if clause.without and clause.without in options:
            return f"it is not tried with {clause.without}"
        if missing := [one for one in clause.needs.split() if one not in options]:
            return f"it takes {' '.join(missing)}"
        return ""

    def _tried(
        self, clause: Clause[BenchT]
    ) -> Generator[Wait, bool, tuple[Verdict, str, tuple[Packet, ...]]]:
        try:
            why = yield from clause.trial(self.bench)
        except DecidedError as decided:
            return decided.verdict, str(decided), decided.proof
        return Verdict.PASSED, why, ()

    def _end(self, problem: str) -> Steps:
        problems = [problem] if problem else []
        try:
            yield from self.bench.leave()
        except DecidedError as decided:
            problems.append(str(decided))
        self._events.append(Ended("; ".join(problems)))
