"""Bus requests of several service calls in a row: each is a generator that yields its calls.

A script yields a Call and is resumed with its CallFinished; what it returns is its result. It
knows neither the clock nor the bus.
"""

from __future__ import annotations

from collections.abc import Generator, Hashable
from typing import Any

from chute_ros.protocol.dronecan.calls import (
    Call,
    CallFinished,
    CallLimits,
    SendCall,
    ServiceCalls,
)

Script = Generator[Call, CallFinished, Any]


class Scripts:
    """Runs scripts side by side. Nobody else of this node may call the services that they call."""

    def __init__(self, limits: CallLimits) -> None:
        self.calls = ServiceCalls(limits)
        self._running: dict[int, tuple[Hashable, Script]] = {}
        self._last_number = 0
        self._ended: list[tuple[Hashable, Any]] = []

    def begin(self, token: Hashable, script: Script, now: float) -> None:
        """Start a script; its result comes under token."""
        self._resume(token, script, None, now)

    def update(self, now: float) -> None:
        """Look at the clock."""
        self.calls.update(now)
        self.drive(now)

    def drive(self, now: float) -> None:
        """Hand every call that ended to its script."""
        finished = self.calls.take_finished()
        while finished:
            for one in finished:
                token, script = self._running.pop(one.token)
                self._resume(token, script, one, now)
            finished = self.calls.take_finished()

    def take_output(self) -> list[SendCall]:
        """Requests to send now; each is handed out once."""
        return self.calls.take_output()

    def take_ended(self) -> list[tuple[Hashable, Any]]:
        """(token, result) of the scripts that ended; each is handed out once."""
        ended, self._ended = self._ended, []
        return ended

    def _resume(
        self, token: Hashable, script: Script, answer: CallFinished | None, now: float
    ) -> None:
        try:
            call = next(script) if answer is None else script.send(answer)
        except StopIteration as end:
            self._ended.append((token, end.value))
            return
        self._last_number += 1
        self._running[self._last_number] = (token, script)
        self.calls.start(self._last_number, call, now)
