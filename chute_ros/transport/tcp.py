"""TCP as a wire: connecting to one server, or accepting several clients."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Hashable
from itertools import count

_CHUNK = 4096
_MOST_CLIENTS = 8
#: How long a connection attempt may take, s; the link's deadlines wait for it.
_CONNECT_TIMEOUT = 0.2
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
    """tcpin:HOST:PORT."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._listener: socket.socket | None = None
        self._clients: dict[int, tuple[socket.socket, int]] = {}

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
                # The next read finds its end and says which stream that was.
                with contextlib.suppress(OSError):
                    client.shutdown(socket.SHUT_RDWR)

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
        self._clients[client.fileno()] = (client, next(_stream_numbers))

    def _drop(self, file: int) -> None:
        client, _ = self._clients.pop(file)
        client.close()


def _prepare(end: socket.socket) -> None:
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    end.setblocking(False)


def _send_whole(end: socket.socket, data: bytes) -> None:
    """All of data or an OSError: half a frame would damage the next one."""
    if end.send(data) != len(data):
        raise ConnectionAbortedError("the connection takes no more data; closed")
