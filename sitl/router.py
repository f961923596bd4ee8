"""A MAVLink router on loopback that records each frame: python -m sitl.router RECORD PORT[,PORT] ...

Each argument after the record is a network of its own: frames that come to one of its ports, from
anyone, are routed to all who were heard on any of its ports.
"""

from __future__ import annotations

import selectors
import signal
import socket
import sys
import time
from pathlib import Path
from typing import Any

from sitl.record import Recorder
from sitl.routing import FrameSplitter, Routes

End = tuple[int, Any]  # port here, address there
_MOST = 65536


class Network:
    """Ports that frames are passed on between."""

    def __init__(self, ports: list[int], recorder: Recorder) -> None:
        self.sockets = {port: _socket(port) for port in ports}
        self._recorder = recorder
        self._routes = Routes()
        self._splitters: dict[End, FrameSplitter] = {}

    def take(self, port: int) -> None:
        """Pass on what waits on this port."""
        while True:
            try:
                data, address = self.sockets[port].recvfrom(_MOST)
            except BlockingIOError:
                return
            except ConnectionError:
                continue  # a process behind another end has ended
            self._pass_on((port, address), data)

    def _pass_on(self, source: End, data: bytes) -> None:
        now = time.monotonic()
        splitter = self._splitters.setdefault(source, FrameSplitter())
        for frame in splitter.feed(data):
            self._routes.hear(source, frame)
            self._recorder.write(now, source[0], frame)
            for end in self._routes.ways(source, frame, self._splitters):
                _send(self.sockets[end[0]], frame, end[1])


def _socket(port: int) -> socket.socket:
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind(("127.0.0.1", port))
    one.setblocking(False)
    return one


def _send(one: socket.socket, frame: bytes, address: Any) -> None:
    try:
        one.sendto(frame, address)
    except OSError:
        pass  # a process that has ended; its successor has another port


def main() -> None:
    """Route until SIGINT or SIGTERM."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: sys.exit(0))
    selector = selectors.DefaultSelector()
    with Recorder(Path(sys.argv[1])) as recorder:
        for text in sys.argv[2:]:
            network = Network([int(port) for port in text.split(",")], recorder)
            for port, one in network.sockets.items():
                selector.register(one, selectors.EVENT_READ, (network, port))
        print("routing", flush=True)
        while True:
            for key, _ in selector.select():
                network, port = key.data
                network.take(port)


if __name__ == "__main__":
    main()
