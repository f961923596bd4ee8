"""TCP as a wire: connecting to one server, or accepting several clients."""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Hashable
from itertools import count

_CHUNK = 4096
_MOST_CLIENTS = 8
#: How long a connection attempt may take, s; the link's deadlines wait for it.
_CONNECT_TIMEOUT = 0.2
#: A client keeps its place while it sends a frame at least this often, s: MAVLink's heartbeat
#: comes each second, and a device that misses ten of them is lost on every link.
GIVE_BACK_AFTER = 10.0
#: That places were given back is told of for so long, s.
_TELL_FOR = 60.0
_stream_numbers = count(1)


class TcpClientWire:
    """tcp:HOST:PORT."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._socket: socket.socket | None = None
        self._stream = 0

    @property
    def is_open(self) -> bool:
        return self._socket is not None

    def open(self) -> None:
        end = socket.create_connection((self._host, self._port), timeout=_CONNECT_TIMEOUT)
        _prepare(end)
        self._socket, self._stream = end, next(_stream_numbers)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def files(self) -> list[int]:
        return [] if self._socket is None else [self._socket.fileno()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        assert self._socket is not None
        try:
            data = self._socket.recv(_CHUNK)
        except BlockingIOError:
            return []
        if not data:
            raise ConnectionResetError(f"{self.describe()} closed the connection")
        return [(data, self._stream)]

    def write(self, data: bytes) -> None:
        assert self._socket is not None
        _send_whole(self._socket, data)

    def describe(self) -> str:
        return f"tcp:{self._host}:{self._port}"


class TcpServerWire:
    """tcpin:HOST:PORT. A client that sends no frame loses its place, so that nobody can hold all
    places with silence or noise; one that sends frames never does, whoever else comes."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._listener: socket.socket | None = None
        self._clients: dict[int, tuple[socket.socket, int]] = {}
        #: When each stream sent its newest frame, or connected, monotonic s.
        self._frame_at: dict[int, float] = {}
        self._given_back_at = -math.inf

    @property
    def is_open(self) -> bool:
        return self._listener is not None

    def open(self) -> None:
        self._listener = socket.create_server((self._host, self._port))
        self._listener.setblocking(False)

    def close(self) -> None:
        for client, _ in self._clients.values():
            client.close()
        self._clients.clear()
        self._frame_at.clear()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def files(self) -> list[int]:
        listener = [] if self._listener is None else [self._listener.fileno()]
        return [*listener, *self._clients]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        assert self._listener is not None
        if file == self._listener.fileno():
            self._accept()
            return []
        if file not in self._clients:
            return []
        client, stream = self._clients[file]
        try:
            data = client.recv(_CHUNK)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._drop(file)
        return [(data, stream)]

    def write(self, data: bytes) -> None:
        for client, _ in self._clients.values():
            try:
                _send_whole(client, data)
            except OSError:
                _end(client)

    def data_heard(self, stream: Hashable, framed: bool, now: float) -> None:
        """The protocol has taken what this stream sent. framed: it held a frame."""
        if framed and stream in self._frame_at:
            self._frame_at[stream] = now

    def look(self, now: float) -> str:
        """Look at the clock: give places back. Returns, for a while, that some had to be."""
        for client, stream in self._clients.values():
            if now - self._frame_at[stream] >= GIVE_BACK_AFTER:
                self._given_back_at = now
                _end(client)
        if now - self._given_back_at >= _TELL_FOR:
            return ""
        why = f"sent no accepted frame for {GIVE_BACK_AFTER:g} s and was disconnected"
        return f"{self.describe()}: a client {why}"

    def describe(self) -> str:
        port = self._port if self._listener is None else self._listener.getsockname()[1]
        return f"tcpin:{self._host}:{port}"

    def _accept(self) -> None:
        assert self._listener is not None
        try:
            client, _ = self._listener.accept()
        except OSError:
            return
        if len(self._clients) >= _MOST_CLIENTS:
            client.close()
            return
        _prepare(client)
        stream = next(_stream_numbers)
        self._clients[client.fileno()] = (client, stream)
        self._frame_at[stream] = time.monotonic()

    def _drop(self, file: int) -> None:
        client, stream = self._clients.pop(file)
        del self._frame_at[stream]
        client.close()


def _prepare(end: socket.socket) -> None:
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    end.setblocking(False)


def _end(client: socket.socket) -> None:
    """The next read finds its end and says which stream that was."""
    with contextlib.suppress(OSError):
        client.shutdown(socket.SHUT_RDWR)


def _send_whole(end: socket.socket, data: bytes) -> None:
    """All of data or an OSError: half a frame would damage the next one."""
    if end.send(data) != len(data):
        raise ConnectionAbortedError("the connection takes no more data; closed")
