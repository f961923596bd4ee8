"""From a UPF's kill switch on the bus to the kill on MAVLink, and to the answer on the bus.

Our three processes (upf_can, safety_supervisor, mavlink_parachute) beside a bare relay that does
the same between the same two sockets without ROS, and beside that relay cut into three with our
topics between. Rounds take turns, in one run.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

from bench.command import at_least, run, with_children
from bench.report import COMPARED, compared, load
from bench.wire_ends import NOMINAL_RATE, Round, RoundFailedError, WireEnds, WrongOrderError
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.tools.pages import table
from chute_ros.tools.processes import Processes, ros_arguments
from chute_ros.transport.data_types import load_data_types

HEADING = "Kill switch"

OURS, ROS, BARE = "chute_ros", "ROS alone", "bare relay"
#: Each peer rests so long between its rounds at least, s: for the supervisor the kill of the last
#: one is over after its kill_timeout, and the vehicle is known to be armed again.
REST, _KILL_TIMEOUT = 0.4, 0.3
#: A late answer is a late answer: it is measured, not given up.
_SERVICE_TIMEOUT, _ROUND_TIMEOUT = 2.0, 3.0
_READY_TIMEOUT = 40.0
#: So many times what both ends say by themselves, from a moment before a round until its end, s.
_LOAD, _LOAD_BEFORE = 10.0, 0.2
IDLE, LOADED = "idle", f"under {_LOAD:g} times the frames"
#: One round of so many may go without an answer; it is counted in the table.
_ONE_OF = 50


@dataclass
class Peer:
    """What is measured. Times are in rounds; a round without an answer is only counted."""

    name: str
    ends: WireEnds
    #: How -> its rounds, and how many without an answer.
    rounds: dict[str, list[Round]] = field(default_factory=lambda: {IDLE: [], LOADED: []})
    missed: Counter[str] = field(default_factory=Counter)


def add_options(options: argparse.ArgumentParser) -> None:
    """How much is measured."""
    options.add_argument(
        "--requests",
        type=at_least(int, 2),
        default=200,
        help="kill switches, to each peer, idle and under load (default: 200)",
    )


def section(chosen: argparse.Namespace) -> str:
    """Measure; the section without its heading."""
    before = load()
    peers = with_children(
        lambda namespace, children: _measure(namespace, children, chosen.requests)
    )
    return report(peers, before)


#: Starts a peer's processes: (namespace, processes, port of the bus, port of the network).
Start = Callable[[str, Processes, int, int], None]


def _measure(namespace: str, processes: Processes, count: int) -> list[Peer]:
    starts: dict[str, Start] = {OURS: start_ours, ROS: _start_ros, BARE: _start_bare}
    return measure(namespace, processes, starts, count)


def measure(
    namespace: str, processes: Processes, starts: dict[str, Start], count: int
) -> list[Peer]:
    """Start each peer, and have them take turns for so many rounds."""
    with started(namespace, processes, starts) as peers:
        for number in range(count):
            for how in (IDLE, LOADED):
                for peer in peers:
                    rest(peers, REST / len(peers))
                    round_of(peer, peers, how, count)
            processes.check()
            if (number + 1) % 25 == 0 or number + 1 == count:
                print(f"  {number + 1} of {count} rounds", file=sys.stderr, flush=True)
        # A kill that was sent twice may come late.
        rest(peers, REST)
        return peers


@contextmanager
def started(
    namespace: str, processes: Processes, starts: dict[str, Start]
) -> Iterator[list[Peer]]:
    """Peers that have had a first round each."""
    definitions = Definitions(load_data_types("", "bench"))
    ports = iter(free_udp_ports(2 * len(starts)))
    peers: list[Peer] = []
    with ExitStack() as stack:
        for name, start in starts.items():
            bus, network = next(ports), next(ports)
            start(namespace, processes, bus, network)
            ends = WireEnds(definitions, bus, network)
            stack.callback(ends.close)
            peers.append(Peer(name, ends))
        for peer in peers:
            await_ready(peer, peers, processes)
        # What was asked for before all was there may still come.
        rest(peers, _SERVICE_TIMEOUT)
        for peer in peers:
            peer.ends.kills = 0
        yield peers


def rest(peers: list[Peer], seconds: float) -> None:
    """All go on saying how they are: none may seem lost while another has its turn."""
    for peer in peers:
        peer.ends.arm()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for peer in peers:
            peer.ends.listen(0.005)


def round_of(peer: Peer, peers: list[Peer], how: str, count: int) -> None:
    """One of so many, idle or under load; one that is missed is counted."""
    if how == LOADED:
        peer.ends.flood.set(_LOAD * NOMINAL_RATE)
        rest(peers, _LOAD_BEFORE)
    try:
        peer.rounds[how].append(peer.ends.kill_switch(_ROUND_TIMEOUT))
    except WrongOrderError as error:
        raise RoundFailedError(f"{peer.name}: {error}") from None
    except RoundFailedError as error:
        peer.missed[how] += 1
        missed = peer.missed[how]
        if missed > count // _ONE_OF:
            raise RoundFailedError(f"{peer.name}: {missed} missed, now: {error}") from None
    finally:
        if how == LOADED:
            peer.ends.flood.set(0.0)


def start_ours(
    namespace: str,
    processes: Processes,
    bus: int,
    network: int,
    starter: tuple[str, ...] = (),
    mark: str = "",
) -> None:
    """starter: a module and its arguments, which starts each node; mark: behind their names."""

    def start(name: str, module: str, **parameters: str) -> None:
        arguments = ros_arguments(namespace + mark, **parameters)
        processes.start(name + mark, *starter, module, *arguments)

    start(
        "supervisor",
        "chute_ros.ros.safety_supervisor",
        required_links="[mavlink_parachute, upf_can]",
        deploy_links="[upf_can]",
        kill_timeout=str(_KILL_TIMEOUT),
    )
    start(
        "mavlink",
        "chute_ros.links.mavlink",
        connection=f"udpin:127.0.0.1:{network}",
        expect_parachute="false",
    )
    start(
        "upf_can",
        "chute_ros.links.upf",
        connection=f"mcast:0:{bus}",
        allocator="false",
        vehicle_service_timeout=str(_SERVICE_TIMEOUT),
    )


def _start_ros(namespace: str, processes: Processes, bus: int, network: int) -> None:
    node = ros_arguments(f"{namespace}/relay")
    for role, *port in (("bus", str(bus)), ("decide",), ("network", str(network))):
        processes.start(f"relay_{role}", "bench.ros_relay", role, *port, *node)


def _start_bare(_: str, processes: Processes, bus: int, network: int) -> None:
    processes.start("relay", "bench.bare_relay", str(bus), str(network))


def await_ready(peer: Peer, peers: list[Peer], processes: Processes) -> None:
    """Until a first round succeeds: all is started, and everybody has heard everybody."""
    end = time.monotonic() + _READY_TIMEOUT
    while True:
        processes.check()
        rest(peers, REST)
        try:
            peer.ends.kill_switch(1.0)
            return
        except RoundFailedError as error:
            if time.monotonic() > end:
                raise RoundFailedError(f"{peer.name} was not ready: {error}") from None


def report(peers: list[Peer], before: str) -> str:
    """The section without its heading. before: the load of the machine when it began."""
    rows = []
    for how in (IDLE, LOADED):
        for what, which in (("the kill on MAVLink", "kill"), ("the answer on the bus", "answer")):
            times = {p.name: [getattr(r, which) for r in p.rounds[how]] for p in peers}
            for peer in peers:
                cells = compared(times[peer.name], times[BARE], "{:.2f} ms")
                missed = str(peer.missed[how])
                rows.append((f"to {what}, {how}: {peer.name}", *cells, missed))
    head = ("from the kill switch on the bus", *COMPARED, "missed")
    count = len(peers[0].rounds[IDLE]) + peers[0].missed[IDLE]
    kills = ", ".join(f"{peer.name} {peer.ends.kills}" for peer in peers)
    return (
        f"{before}\n\n"
        "A UPF controller requests TYPE_KILLSWITCH on the CAN bus (UDP multicast); the kill\n"
        "(a forced disarm) arrives at the autopilot, which acknowledges it and\n"
        "whose heartbeat then reports motors off; SUCCESS arrives at the controller. chute_ros:\n"
        "the processes upf_can, safety_supervisor and mavlink_parachute, with two hops over ROS\n"
        "to the kill and one back. ROS alone: three processes with the same hops and messages,\n"
        "that decide and check nothing (`bench/ros_relay.py`). Bare relay: one process with two\n"
        "sockets, that checks nothing (`bench/bare_relay.py`); the ratios are to it.\n"
        f"{count} requests to each, idle and as often under load, taking turns, in one run.\n"
        f"Under load, besides, {_LOAD * NOMINAL_RATE:.0f} valid frames/s on MAVLink and as many "
        "on the bus, to the peer\nwhose turn it is. Missed: no SUCCESS within\n"
        f"{_SERVICE_TIMEOUT:g} s. Kills that came: {kills}.\n\n" + table(head, rows) + "\n"
    )


if __name__ == "__main__":
    run("bench.kill_switch", __doc__ or "", [sys.modules[__name__]])
