"""The relay on the MAVLink network of the soak."""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable

from chute_ros.protocol.mavlink.dialect import FORCE_DISARM, dialect
from chute_ros.sim.faults import flip_a_byte
from faults.soak_relay import DEPLOY, KILL, TIMES, VALID, Relay, Seen

_BURST = 64
_COMMAND_LONG = struct.Struct("<7fH")


class MavlinkRelay(Relay):
    """devices: ports where simulators send to; each is a host of its own for the node.

    far: opens a socket on the devices' host."""

    def __init__(
        self,
        seen: Seen,
        devices: tuple[int, ...],
        node: tuple[str, int],
        far: Callable[[int], socket.socket],
    ) -> None:
        super().__init__("mavlink", seen)
        self._node, self._open_far = node, far
        self._near = [open_socket("127.0.0.1", port) for port in devices]
        self._ports = devices
        self._far: list[socket.socket] = []
        self._peers: dict[int, tuple[str, int]] = {}
        self.open_ports()

    def open_ports(self) -> None:
        """The node's way to the devices is there."""
        self._far = [self._open_far(port) for port in self._ports]

    def close_ports(self) -> None:
        """Nobody listens where the devices were: the node's packets come back as unreachable."""
        for one in self._far:
            one.close()
        self._far = []

    def files(self) -> dict[int, Callable[[], None]]:
        readers: dict[int, Callable[[], None]] = {}
        for number, near in enumerate(self._near):
            readers[near.fileno()] = lambda number=number: self._up(number)  # type: ignore[misc]
        for number, far in enumerate(self._far):
            readers[far.fileno()] = lambda number=number: self._down(number)  # type: ignore[misc]
        return readers

    def close(self) -> None:
        self.close_ports()
        for one in self._near:
            one.close()

    def _up(self, number: int) -> None:
        for data, peer in _datagrams(self._near[number]):
            self._peers[number] = peer
            if not self._far or not self.takes():
                continue
            for one in (data, *self._more(data)):
                _send(self._far[number], one, self._node)

    def _down(self, number: int) -> None:
        for data, _ in _datagrams(self._far[number]):
            peer = self._peers.get(number)
            if peer is None or not self.takes():
                continue
            what = mavlink_order(data)
            if what:
                self.seen(self.name, *what)
            _send(self._near[number], data, peer)

    def _more(self, data: bytes) -> list[bytes]:
        if not self.flood:
            return []
        if self.flood == VALID:
            return [data] * TIMES
        half = TIMES // 2
        noise = [self.chance.randbytes(self.chance.randint(1, 280)) for _ in range(half)]
        return noise + [flip_a_byte(data, self.chance) for _ in range(TIMES - half)]


def mavlink_order(data: bytes) -> tuple[str, str] | None:
    """(KILL or DEPLOY, text) if this datagram of MAVLink 2 holds such a command."""
    if len(data) < 12 or data[0] != 0xFD or int.from_bytes(data[7:10], "little") != 76:
        return None
    payload = data[10 : 10 + data[1]].ljust(_COMMAND_LONG.size + 3, b"\0")
    *params, command = _COMMAND_LONG.unpack_from(payload)
    if command == dialect.MAV_CMD_DO_FLIGHTTERMINATION and params[0] >= 0.5:
        return KILL, "MAV_CMD_DO_FLIGHTTERMINATION"
    if command == dialect.MAV_CMD_COMPONENT_ARM_DISARM and params[1] == FORCE_DISARM:
        return KILL, "forced disarm"
    if command == dialect.MAV_CMD_DO_PARACHUTE and params[0] == dialect.PARACHUTE_RELEASE:
        return DEPLOY, "MAV_CMD_DO_PARACHUTE release"
    return None


def open_socket(host: str, port: int) -> socket.socket:
    """A device's end of the network."""
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind((host, port))
    one.setblocking(False)
    return one


def _datagrams(one: socket.socket) -> list[tuple[bytes, tuple[str, int]]]:
    datagrams = []
    for _ in range(_BURST):
        try:
            datagrams.append(one.recvfrom(2048))
        except OSError:
            break  # no more, or the other end is not there
    return datagrams


def _send(one: socket.socket, data: bytes, to: tuple[str, int]) -> None:
    try:
        one.sendto(data, to)
    except OSError:
        pass  # the interface is down: lost
