"""From the bytes of a $TELEM line to its values: what a line costs, of every layout.

Our decoder, and the whole link that it is a part of, beside a bare script that splits and floats.
Batches take turns, in one run.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any

from bench.bare_telemetry import Splitter
from bench.command import at_least, run
from bench.decoding import Batch, Peer, Times, take_turns, times_table
from bench.flight_lines import REAL_RATE, FlightLines
from bench.report import load
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol import line_parser
from chute_ros.links.umbilical.protocol.config import UmbilicalConfig
from chute_ros.links.umbilical.protocol.decoder import LINES_TO_RECOGNISE, TelemetryDecoder
from chute_ros.links.umbilical.protocol.events import TelemetryReceived
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.links.umbilical.protocol.stream import Line, StreamReader

HEADING = "Umbilical telemetry"

LINK, DECODER, BARE = "chute_ros, whole link", "chute_ros, decoder", "bare split and float"
#: Lines of a batch.
BATCH = 100

#: More lines than these are not lost where two layouts have one count: those that the other one
#: needs to be recognised, without the line that does it. And the first of each flight that begins
#: anew: a restart that text without a checksum tells is believed with the second.
_MAY_MISS = LINES_TO_RECOGNISE - 1


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
                said, _ = line_parser.recognise(item.data)
                if isinstance(said, line_parser.Telemetry):
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
    measured: dict[str, dict[str, Times]] = {}
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
        line = lines.next(int(now * 1000.0))[0]
        for peer in peers.values():
            peer.feed(line, now)

    def coming() -> Iterator[tuple[Batch, int]]:
        start = now
        for _ in range(batches):
            clock = [start + n * step for n in range(1, BATCH + 1)]
            yield [(at, lines.next(int(at * 1000.0))[0]) for at in clock], BATCH
            start = clock[-1]

    anew = batches * BATCH // len(lines) + 1
    return take_turns(layout.name, peers, coming(), _MAY_MISS + anew)


def report(measured: dict[str, dict[str, Times]], before: str) -> str:
    """The section without its heading. before: the load of the machine when it began."""
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
        f"layout as well, and it takes {LINES_TO_RECOGNISE} lines to believe in another. "
        "The link waits\n"
        "with the first line of a new flight for the next one: a restart that text\n"
        "without a checksum reports must be reported twice.\n"
        f"{count} batches of {BATCH} lines to each, taking turns, in one run.\n\n"
        + times_table("microseconds a line", measured, BARE)
        + "\n"
    )


if __name__ == "__main__":
    run("bench.umbilical_decoding", __doc__ or "", [sys.modules[__name__]])
