"""All wires of the vehicle, in one thread."""

from __future__ import annotations

import select
import socket
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from chute_ros.transport.can_address import parse_can_address
from faults.network import Network
from faults.soak_relay import Relay
from faults.soak_relay_can import CanRelay
from faults.soak_relay_mavlink import MavlinkRelay, open_socket
from faults.soak_relay_serial import SerialRelay

VEHICLE, DEVICES = "vehicle", "devices"
HOSTS = (VEHICLE, DEVICES)
VEHICLE_ADDRESS, DEVICES_ADDRESS = "10.77.0.1", "10.77.0.2"
#: Of the vehicle's network interface.
INTERFACE = "eth0"
_LOOK = 0.05  # s


@dataclass(frozen=True)
class Order:
    """A kill or a deploy on a wire, on its way to a device."""

    when: float
    wire: str
    what: str
    text: str


@dataclass(frozen=True)
class Ports:
    """Where everything is."""

    node: int
    autopilot: int
    parachute: int
    pilot: int
    can: int

    @classmethod
    def from_first(cls, first: int) -> Ports:
        """Five in a row."""
        return cls(*range(first, first + 5))

    @property
    def node_bus(self) -> str:
        """The CAN bus of upf_can."""
        return f"mcast:33:{self.can}"

    @property
    def device_bus(self) -> str:
        """The CAN bus of the parachute."""
        return f"mcast:34:{self.can}"


class Wires:
    """The relays. Kinds of trouble are set on them with the lock held."""

    def __init__(self, network: Network, ports: Ports, folder: Path) -> None:
        self._network = network
        self.orders: list[Order] = []
        self.port, self.device = folder / "ttyNODE", folder / "ttyROCKET"
        self.mavlink = MavlinkRelay(
            self._seen,
            (ports.autopilot, ports.parachute),
            (VEHICLE_ADDRESS, ports.node),
            self._far,
        )
        self.can = CanRelay(
            self._seen, parse_can_address(ports.node_bus), parse_can_address(ports.device_bus)
        )
        self.serial = SerialRelay(self._seen, self.port, self.device)
        self.all: dict[str, Relay] = {
            one.name: one for one in (self.mavlink, self.can, self.serial)
        }
        self.lock = threading.Lock()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="wires")
        self._thread.start()

    def chosen(self, target: str) -> list[Relay]:
        """The relays that a fault strikes."""
        return list(self.all.values()) if target == "all" else [self.all[target]]

    def dropped(self) -> int:
        """How many frames did not pass, of all that came."""
        return sum(one.dropped for one in self.all.values())

    def close(self) -> None:
        """The thread ends."""
        self._ended = True
        self._thread.join()
        for one in self.all.values():
            one.close()

    def _seen(self, wire: str, what: str, text: str) -> None:
        self.orders.append(Order(time.monotonic(), wire, what, text))

    def _far(self, port: int) -> socket.socket:
        self._network.enter(DEVICES)
        try:
            return open_socket(DEVICES_ADDRESS, port)
        finally:
            self._network.enter(VEHICLE)

    def _run(self) -> None:
        while not self._ended:
            with self.lock:
                readers = {
                    file: read for one in self.all.values() for file, read in one.files().items()
                }
                poll = select.poll()
                for file in readers:
                    poll.register(file, select.POLLIN)
            ready = [file for file, _ in poll.poll(_LOOK * 1000.0)]
            with self.lock:
                # What was closed meanwhile is not read any more.
                known = {file for one in self.all.values() for file in one.files()}
                for file in ready:
                    if file in known and file in readers:
                        readers[file]()
                now = time.monotonic()
                for one in self.all.values():
                    one.look(now)
