"""What the targets of links have in common: a program drives one, and what leaves is looked at."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from chute_ros.protocol.events import RequestFinished
from fuzz.orders import Orders, check_not_spinning, run_out
from fuzz.program import Program

#: A link may be due so often at one moment.
_MOST_DUE = 64


class Linked(ABC):
    """One link, and what it was asked for. The subclass sets the steps that a program has."""

    _steps: tuple[Callable[[Program], None], ...]

    def __init__(self, link: Any) -> None:
        self._link = link
        self._orders = Orders()
        self._now = 1000.0

    def held(self) -> object:
        return self._link

    def feed(self, data: bytes) -> None:
        program = Program(data)
        while not program.over:
            program.choice(self._steps)(program)
            self._turn(self._now)
        self._run_out()

    # -- steps of a program ----------------------------------------------------------------------

    def _wait(self, p: Program) -> None:
        self._now += p.choice((0.0, 0.01, 0.1, 0.5, 1.0, 3.0, 10.0, 100.0))

    def _to_next_deadline(self, p: Program) -> None:
        self._now = max(self._now, min(self._link.next_deadline(), self._now + 1.0))

    def _owner(self, p: Program) -> None:
        self._link.owner_alive(self._now + p.byte() / 50.0)

    # -- what comes of it ------------------------------------------------------------------------

    def _run_out(self) -> None:
        self._now = run_out(self._link, self._orders, self._now, self._turn)

    def _turn(self, now: float) -> None:
        self._now = now
        for _ in range(_MOST_DUE):
            self._link.update(now)
            if self._link.next_deadline() > now:
                break
        check_not_spinning(self._link, now)
        for event in self._link.take_events():
            self._happened(event)
        for raw in self._link.take_output():
            self._left(raw)
        self._orders.settled()

    def _happened(self, event: object) -> None:
        if isinstance(event, RequestFinished):
            self._orders.ended(event.finished.token)

    @abstractmethod
    def _left(self, raw: bytes) -> None:
        """This left the link: was it ordered?"""
