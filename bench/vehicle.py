"""A whole vehicle: from a limit or a person's call to the wire, what it costs, how it starts.

The processes mavlink_parachute and safety_supervisor; the measuring process is the vehicle's wire
and a person.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from bench.command import at_least, run, with_children
from bench.person import Person
from bench.process_cost import cpu_time, resident_memory
from bench.report import load
from bench.vehicle_wire import NOMINAL_RATE, VehicleWire
from chute_ros.errors import ChuteError
from chute_ros.links.mavlink.protocol.commands import CommandLimits
from chute_ros.links.registered import module_of
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.tools.pages import summary, table
from chute_ros.tools.processes import Processes, ros_arguments

HEADING = "A vehicle"

NODES = ("mavlink_parachute", "safety_supervisor")
#: Of the link that the person's side plays, s.
_STALE_AFTER, _LOST_AFTER = 0.3, 0.5
_WAIT = 20.0
#: So many times what the devices say by themselves.
_LOAD = 10.0
IDLE, LOADED = "idle", f"under {_LOAD:g} times the frames"


class NotMeasuredError(ChuteError):
    """Something did not happen in time. The text says what."""


@dataclass
class Result:
    """Times in ms."""

    started: float = 0.0
    deploys: dict[str, list[float]] = field(default_factory=dict)
    limits: dict[str, list[float]] = field(default_factory=dict)
    #: Node -> share of one core, MB.
    cost: dict[str, tuple[float, float]] = field(default_factory=dict)
    said: float = 0.0


def add_options(options: argparse.ArgumentParser) -> None:
    """How much is measured."""
    options.add_argument(
        "--rounds",
        type=at_least(int, 2),
        default=300,
        help="limits that pass, idle and under load (default: 300)",
    )
    options.add_argument(
        "--deploys",
        type=at_least(int, 2),
        default=30,
        help="deploys by a person, idle and under load (default: 30)",
    )
    options.add_argument(
        "--cost-seconds",
        type=at_least(float, 1.0),
        default=20.0,
        help="for how long what it costs is looked at (default: 20)",
    )


def section(chosen: argparse.Namespace) -> str:
    """Measure; the section without its heading."""
    before = load()
    result = with_children(lambda namespace, children: _measure(namespace, children, chosen))
    return report(result, chosen, before)


def _measure(namespace: str, children: Processes, chosen: argparse.Namespace) -> Result:
    (port,) = free_udp_ports(1)
    wire, person, result = VehicleWire(port), Person(namespace), Result()
    wire.start()
    person.start()
    try:
        begun = time.monotonic()
        start(namespace, children, port)
        _until("READY", lambda: person.stage == person.READY, children)
        result.started = (time.monotonic() - begun) * 1e3
        result.cost, result.said = _cost(children, wire, chosen.cost_seconds)
        for how, times in ((IDLE, 0.0), (LOADED, _LOAD)):
            wire.flood(times)
            result.limits[how] = [_limit(wire, person, children) for _ in range(chosen.rounds)]
            print(f"  limits, {how}: done", file=sys.stderr, flush=True)
            result.deploys[how] = _deploys(wire, person, children, chosen.deploys)
            print(f"  deploys, {how}: done", file=sys.stderr, flush=True)
    finally:
        wire.close()
        person.close()
    return result


def start(namespace: str, children: Processes, port: int) -> None:
    """Both nodes."""
    limits = f"person stale_after={_STALE_AFTER} lost_after={_LOST_AFTER} regain_after=0.0"
    given = {
        "mavlink_parachute": {"connection": f"udpin:127.0.0.1:{port}"},
        "safety_supervisor": {
            "required_links": "[mavlink_parachute, person]",
            "link_limits": f"['{limits}']",
        },
    }
    for name in NODES:
        arguments = ros_arguments(namespace, **given[name])
        children.start(name, module_of(name), *arguments)


def _until(what: str, holds: Callable[[], bool], children: Processes) -> None:
    end = time.monotonic() + _WAIT
    while not holds():
        children.check()
        if time.monotonic() > end:
            raise NotMeasuredError(f"not {what} within {_WAIT:g} s")
        time.sleep(0.002)


def _limit(wire: VehicleWire, person: Person, children: Processes) -> float:
    """A link falls silent; from its limit on until the vehicle is told that flight is blocked."""
    _until("READY", lambda: person.stage == person.READY, children)
    wire.blocks.clear()
    silent_since = person.fall_silent()
    _until("blocked", lambda: bool(wire.blocks), children)
    _until("BLOCKED", lambda: person.stage == person.BLOCKED, children)
    person.speak()
    return (wire.blocks[0] - silent_since) / 1e6 - _STALE_AFTER * 1e3


def _deploys(wire: VehicleWire, person: Person, children: Processes, count: int) -> list[float]:
    """Each once no acknowledgement of the last one's kill can come any more: until then the link
    cannot tell whose it is, and asks again."""
    times, alone_at = [], 0.0
    for _ in range(count):
        _until("alone", partial(_is_past, alone_at), children)
        times.append(deploy(wire, person, children))
        alone_at = time.monotonic() + CommandLimits().late_ack_window
    return times


def _is_past(at: float) -> bool:
    return time.monotonic() > at


def deploy(wire: VehicleWire, person: Person, children: Processes) -> float:
    """A person calls safety/deploy; ms until the release is on the wire, the kill before it."""
    _until("READY", lambda: person.stage == person.READY, children)
    wire.releases.clear()
    called = person.deploy()
    _until("released", lambda: bool(wire.releases), children)
    _until("DEPLOYED", lambda: person.stage == person.DEPLOYED, children)
    _until("out", lambda: person.out, children)
    wire.pack()
    _until("packed", lambda: not person.out, children)
    person.reset()
    return (wire.releases[0] - called) / 1e6


def _cost(
    children: Processes, wire: VehicleWire, seconds: float
) -> tuple[dict[str, tuple[float, float]], float]:
    """Share of one core and MB of each node while nothing happens; frames a second to them."""
    before = {name: cpu_time(children.pid(name)) for name in NODES}
    said, begun = wire.said, time.monotonic()
    time.sleep(seconds)
    took = time.monotonic() - begun
    shares = {name: (cpu_time(children.pid(name)) - before[name]) / took for name in NODES}
    memory = {name: resident_memory(children.pid(name)) for name in NODES}
    return {name: (shares[name], memory[name]) for name in NODES}, (wire.said - said) / took


def report(result: Result, chosen: argparse.Namespace, before: str) -> str:
    """The section without its heading. before: the load of the machine when it began."""
    ways = {
        "a link's limit passed, until flight is blocked on the wire": result.limits,
        "safety/deploy called, until the release is on the wire": result.deploys,
    }
    rows = [
        (f"{what}: {how}", *(f"{number:.2f} ms" for number in summary(times)))
        for what, measured in ways.items()
        for how, times in measured.items()
    ]
    cost = [
        (name, f"{100.0 * share:.1f} %", f"{memory:.0f} MB")
        for name, (share, memory) in result.cost.items()
    ]
    share = sum(share for share, _ in result.cost.values())
    memory = sum(memory for _, memory in result.cost.values())
    cost.append(("together", f"{100.0 * share:.1f} %", f"{memory:.0f} MB"))
    return (
        f"{before}\n\n"
        "The processes mavlink_parachute and safety_supervisor with their black box; the\n"
        f"measuring process is the vehicle's wire ({result.said:.0f} frames/s) and a person. The\n"
        "limit is that of a required link that falls silent (stale_after "
        f"{_STALE_AFTER:g} s, after its last\n"
        "heartbeat was published). The deploy is forced, on the ground: the kill, its\n"
        "confirmation by the autopilot, and then the release. Under load, besides,\n"
        f"{_LOAD * NOMINAL_RATE:.0f} valid frames/s. {chosen.rounds} limits and "
        f"{chosen.deploys} deploys of each, a deploy each\n"
        f"{CommandLimits().late_ack_window:g} s: for so long the acknowledgement of the last "
        "kill could come.\n"
        f"From the start of both processes to READY: {result.started / 1e3:.1f} s.\n\n"
        + table(("from ... until", "median", "99th percentile", "largest"), rows)
        + f"\n\nWhile nothing happens, for {chosen.cost_seconds:g} s:\n\n"
        + table(("node", "of one core", "memory"), cost)
        + "\n\nHow it grows with the number of vehicles is in [hosts.md](hosts.md).\n"
    )


if __name__ == "__main__":
    run("bench.vehicle", __doc__ or "", [sys.modules[__name__]])
