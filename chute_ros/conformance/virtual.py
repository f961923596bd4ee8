"""A session and a simulated device on one line, in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, Protocol

from chute_ros.conformance.session import Bench, Session

#: The time that a frame takes on the line, s.
_ON_THE_LINE = 1e-4
_BEGINS = 100.0


class VirtualDevice(Protocol):
    """What of a simulated device is used (transport/loop.py)."""

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """Take in bytes."""

    def update(self, now: float) -> None:
        """Do what is due."""

    def next_deadline(self) -> float:
        """Return when update has something to do."""

    def take_output(self) -> list[bytes]:
        """Return what is to be sent."""


class VirtualLine:
    """sent: all that the session has sent; events: all of the session's."""

    def __init__(self, session: Session[Bench], device: VirtualDevice) -> None:
        self.now = _BEGINS
        self.sent: list[bytes] = []
        self.events: list[Any] = []
        self.session, self.device = session, device

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """To the session's end, or until this holds."""
        while not self.session.ended and not until():
            self._step()

    def _step(self) -> None:
        """To whatever happens next."""
        due = min(self.session.next_deadline(), self.device.next_deadline())
        self.now = max(self.now, due)
        self.device.update(self.now)
        self.session.update(self.now)
        moved = True
        while moved:
            told, asked = self.device.take_output(), self.session.take_output()
            self.sent += asked
            self.now += _ON_THE_LINE
            for data in told:
                self.session.receive(data, self.now)
            for data in asked:
                self.device.receive(data, self.now)
            moved = bool(told or asked)
        self.events += self.session.take_events()
