"""What it costs a vehicle that somebody looks at it, by `chute watch` or by the panel.

The three processes of the kill switch, once; and those of a vehicle that a person deploys, once.
In turns nobody looks, `chute watch` does, and the panel with one page open: whoever has no turn is
not there, so that on a machine of two cores nothing but the onlooker differs.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from bench.at_terminal import LOOKS
from bench.command import at_least, run, with_children
from bench.kill_switch import (
    IDLE,
    LOADED,
    OURS,
    REST,
    Peer,
    await_ready,
    rest,
    round_of,
    start_ours,
    started,
)
from bench.person import Person
from bench.process_cost import cpu_time_of
from bench.report import COMPARED, compared, load
from bench.vehicle import NotMeasuredError, deploy, start
from bench.vehicle_wire import VehicleWire
from chute_ros.links.mavlink.protocol.commands import CommandLimits
from chute_ros.tools.isolation import free_tcp_port, free_udp_ports
from chute_ros.tools.pages import table
from chute_ros.tools.processes import Processes, ros_arguments

HEADING = "Onlookers"

NOBODY, WATCH, PANEL = "nobody", "watch", "panel"
_WHO = (NOBODY, WATCH, PANEL)
#: Each has so many.
_TURNS = 4
#: In each it is watched for so long what it costs, s.
_WATCHED_FOR = 5.0
#: An onlooker sees a vehicle within this, s.
_SEES_WITHIN = 30.0
_NODES = ("supervisor", "mavlink", "upf_can")


def add_options(options: argparse.ArgumentParser) -> None:
    """How much is measured."""
    options.add_argument(
        "--onlooker-requests",
        type=at_least(int, _TURNS),
        default=200,
        help=f"kill switches in the {_TURNS} turns of each, idle and under load (default: 200)",
    )
    options.add_argument(
        "--onlooker-deploys",
        type=at_least(int, _TURNS),
        default=40,
        help=f"deploys by a person in the {_TURNS} turns of each (default: 40)",
    )


def section(chosen: argparse.Namespace) -> str:
    """Measure; the section without its heading."""
    before = load()
    count = chosen.onlooker_requests // _TURNS
    peers, cost = with_children(lambda namespace, children: _kills(namespace, children, count))
    count = chosen.onlooker_deploys // _TURNS
    deploys = with_children(lambda namespace, children: _deploys(namespace, children, count))
    return report(peers, deploys, cost, before)


def _kills(
    namespace: str, children: Processes, count: int
) -> tuple[list[Peer], dict[str, tuple[float, float]]]:
    """By who looks: rounds, and what the nodes and the onlooker took, in % of a core."""
    with started(namespace, children, {OURS: start_ours}) as ours:
        peers = [Peer(name, ours[0].ends) for name in _WHO]
        taken = dict.fromkeys(_WHO, (0.0, 0.0))
        for turn in range(_TURNS):
            for peer in peers:
                with _looked_at(peer.name, namespace, partial(rest, ours, 0.1)) as onlookers:
                    await_ready(ours[0], ours, children)
                    for _ in range(count):
                        for how in (IDLE, LOADED):
                            rest(ours, REST)
                            round_of(peer, ours, how, count * _TURNS)
                    children.check()
                    rest(ours, REST)
                    who = onlookers.names()
                    mine, its = cpu_time_of(children, _NODES), cpu_time_of(onlookers, who)
                    rest(ours, _WATCHED_FOR)
                    mine = cpu_time_of(children, _NODES) - mine
                    its = cpu_time_of(onlookers, who) - its
                sum_mine, sum_its = taken[peer.name]
                taken[peer.name] = sum_mine + mine, sum_its + its
            print(f"  kills: {turn + 1} of {_TURNS} turns", file=sys.stderr, flush=True)
    whole = _TURNS * _WATCHED_FOR / 100.0
    return peers, {name: (mine / whole, its / whole) for name, (mine, its) in taken.items()}


def _deploys(namespace: str, children: Processes, count: int) -> dict[str, list[float]]:
    """By who looks; ms."""
    times: dict[str, list[float]] = {name: [] for name in _WHO}
    (port,) = free_udp_ports(1)
    with contextlib.ExitStack() as opened:
        wire, person = VehicleWire(port), Person(namespace)
        for one in (wire, person):
            one.start()
            opened.callback(one.close)
        start(namespace, children, port)
        for turn in range(_TURNS):
            for name in _WHO:
                with _looked_at(name, namespace, partial(time.sleep, 0.1)):
                    for _ in range(count):
                        begun = time.monotonic()
                        times[name].append(deploy(wire, person, children))
                        # Until then a kill's acknowledgement may be that of the last one.
                        over = begun + CommandLimits().late_ack_window
                        time.sleep(max(0.0, over - time.monotonic()))
            print(f"  deploys: {turn + 1} of {_TURNS} turns", file=sys.stderr, flush=True)
    return times


@contextlib.contextmanager
def _looked_at(who: str, vehicle: str, meanwhile: Callable[[], None]) -> Iterator[Processes]:
    """The onlooker's processes. meanwhile: done again and again until it sees the vehicle."""
    with tempfile.TemporaryDirectory() as folder:
        onlookers = Processes(Path(folder))
        try:
            if who == WATCH:
                command = ("chute_ros.tools.chute", "watch", "--namespace", vehicle)
                onlookers.start(WATCH, "bench.at_terminal", "rules:", *command)
                _await(WATCH, onlookers, meanwhile)
            elif who == PANEL:
                port = free_tcp_port()
                onlookers.start(PANEL, "chute_ros.tools.panel", *ros_arguments("/", port=port))
                page = f"http://127.0.0.1:{port}/vehicle{vehicle}"
                onlookers.start("viewer", "bench.page_viewer", page)
                _await("viewer", onlookers, meanwhile)
            yield onlookers
        finally:
            onlookers.end()


def _await(name: str, onlookers: Processes, meanwhile: Callable[[], None]) -> None:
    end = time.monotonic() + _SEES_WITHIN
    while LOOKS not in onlookers.log(name).read_text(errors="replace"):
        onlookers.check()
        if time.monotonic() > end:
            raise NotMeasuredError(f"{name} sees no vehicle within {_SEES_WITHIN:g} s")
        meanwhile()


def report(
    peers: list[Peer],
    deploys: dict[str, list[float]],
    cost: dict[str, tuple[float, float]],
    before: str,
) -> str:
    """The section without its heading. cost: % of a core. before: the load when it began."""
    rows = []
    for how in (IDLE, LOADED):
        for which in ("kill", "answer"):
            times = {p.name: [getattr(r, which) for r in p.rounds[how]] for p in peers}
            for peer in peers:
                cells = compared(times[peer.name], times[NOBODY], "{:.2f} ms")
                rows.append((f"{which}, {how}: {peer.name}", *cells, str(peer.missed[how])))
    for name, took in deploys.items():
        cells = compared(took, deploys[NOBODY], "{:.2f} ms")
        rows.append((f"deploy, idle: {name}", *cells, ""))
    nodes, onlooker = "the three nodes", "who looks"
    costs = [(name, f"{mine:.1f} %", f"{its:.1f} %") for name, (mine, its) in cost.items()]
    return (
        f"{before}\n\n"
        "The kill switch, of one set of our processes, in turns: nobody looks, `chute watch` at\n"
        f"a terminal does, the panel with one open page does; {_TURNS} turns each. Ratios are to\n"
        'those that nobody looks at. A deploy is that of "A vehicle", of one vehicle in the same\n'
        "turns: one that is missed ends the run.\n\n"
        + table(("looked at by", *COMPARED, "missed"), rows)
        + "\n\nOf a core while nothing is asked for, "
        f"{_TURNS} times for {_WATCHED_FOR:g} s:\n\n"
        + table(("looked at by", nodes, onlooker), costs)
        + "\n"
    )


if __name__ == "__main__":
    run("bench.onlookers", __doc__ or "", [sys.modules[__name__]])
