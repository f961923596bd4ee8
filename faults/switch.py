"""A network switch in user space whose cables can be cut, slowed, made lossy or one-way.

python -m faults.switch PORT=INTERFACE ...    commands on standard input, one a line:

    PORT cut | PORT heal          nothing passes | everything passes as it comes
    PORT deaf | PORT mute         nothing reaches the host | nothing leaves it
    PORT slow SECONDS             what leaves it or reaches it comes so much later
    PORT lossy FRACTION           of frames is lost, each way
    PORT unicast                  no IP multicast passes, as on many radio links

Each command is answered with "ok". The interfaces are the near ends of veth pairs.
"""

from __future__ import annotations

import heapq
import itertools
import random
import selectors
import socket
import sys
import time
from dataclasses import dataclass

_ETH_P_ALL = 3
_BROADCAST_BIT = 1
_MULTICAST = bytes.fromhex("01005e")  # how an IP multicast group's address begins on Ethernet
#: More than this waiting: a slow cable drops, as a router does.
_MOST_WAITING = 20_000


@dataclass
class Cable:
    """Between the switch and one host."""

    wire: socket.socket
    #: From the host, and to it.
    sends: bool = True
    receives: bool = True
    delay: float = 0.0
    loss: float = 0.0
    multicast: bool = True

    def set(self, what: str, value: str) -> None:
        """As a command has it; whatever was before is over."""
        self.sends = what not in ("cut", "mute")
        self.receives = what not in ("cut", "deaf")
        self.delay = float(value) if what == "slow" else 0.0
        self.loss = float(value) if what == "lossy" else 0.0
        self.multicast = what != "unicast"

    def passes(self, frame: bytes) -> bool:
        """This frame is not lost."""
        if not self.multicast and frame[:3] == _MULTICAST:
            return False
        return random.random() >= self.loss


class Switch:
    """Passes Ethernet frames on between its cables; learns who is where."""

    def __init__(self, interfaces: dict[str, str]) -> None:
        self.cables = {name: Cable(_open(one)) for name, one in interfaces.items()}
        self._where: dict[bytes, str] = {}
        self._waiting: list[tuple[float, int, str, bytes]] = []
        self._order = itertools.count()
        self._selector = selectors.DefaultSelector()
        for name, cable in self.cables.items():
            self._selector.register(cable.wire, selectors.EVENT_READ, name)
        self._selector.register(sys.stdin, selectors.EVENT_READ, "")

    def run(self) -> None:
        """Until standard input ends."""
        while True:
            wait = None
            if self._waiting:
                wait = max(0.0, self._waiting[0][0] - time.monotonic())
            for key, _ in self._selector.select(wait):
                if not key.data:
                    line = sys.stdin.readline()
                    if not line:
                        return
                    self._command(*line.split())
                    print("ok", flush=True)
                else:
                    self._take(key.data)
            now = time.monotonic()
            while self._waiting and self._waiting[0][0] <= now:
                _, _, name, frame = heapq.heappop(self._waiting)
                self._send(name, frame)

    def _command(self, name: str, what: str, value: str = "0") -> None:
        self.cables[name].set(what, value)

    def _take(self, source: str) -> None:
        cable = self.cables[source]
        while True:
            try:
                frame, address = cable.wire.recvfrom(65536)
            except BlockingIOError:
                return
            if address[2] == socket.PACKET_OUTGOING:
                continue  # what we sent ourselves
            self._where[frame[6:12]] = source
            if not cable.sends or not cable.passes(frame):
                continue
            known = None if frame[0] & _BROADCAST_BIT else self._where.get(frame[:6])
            for name in (known,) if known else self.cables:
                if name != source:
                    self._pass_on(name, frame, cable.delay + self.cables[name].delay)

    def _pass_on(self, name: str, frame: bytes, delay: float) -> None:
        if not delay:
            self._send(name, frame)
        elif len(self._waiting) < _MOST_WAITING:
            entry = (time.monotonic() + delay, next(self._order), name, frame)
            heapq.heappush(self._waiting, entry)

    def _send(self, name: str, frame: bytes) -> None:
        cable = self.cables[name]
        if cable.receives and cable.passes(frame):
            try:
                cable.wire.send(frame)
            except OSError:
                pass  # its queue is full, or the host is gone: lost, as on any network


def _open(interface: str) -> socket.socket:
    wire = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ETH_P_ALL))
    wire.bind((interface, 0))
    wire.setblocking(False)
    wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
    return wire


if __name__ == "__main__":
    Switch(dict(argument.split("=") for argument in sys.argv[1:])).run()
