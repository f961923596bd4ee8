"""What a run of the kit found, and of which device, kit and day."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from chute_ros.conformance.clause import Packet, Result, Verdict


@dataclass(frozen=True)
class ConformanceReport:
    """about: what to read of device, kit and machine, each with its name. problem: why it is not
    whole; empty: it is. traffic: all that was sent and received; began: Unix ns of its zero."""

    document: str
    device: str
    about: Mapping[str, str]
    results: Sequence[Result]
    problem: str
    traffic: Sequence[Packet]
    began: int

    def of(self, verdict: Verdict) -> int:
        """How many clauses."""
        return Counter(one.verdict for one in self.results)[verdict]

    @property
    def summary(self) -> str:
        """In one line."""
        counted = ", ".join(f"{self.of(one)} {one.value}" for one in Verdict if self.of(one))
        return f"{self.device}: {counted or 'nothing was tried'}"
