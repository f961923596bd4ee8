"""From a $TELEM line on a serial port to umbilical/telem: how late, how many, at what cost.

The node umbilical beside a bare script that does the same between the same two ends: reads the
port, splits, floats, publishes. Turns alternate, in one run.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
from contextlib import ExitStack
from dataclasses import dataclass, field

from bench.command import at_least, run, with_children
from bench.flight_lines import REAL_RATE, FlightLines
from bench.report import COMPARED, compared, load
from bench.umbilical_ends import LATE, Ends, Step, Subscriber
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.tools.pages import table
from chute_ros.tools.processes import Processes, ros_arguments

HEADING = "Umbilical telemetry"

OURS, BARE = "chute_ros", "bare script"
_READY_TIMEOUT, _FLOW_TIMEOUT = 40.0, 10.0
#: At the lowest rates each has so many turns.
_TURNS = 6
_BUSY_RATE = 100.0
#: The first rate of the search, lines a second; how near its two ends get; tries of a rate.
_FIRST_RATE, _NEAR, _TRIES = 50.0, 1.1, 3


@dataclass
class Search:
    """For the highest rate that is kept: doubled until one is not, then between the two."""

    top: float
    kept: Step | None = None
    failed: Step | None = None

    def next_rate(self) -> float | None:
        """The next one to try; None: it is found."""
        if self.failed is None:
            rate = 2.0 * self.kept.rate if self.kept else _FIRST_RATE
            return rate if rate <= self.top else None
        if self.kept is None or self.failed.rate <= _NEAR * self.kept.rate:
            return None
        return float(round(math.sqrt(self.kept.rate * self.failed.rate)))

    def tried(self, step: Step) -> None:
        """This came of it."""
        if step.is_kept:
            self.kept = step
        else:
            self.failed = step


@dataclass
class Peer:
    """What is measured."""

    name: str
    ends: Ends
    search: Search
    #: Rate -> the turns at it.
    turns: dict[float, list[Step]] = field(default_factory=lambda: {REAL_RATE: [], _BUSY_RATE: []})


def add_options(options: argparse.ArgumentParser) -> None:
    """How much is measured."""
    options.add_argument(
        "--seconds",
        type=at_least(float, 0.2),
        default=4.0,
        help="each turn of writing telemetry (default: 4)",
    )
    options.add_argument(
        "--top-rate",
        type=at_least(float, _FIRST_RATE),
        default=12_800.0,
        help="lines of telemetry a second that are tried at most (default: 12800)",
    )


def section(chosen: argparse.Namespace) -> str:
    """Measure; the section without its heading."""
    before = load()
    peers = with_children(
        lambda namespace, children: _measure(namespace, children, chosen.seconds, chosen.top_rate)
    )
    return report(peers, chosen.seconds, before)


def start_peers(
    namespace: str, children: Processes, stack: ExitStack, top_rate: float = _FIRST_RATE
) -> list[Peer]:
    """Both peers, publishing."""
    layout = load_layouts("", "bench")[0]
    subscriber = Subscriber()
    stack.callback(subscriber.close)
    peers = []
    for name, below in ((OURS, ""), (BARE, "/bare")):
        came = subscriber.follow(f"{namespace}{below}/umbilical/telem")
        ends = Ends(name, FlightLines(layout), came)
        ends.wire.open()
        stack.callback(ends.wire.close)
        peers.append(Peer(name, ends, Search(top_rate)))
    ours, bare = peers
    node = ros_arguments(namespace, connection=f"serial:{ours.ends.wire.path}")
    children.start("umbilical", "chute_ros.links.umbilical", *node)
    node = ros_arguments(f"{namespace}/bare")
    children.start("bare", "bench.bare_telemetry", bare.ends.wire.path, *node)
    ours.ends.pid, bare.ends.pid = children.pid("umbilical"), children.pid("bare")
    subscriber.start()
    for peer in peers:
        peer.ends.flow(_READY_TIMEOUT)
    return peers


def _measure(namespace: str, children: Processes, seconds: float, top_rate: float) -> list[Peer]:
    with ExitStack() as stack:
        peers = start_peers(namespace, children, stack, top_rate)

        for number in range(_TURNS):
            for rate in (REAL_RATE, _BUSY_RATE):
                for peer in peers:
                    peer.turns[rate].append(_turn(peer, rate, children, seconds))
            _say(f"{number + 1} of {_TURNS} turns")
        while any(peer.search.next_rate() for peer in peers):
            for peer in peers:
                next_rate = peer.search.next_rate()
                if next_rate is not None:
                    peer.search.tried(_try(peer, next_rate, children, seconds))
    return peers


def _turn(peer: Peer, rate: float, children: Processes, seconds: float) -> Step:
    children.check()
    peer.ends.flow(_FLOW_TIMEOUT)
    return peer.ends.step(rate, seconds)


def _try(peer: Peer, rate: float, children: Processes, seconds: float) -> Step:
    """One turn at this rate, and if lines are lost another: it may be this machine's fault."""
    for _ in range(_TRIES):
        step = _turn(peer, rate, children, seconds)
        _say(f"{peer.name} at {rate:g} lines/s: {step.lost} of {step.written} lost")
        if step.is_kept:
            break
    return step


def _say(text: str) -> None:
    print(f"  telemetry: {text}", file=sys.stderr, flush=True)


def report(peers: list[Peer], seconds: float, before: str) -> str:
    """The section without its heading. before: the load of the machine when it began."""
    at_real = sum(step.written for step in peers[0].turns[REAL_RATE])
    return (
        "### Through the node\n\n"
        f"{before}\n\n"
        "Lines as above (layout telem57_airbrake_state) are written to a pty; a subscriber of\n"
        "umbilical/telem (RELIABLE, depth 10) notes when each comes, told apart by the device's\n"
        "own clock. chute_ros: the node umbilical as a vehicle runs it, with heartbeats,\n"
        "diagnostics and services. Bare script: one process that reads the port, splits, floats\n"
        "and publishes the same message, and checks nothing (`bench/bare_telemetry.py`); the\n"
        f"ratios are to it. {_TURNS} turns of {seconds:g} s at each of {REAL_RATE:g} lines/s,\n"
        f"the flight computer's rate, and {_BUSY_RATE:g} lines/s, "
        "taking turns, in one\n"
        f"run; at {REAL_RATE:g} lines/s {at_real} lines to each.\n\n"
        f"{_latency(peers)}\n\n"
        f"{_cpu(peers)}\n\n"
        f"Highest rate without loss: held for {seconds:g} s, and every line came within\n"
        f"{LATE:g} s of being written. Rates are doubled until lines are lost in each of\n"
        f"{_TRIES} tries; then it is searched between the last two, to a tenth. Where the\n"
        "process is far from taking a whole core, the lines are lost on the subscriber's side:\n"
        "its depth is 10, and it is in Python, in one process with the writer.\n\n"
        f"{_sustained(peers)}\n"
    )


def _latency(peers: list[Peer]) -> str:
    delays = {
        peer.name: [delay for step in peer.turns[REAL_RATE] for delay in step.delays]
        for peer in peers
    }
    rows = []
    for peer in peers:
        cells = compared(delays[peer.name], delays[BARE], "{:.2f} ms")
        lost = str(sum(step.lost for step in peer.turns[REAL_RATE]))
        rows.append((f"at {REAL_RATE:g} lines/s: {peer.name}", *cells, lost))
    return table(("from writing a line to the subscriber", *COMPARED, "lost"), rows)


def _cpu(peers: list[Peer]) -> str:
    rows = []
    for rate in (REAL_RATE, _BUSY_RATE):
        shares = {peer.name: statistics.fmean(s.cpu for s in peer.turns[rate]) for peer in peers}
        for name, share in shares.items():
            ratio = f"{share / shares[BARE]:.1f}" if shares[BARE] else "-"
            rows.append((f"at {rate:g} lines/s: {name}", f"{100.0 * share:.1f} %", ratio))
    return table(("of one core", "share", "ratio"), rows)


def _sustained(peers: list[Peer]) -> str:
    kept = {peer.name: peer.search.kept for peer in peers}
    base = kept[BARE]
    rows = []
    for peer in peers:
        best, failed = kept[peer.name], peer.search.failed
        ratio = f"{best.rate / base.rate:.2f}" if best and base else "-"
        above = f"{failed.lost} of {failed.written} at {failed.rate:g}/s" if failed else "-"
        if failed and not failed.kept_pace:
            above += " (the writer did not reach it)"
        rate = f"{best.rate:g} lines/s" if best else "-"
        share = f"{100.0 * best.cpu:.1f} %" if best else "-"
        rows.append((f"without loss: {peer.name}", rate, ratio, share, above))
    return table(("highest rate", "rate", "ratio", "of one core", "lost above it"), rows)


if __name__ == "__main__":
    run("bench.umbilical_telemetry", __doc__ or "", [sys.modules[__name__]])
