"""From the bytes of a $TELEM line to its values: what a line costs, of every layout.

Our decoder, and the whole link that it is a part of, beside a bare script that splits and floats.
Batches take turns, in one run.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Protocol

from bench.bare_telemetry import Splitter
from bench.command import at_least, run
from bench.flight_lines import REAL_RATE, FlightLines
from bench.report import load, summary, table
from chute_ros.errors import ChuteError
from chute_ros.protocol.umbilical import sayings
from chute_ros.protocol.umbilical.config import UmbilicalConfig
from chute_ros.protocol.umbilical.decoder import LINES_TO_RECOGNISE, TelemetryDecoder
from chute_ros.protocol.umbilical.events import TelemetryReceived
from chute_ros.protocol.umbilical.layouts import Layout
from chute_ros.protocol.umbilical.link import UmbilicalLink
from chute_ros.protocol.umbilical.stream import Line, StreamReader
from chute_ros.transport.telem_layouts import load_layouts

HEADING = "Umbilical telemetry"

LINK, DECODER, BARE = "chute_ros, whole link", "chute_ros, decoder", "bare split and float"
#: Lines of a batch.
BATCH = 100

#: More lines than these are not lost where two layouts have one count: those that the other one
#: needs to be recognised, without the line that does it.
_MAY_MISS = LINES_TO_RECOGNISE - 1


@dataclass
class Times:
    """Microseconds a line, of each batch; lines that were not decoded."""

    batches: list[float] = field(default_factory=list)
    missed: int = 0


#: Layout -> peer -> what it took.
Measured = dict[str, dict[str, Times]]


class Peer(Protocol):
    """What is measured. feed: one read of the port; how many lines were decoded."""

    def feed(self, data: bytes, now: float) -> int: ...


class Bare:
    """The script."""

    def __init__(self, _: list[Layout]) -> None:
        self._splitter = Splitter()

    def feed(self, data: bytes, _: float) -> int:
        return len(self._splitter.feed(data))


class Decoder:
    """Bytes to lines, what each line is, and the record in it, as UmbilicalLink does it."""

    def __init__(self, layouts: list[Layout]) -> None:
        counts: Counter[str] = Counter()
        self._decoder = TelemetryDecoder(layouts, "", counts)
        self._reader = StreamReader(self._decoder.is_telemetry, counts)

    def feed(self, data: bytes, now: float) -> int:
        records = 0
        for item in self._reader.feed(data):
            if isinstance(item, Line):
                said, _ = sayings.recognise(item.data)
                if isinstance(said, sayings.Telemetry):
                    records += self._decoder.decode(said.body, now) is not None
        return records


class Link:
    """What the loop between wire and protocol does with the link each time that bytes came."""

    def __init__(self, layouts: list[Layout]) -> None:
        self._link = UmbilicalLink(UmbilicalConfig(settle_time=0.0), layouts)
        self._link.wire_opened(0.0)
        self._link.owner_alive(math.inf)

    def feed(self, data: bytes, now: float) -> int:
        link = self._link
        link.receive(data, now, "port")
        link.update(now)
        link.take_output()
        events: list[Any] = link.take_events()
        link.next_deadline()
        return sum(isinstance(event, TelemetryReceived) for event in events)


def add_options(options: argparse.ArgumentParser) -> None:
    """How much is measured."""
    options.add_argument(
        "--batches",
        type=at_least(int, 2),
        default=150,
        help=f"of {BATCH} lines to decode, to each peer and layout (default: 150)",
    )


def section(chosen: argparse.Namespace) -> str:
    """Measure; the section without its heading."""
    before = load()
    layouts = load_layouts("", "bench")
    measured: Measured = {}
    for number, layout in enumerate(layouts):
        measured[layout.name] = _measure(layout, layouts, chosen.batches)
        done = f"{number + 1} of {len(layouts)} layouts"
        print(f"  decoding: {done}", file=sys.stderr, flush=True)
    return report(measured, before)


def _measure(layout: Layout, layouts: list[Layout], batches: int) -> dict[str, Times]:
    lines = FlightLines(layout)
    peers: dict[str, Peer] = {
        LINK: Link(layouts),
        DECODER: Decoder(layouts),
        BARE: Bare(layouts),
    }
    step = 1.0 / REAL_RATE
    now = 0.0
    # The link leaves out its first line as well.
    for _ in range(LINES_TO_RECOGNISE + 1):
        now += step
        line = lines.next(int(now * 1000.0))
        for peer in peers.values():
            peer.feed(line, now)
    times = {name: Times() for name in peers}
    for _ in range(batches):
        clock = [now + n * step for n in range(1, BATCH + 1)]
        batch = [(at, lines.next(int(at * 1000.0))) for at in clock]
        now = batch[-1][0]
        for name, peer in peers.items():
            decoded = 0
            start = time.perf_counter_ns()
            for at, line in batch:
                decoded += peer.feed(line, at)
            times[name].batches.append((time.perf_counter_ns() - start) / 1e3 / BATCH)
            times[name].missed += BATCH - decoded
            if times[name].missed > _MAY_MISS:
                raise ChuteError(f"{layout.name}: {name} decoded {decoded} of {BATCH} lines")
    return times


def report(measured: Measured, before: str) -> str:
    """The section without its heading. before: the load of the machine when it began."""
    rows = []
    for layout, times in measured.items():
        base = summary(times[BARE].batches)
        for name, one in times.items():
            numbers = summary(one.batches)
            ratios = (f"{number / base[i]:.1f}" for i, number in enumerate(numbers[:2]))
            values = (*(f"{number:.1f} us" for number in numbers), *ratios, str(one.missed))
            rows.append((f"{layout}: {name}", *values))
    head = (
        "microseconds a line",
        "median",
        "99th percentile",
        "largest",
        "ratio of medians",
        "of 99th percentiles",
        "missed",
    )
    count = len(next(iter(measured.values()))[BARE].batches)
    return (
        "### Decoding a line\n\n"
        f"{before}\n\n"
        "The lines of a whole flight of the simulated rocket, as the simulated flight computer\n"
        "prints them, one read of the port each. Decoder: bytes to lines, what a line is, and\n"
        "the record in it, each field checked against its type and range, the layout recognised.\n"
        "Whole link: all that the node's link does with it, with the pictures of flight computer\n"
        "and vehicle. Bare: split at newlines and commas, float each field\n"
        "(`bench/bare_telemetry.py`); the ratios are to it. Missed: lines that were not decoded;\n"
        "until its air brake opens, what telem57_airbrake_deployment sends fits the reference's\n"
        f"layout as well, and it takes {LINES_TO_RECOGNISE} lines to believe in another.\n"
        f"{count} batches of {BATCH} lines to each, taking turns, in one run.\n\n"
        + table(head, rows)
        + "\n"
    )


if __name__ == "__main__":
    run("bench.umbilical_decoding", __doc__ or "", [sys.modules[__name__]])
