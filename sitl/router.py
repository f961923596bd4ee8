"""A MAVLink router on loopback that records each frame: python -m sitl.router RECORD PORTS ...

Each of PORTS (PORT[,PORT]) is a network of its own: frames that come to one of its ports, from
anyone, are routed to all who were heard on any of its ports. A port with a t before it is one of
TCP, for one serial line at a time.
"""

from __future__ import annotations

import selectors
import signal
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

from sitl.record import Recorder
from sitl.routing import FrameSplitter, Routes

End: TypeAlias = tuple[int, Any]  # port here, address there
_MOST = 65536


class Network:
    """Ports that frames are passed on between."""

    def __init__(self, texts: list[str], recorder: Recorder, selector: selectors.BaseSelector):
        self._recorder, self._selector = recorder, selector
        self._routes: Routes[End] = Routes()
        self._splitters: dict[End, FrameSplitter] = {}
        self._sockets: dict[int, socket.socket] = {}
        for text in texts:
            port = int(text.lstrip("t"))
            if text.startswith("t"):
                one = socket.create_server(("127.0.0.1", port))
                self._watch(one, self._accept, port)
            else:
                one = self._sockets[port] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                one.bind(("127.0.0.1", port))
                self._watch(one, self._take, port)

    def _watch(
        self, one: socket.socket, take: Callable[[socket.socket, int], None], port: int
    ) -> None:
        one.setblocking(False)
        self._selector.register(one, selectors.EVENT_READ, (take, port))

    def _accept(self, server: socket.socket, port: int) -> None:
        one, _ = server.accept()
        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._sockets[port] = one
        # A line has its other end from the start; the end of a datagram is known once it is heard.
        self._splitters[port, None] = FrameSplitter()
        self._watch(one, self._take_stream, port)

    def _take_stream(self, one: socket.socket, port: int) -> None:
        try:
            data = one.recv(_MOST)
        except ConnectionError:
            data = b""
        if not data:  # the autopilot has ended
            self._selector.unregister(one)
            one.close()
            return
        self._pass_on((port, None), data)

    def _take(self, one: socket.socket, port: int) -> None:
        while True:
            try:
                data, address = one.recvfrom(_MOST)
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
            for port, address in self._routes.ways(source, frame, self._splitters):
                _send(self._sockets[port], frame, address)


def _send(one: socket.socket, frame: bytes, address: Any) -> None:
    try:
        if address is None:
            one.send(frame)
        else:
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
            Network(text.split(","), recorder, selector)
        print("routing", flush=True)
        while True:
            for key, _ in selector.select():
                take, port = key.data
                take(key.fileobj, port)


if __name__ == "__main__":
    main()
