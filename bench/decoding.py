"""Decoders beside each other: the same bytes to each, batch by batch, taking turns."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from bench.report import COMPARED, compared
from chute_ros.errors import ChuteError
from chute_ros.tools.pages import table


class Peer(Protocol):
    """What is measured. feed: one read of the wire; how many messages were decoded."""

    def feed(self, data: bytes, now: float) -> int: ...


#: What came in one read, and when (s).
Batch = Sequence[tuple[float, bytes]]


@dataclass
class Times:
    """Microseconds a message, of each batch; messages that were not decoded."""

    batches: list[float] = field(default_factory=list)
    missed: int = 0


def take_turns(
    what: str, peers: Mapping[str, Peer], batches: Iterable[tuple[Batch, int]], may_miss: int = 0
) -> dict[str, Times]:
    """Feed each batch, of so many messages, to each peer. may_miss: that many are no mistake."""
    times = {name: Times() for name in peers}
    for batch, count in batches:
        for name, peer in peers.items():
            decoded = 0
            start = time.perf_counter_ns()
            for at, data in batch:
                decoded += peer.feed(data, at)
            times[name].batches.append((time.perf_counter_ns() - start) / 1e3 / count)
            times[name].missed += count - decoded
            if times[name].missed > may_miss:
                raise ChuteError(f"{what}: {name} decoded {decoded} of {count}")
    return times


def times_table(what: str, measured: Mapping[str, Mapping[str, Times]], base: str) -> str:
    """Rows of everything that was measured, with ratios to the peer that is called base."""
    rows = []
    for name, times in measured.items():
        for peer, one in times.items():
            cells = compared(one.batches, times[base].batches, "{:.1f} us")
            rows.append((f"{name}: {peer}", *cells, str(one.missed)))
    return table((what, *COMPARED, "missed"), rows)
