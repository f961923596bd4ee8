"""A run of a conformance kit on a simulated device, and what it found."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

from chute_ros.conformance.clause import Result, Risk, Verdict
from chute_ros.conformance.kit import Kit
from chute_ros.conformance.session import Allowed, Ended, Session
from chute_ros.conformance.virtual import VirtualLine


def results(line: VirtualLine) -> dict[str, Result]:
    """By clause."""
    return {one.clause.name: one for one in line.events if isinstance(one, Result)}


def of(line: VirtualLine, verdict: Verdict) -> list[str]:
    """The clauses with this verdict."""
    return [name for name, one in results(line).items() if one.verdict is verdict]


def problem(line: VirtualLine) -> str:
    """How it ended."""
    (ended,) = (one for one in line.events if isinstance(one, Ended))
    return ended.problem


def fails_in(kit: Kit, name: str) -> None:
    """A simulated device that breaks this clause fails in it, by itself, or with all others where
    it takes what they have done."""
    (clause,) = (one for one in kit.clauses if one.name == name)
    device, bench = kit.simulated(name, clause.needs)
    allowed = Allowed(Risk.FIRES, clause.needs.split())
    line = VirtualLine(Session(bench, (clause,), allowed), device)
    line.run()
    if of(line, Verdict.FAILED) == [name]:
        _is_shown(results(line)[name])
    else:
        fails_in_no_other(kit, name)


def fails_in_no_other(kit: Kit, name: str) -> None:
    """The same with all clauses, which takes long."""
    line = kit.virtual(name)
    line.run()
    assert of(line, Verdict.FAILED) == [name]
    _is_shown(results(line)[name])


def _is_shown(result: Result) -> None:
    assert result.why
    assert result.proof, "packets that show it"


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
        return results(self.line)

    def of(self, verdict: Verdict) -> list[str]:
        """The clauses with this verdict."""
        return of(self.line, verdict)

    @property
    def problem(self) -> str:
        """How it ended."""
        return problem(self.line)
