"""What an executor of our own brings: the kill switch on ours, and on rclpy's.

The same three processes on each, at the same time, taking turns in one run; and what each three
take of a core while nothing happens.
"""

from __future__ import annotations

import argparse
import sys
from functools import partial

from bench.command import at_least, run, with_children
from bench.kill_switch import IDLE, LOADED, Peer, Start, measure, start_ours
from bench.on_executor import EXECUTORS
from bench.process_cost import WATCHED_FOR, idle_costs
from bench.report import load
from chute_ros.tools.pages import summary, table
from chute_ros.tools.processes import Processes

HEADING = "Executors"


def add_options(options: argparse.ArgumentParser) -> None:
    """How much is measured."""
    options.add_argument(
        "--executor-requests",
        type=at_least(int, 2),
        default=100,
        help="kill switches on each executor, idle and under load (default: 100)",
    )


def section(chosen: argparse.Namespace) -> str:
    """Measure; the section without its heading."""
    before = load()
    count = chosen.executor_requests
    peers, cost = with_children(lambda namespace, children: _measure(namespace, children, count))
    return report(peers, cost, before)


def _measure(
    namespace: str, children: Processes, count: int
) -> tuple[list[Peer], dict[str, float]]:
    starts: dict[str, Start] = {
        name: partial(start_ours, starter=("bench.on_executor", name), mark=f"_{name}")
        for name in EXECUTORS
    }
    peers = measure(namespace, children, starts, count)
    groups = {
        name: [one for one in children.names() if one.endswith(f"_{name}")] for name in starts
    }
    return peers, idle_costs(children, groups)


def report(peers: list[Peer], cost: dict[str, float], before: str) -> str:
    """The section without its heading. cost: % of a core. before: the load when it began."""
    rows = []
    for peer in peers:
        values = []
        for how in (IDLE, LOADED):
            for which in ("kill", "answer"):
                median, high, _ = summary([getattr(one, which) for one in peer.rounds[how]])
                values.append(f"{median:.2f} / {high:.2f} ms")
        missed = str(sum(peer.missed.values()))
        rows.append((peer.name, *values, f"{cost[peer.name]:.1f} %", missed))
    head = (
        *("executor", f"kill, {IDLE}", f"answer, {IDLE}", f"kill, {LOADED}", f"answer, {LOADED}"),
        *("of a core, idle", "missed"),
    )
    return (
        f"{before}\n\n"
        "The kill switch as above, on sets of our processes that differ in their executor alone,\n"
        "taking turns in one run: median / 99th percentile. Of a core: the three processes of a\n"
        f"set together, without a device on their wires, for {WATCHED_FOR:g} s.\n\n"
        + table(head, rows)
        + "\n"
    )


if __name__ == "__main__":
    run("bench.executors", __doc__ or "", [sys.modules[__name__]])
