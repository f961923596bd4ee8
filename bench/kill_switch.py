"""From a UPF's kill switch on the bus to the kill on MAVLink, and to the answer on the bus.

Our three processes (upf_can, safety_supervisor, mavlink_parachute) beside a bare relay that does
the same between the same two sockets without ROS; rounds take turns, in one run. Writes
docs/bench.md.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from bench.report import machine, summary, table
from bench.wire_ends import Round, RoundFailedError, WireEnds
from chute_ros.errors import ChuteError
from chute_ros.protocol.upf.definitions import Definitions
from chute_ros.tools.isolation import free_udp_ports, isolated_ros
from chute_ros.tools.processes import Processes
from chute_ros.transport.data_types import load_data_types

OURS, BARE = "chute_ros", "bare relay"
#: Between two rounds, s: the kill of the last one must be over for the supervisor, and the vehicle
#: known to be armed again.
_REST = 0.25
_KILL_TIMEOUT = 0.15
_ROUND_TIMEOUT = 2.0
_READY_TIMEOUT = 30.0


def main() -> None:
    """Measure, print, write."""
    options = argparse.ArgumentParser("bench.kill_switch", description=__doc__)
    options.add_argument("--rounds", type=int, default=300, help="of each peer (default: 300)")
    options.add_argument("--output", type=Path, default=Path("docs/bench.md"))
    chosen = options.parse_args()
    if chosen.rounds < 2:
        options.error("--rounds: need 2 or more")
    with tempfile.TemporaryDirectory(prefix="chute_ros_bench_") as folder:
        processes = Processes(Path(folder))
        try:
            with isolated_ros() as namespace:
                rounds = _measure(namespace, processes, chosen.rounds)
        except (ChuteError, RoundFailedError) as error:
            logs = "\n".join(processes.tail(name) for name in processes.names())
            sys.exit(f"bench failed: {error}\n{logs}")
        finally:
            processes.end()
    text = report(rounds)
    chosen.output.write_text(text)
    print(text)


def _measure(namespace: str, processes: Processes, count: int) -> dict[str, list[Round]]:
    definitions = Definitions(load_data_types("", "bench"))
    bus, network, bare_bus, bare_network = free_udp_ports(4)
    _start_ours(namespace, processes, bus, network)
    processes.start("relay", "bench.bare_relay", str(bare_bus), str(bare_network))
    ends = {
        OURS: WireEnds(definitions, bus, network),
        BARE: WireEnds(definitions, bare_bus, bare_network),
    }
    try:
        for name, pair in ends.items():
            _await_ready(name, pair, processes)
        rounds: dict[str, list[Round]] = {name: [] for name in ends}
        for number in range(count):
            for name, pair in ends.items():
                for other in ends.values():
                    other.rest(_REST / len(ends))
                rounds[name].append(pair.kill_switch(_ROUND_TIMEOUT))
            processes.check()
            if (number + 1) % 25 == 0 or number + 1 == count:
                print(f"  {number + 1} of {count} rounds", file=sys.stderr, flush=True)
        return rounds
    finally:
        for pair in ends.values():
            pair.close()


def _start_ours(namespace: str, processes: Processes, bus: int, network: int) -> None:
    node = ("--ros-args", "-r", f"__ns:={namespace}")

    def start(name: str, module: str, **parameters: str) -> None:
        given = [part for key, value in parameters.items() for part in ("-p", f"{key}:={value}")]
        processes.start(name, module, *node, *given)

    start(
        "supervisor",
        "chute_ros.nodes.safety_supervisor",
        required_links="[mavlink_parachute, upf_can]",
        deploy_links="[upf_can]",
        kill_timeout=str(_KILL_TIMEOUT),
    )
    start(
        "mavlink",
        "chute_ros.nodes.mavlink_parachute",
        connection=f"udpin:127.0.0.1:{network}",
        expect_parachute="false",
    )
    start(
        "upf_can",
        "chute_ros.nodes.upf_can",
        connection=f"mcast:0:{bus}",
        allocator="false",
    )


def _await_ready(name: str, pair: WireEnds, processes: Processes) -> None:
    """Until a first round succeeds: all is started, and everybody has heard everybody."""
    end = time.monotonic() + _READY_TIMEOUT
    while True:
        processes.check()
        pair.rest(_REST)
        try:
            pair.kill_switch(_ROUND_TIMEOUT)
            return
        except RoundFailedError as error:
            if time.monotonic() > end:
                raise RoundFailedError(f"{name} was not ready: {error}") from None


def report(rounds: dict[str, list[Round]]) -> str:
    """The file docs/bench.md."""
    rows = []
    for what, values in (
        ("to the kill on MAVLink", {n: [r.kill for r in all_] for n, all_ in rounds.items()}),
        ("to the answer on the bus", {n: [r.answer for r in all_] for n, all_ in rounds.items()}),
    ):
        base = summary(values[BARE])
        for name, measured in values.items():
            numbers = summary(measured)
            ratio = "1" if name == BARE else f"{numbers[0] / base[0]:.1f}"
            rows.append((f"{what}: {name}", *(f"{n:.2f} ms" for n in numbers), ratio))
    head = ("from the kill switch on the bus", "median", "99th percentile", "largest", "ratio")
    count = len(rounds[OURS])
    return (
        "# Measured\n\n"
        "Written by `make bench`. The numbers belong to the machine that made them:\n"
        f"{machine()}.\n\n"
        "## Kill switch\n\n"
        "A UPF controller asks for TYPE_KILLSWITCH on the CAN bus (UDP multicast); the kill\n"
        "(MAV_CMD_DO_FLIGHTTERMINATION) arrives at the autopilot, whose heartbeat then says\n"
        "motors off; SUCCESS arrives at the controller. Ours are the processes upf_can,\n"
        "safety_supervisor and mavlink_parachute, with two hops over ROS to the kill and one\n"
        "back; the bare relay is one process with two sockets that checks nothing\n"
        "(`bench/bare_relay.py`). "
        f"{count} rounds of each, taking turns, in one run.\n\n" + table(head, rows) + "\n"
    )


if __name__ == "__main__":
    main()
