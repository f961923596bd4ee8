"""Valid frames besides, from a process of its own, which must not take the time that is measured.

Attitudes of the autopilot, through its own socket (the node must answer to one address), and the
status of another node on the bus. Arguments: the socket's file descriptor, its port at the node,
the port of the CAN multicast bus 0. A line on stdin: how many of each a second; 0: none.
"""

from __future__ import annotations

import select
import socket
import subprocess
import sys
import time

from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_multicast import CanMulticastWire
from chute_ros.transport.data_types import load_data_types

#: Nobody else's on the bus.
_NODE_ID = 50


class Flood:
    """Held by who measures."""

    def __init__(self, network_file: int, network_port: int, bus_port: int) -> None:
        numbers = (network_file, network_port, bus_port)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bench.flood", *map(str, numbers)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=(network_file,),
            text=True,
        )

    def set(self, rate: float) -> None:
        """So many of each a second, once this returns."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{rate}\n")
        self._process.stdin.flush()
        self._process.stdout.readline()

    def close(self) -> None:
        """It ends."""
        self._process.communicate()


def attitude(now: float) -> dialect.MAVLink_message:
    """Level; each a little different."""
    return dialect.MAVLink_attitude_message(0, 0.0, 0.0, now % 1e-3, 0.0, 0.0, 0.0)


def main() -> None:
    """Until stdin ends."""
    network_file, network_port, bus_port = map(int, sys.argv[1:])
    network, to = socket.socket(fileno=network_file), ("127.0.0.1", network_port)
    bus = CanMulticastWire(parse_can_address(f"mcast:0:{bus_port}"))
    bus.open()
    encoder = FrameEncoder(1, 1)
    endpoint = Endpoint(load_data_types("", "bench"), _NODE_ID)
    begun, rate, due = time.monotonic(), 0.0, 0.0
    while True:
        wait = max(0.0, due - time.monotonic()) if rate else None
        if select.select([sys.stdin], [], [], wait)[0]:
            line = sys.stdin.readline()
            if not line:
                return
            rate, due = float(line), time.monotonic()
            print("set", flush=True)
            continue
        now = time.monotonic()
        network.sendto(encoder.encode(attitude(now), now), to)
        endpoint.broadcast("uavcan.protocol.NodeStatus", {"uptime_sec": int(now - begun)})
        for frame in endpoint.take_output():
            bus.write(frame)
        due += 1.0 / rate


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass  # the usual way to end it
