"""What it costs a vehicle that somebody looks at it, by `chute watch` or by the panel.

The same three processes as for the kill switch, three times: one set that nobody looks at, one at
which `chute watch` looks, one at which the panel does, with one page open. All at the same time,
taking turns in one run; and what each takes of a core while nothing happens. The same once more
with three vehicles, each of which a person deploys.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from functools import partial

from bench.command import at_least, run, with_children
from bench.kill_switch import IDLE, LOADED, Peer, Start, measure, start_ours
from bench.person import Person
from bench.process_cost import WATCHED_FOR, idle_costs
from bench.report import COMPARED, compared, load
from bench.vehicle import deploy, start
from bench.vehicle_wire import VehicleWire
from chute_ros.links.mavlink.protocol.commands import CommandLimits
from chute_ros.tools.isolation import free_tcp_port, free_udp_ports
from chute_ros.tools.pages import table
from chute_ros.tools.processes import Processes, ros_arguments

HEADING = "Onlookers"

NOBODY, WATCH, PANEL = "nobody", "watch", "panel"
_NODES = ("supervisor", "mavlink", "upf_can")


def add_options(options: argparse.ArgumentParser) -> None:
    """How much is measured."""
    options.add_argument(
        "--onlooker-requests",
        type=at_least(int, 2),
        default=100,
        help="kill switches to each set, idle and under load (default: 100)",
    )
    options.add_argument(
        "--onlooker-deploys",
        type=at_least(int, 2),
        default=100,
        help="deploys by a person of each vehicle (default: 100)",
    )


def section(chosen: argparse.Namespace) -> str:
    """Measure; the section without its heading."""
    before = load()
    count = chosen.onlooker_requests
    peers, cost = with_children(lambda namespace, children: _measure(namespace, children, count))
    count = chosen.onlooker_deploys
    deploys = with_children(lambda namespace, children: _deploys(namespace, children, count))
    return report(peers, deploys, cost, before)


def _measure(
    namespace: str, children: Processes, count: int
) -> tuple[list[Peer], dict[str, tuple[float, float]]]:
    starts: dict[str, Start] = {
        NOBODY: partial(start_ours, mark=f"_{NOBODY}"),
        WATCH: _start_watched,
        PANEL: _start_on_page,
    }
    peers = measure(namespace, children, starts, count)
    return peers, _cost(children)


def _start_watched(namespace: str, processes: Processes, bus: int, network: int) -> None:
    start_ours(namespace, processes, bus, network, mark=f"_{WATCH}")
    _watch(f"{namespace}_{WATCH}", processes)


def _start_on_page(namespace: str, processes: Processes, bus: int, network: int) -> None:
    start_ours(namespace, processes, bus, network, mark=f"_{PANEL}")
    _open_page(f"{namespace}_{PANEL}", processes)


def _watch(vehicle: str, processes: Processes) -> None:
    command = ("chute_ros.tools.chute", "watch", "--namespace", vehicle)
    processes.start(WATCH, "bench.at_terminal", *command)


def _open_page(vehicle: str, processes: Processes) -> None:
    port = free_tcp_port()
    processes.start(PANEL, "chute_ros.tools.panel", *ros_arguments("/", port=port))
    page = f"http://127.0.0.1:{port}/vehicle{vehicle}"
    processes.start("viewer", "bench.page_viewer", page)


def _deploys(namespace: str, children: Processes, count: int) -> dict[str, list[float]]:
    """Of three vehicles in turns, by who looks; ms."""
    vehicles: dict[str, tuple[VehicleWire, Person]] = {}
    with contextlib.ExitStack() as opened:
        for name in (NOBODY, WATCH, PANEL):
            (port,) = free_udp_ports(1)
            wire, person = VehicleWire(port), Person(f"{namespace}_{name}")
            for one in (wire, person):
                one.start()
                opened.callback(one.close)
            start(f"{namespace}_{name}", children, port, f"_{name}")
            vehicles[name] = wire, person
        _watch(f"{namespace}_{WATCH}", children)
        _open_page(f"{namespace}_{PANEL}", children)
        times: dict[str, list[float]] = {name: [] for name in vehicles}
        for _ in range(count):
            begun = time.monotonic()
            for name, (wire, person) in vehicles.items():
                times[name].append(deploy(wire, person, children))
            # Until then a kill's acknowledgement may be that of the last one.
            time.sleep(max(0.0, begun + CommandLimits().late_ack_window - time.monotonic()))
        print("  deploys: done", file=sys.stderr, flush=True)
    return times


def _cost(children: Processes) -> dict[str, tuple[float, float]]:
    """Of each set's processes, and of its onlooker, in % of a core, while nothing happens."""
    sets = {name: [f"{node}_{name}" for node in _NODES] for name in (NOBODY, WATCH, PANEL)}
    onlookers = {f"at {name}": [name] for name in (WATCH, PANEL)}
    costs = idle_costs(children, sets | onlookers)
    return {name: (costs[name], costs.get(f"at {name}", 0.0)) for name in sets}


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
        "The kill switch as above, on three sets of our processes at the same time: nobody looks\n"
        "at one, `chute watch` at a terminal at another, the panel with one open page at the\n"
        'third. Ratios are to the one that nobody looks at. A deploy is that of "A vehicle", of\n'
        "three vehicles looked at in the same way: one that is missed ends the run.\n\n"
        + table(("looked at by", *COMPARED, "missed"), rows)
        + f"\n\nOf a core while nothing happens, for {WATCHED_FOR:g} s:\n\n"
        + table(("looked at by", nodes, onlooker), costs)
        + "\n"
    )


if __name__ == "__main__":
    run("bench.onlookers", __doc__ or "", [sys.modules[__name__]])
