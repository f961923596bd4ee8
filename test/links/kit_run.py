"""A run of a conformance kit on a simulated device, and what it found."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

from chute_ros.conformance.clause import Result, Verdict
from chute_ros.conformance.session import Ended, Session
from chute_ros.conformance.virtual import VirtualLine


class KitRun:
    """Kit and device on one line."""

    def __init__(self, session: Session[Any], device: Any) -> None:
        self.session, self.device = session, device
        self.line = VirtualLine(session, device)

    def to(self, until: Callable[[], bool] = lambda: False) -> Self:
        """To its end, or until this holds."""
        self.line.run(until)
        return self

    def silenced(self) -> Self:
        """To its end, as the device falls silent once the first clause was tried."""
        self.to(lambda: bool(self.results))
        self.device.act("silent")
        self.to()
        assert self.problem.startswith("the device fell silent")
        return self

    @property
    def results(self) -> dict[str, Result]:
        """By clause."""
        return {one.clause.name: one for one in self.line.events if isinstance(one, Result)}

    def of(self, verdict: Verdict) -> list[str]:
        """The clauses with this verdict."""
        return [name for name, one in self.results.items() if one.verdict is verdict]

    @property
    def problem(self) -> str:
        """How it ended."""
        (ended,) = (one for one in self.line.events if isinstance(one, Ended))
        return ended.problem
