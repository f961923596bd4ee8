"""UDP as a wire: listening, sending, or a pair of one-way sockets."""

from __future__ import annotations

import socket
from collections.abc import Hashable, Iterator
from typing import Any

from chute_ros.transport.address import Address

#: Most senders that are answered; the one that was silent longest gives way.
MOST_PEERS = 8
#: Datagrams taken at once, so that a flood cannot keep the loop from its deadlines.
_BURST = 64
_LARGEST = 2048


class UdpWire:
    """udpin, udpout or udppair, by the kind of the address."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._receiver: socket.socket | None = None
        self._sender: socket.socket | None = None
        self._fixed: tuple[str, int] | None = None
        self._peers: dict[tuple[str, int], None] = {}

    @property
    def is_open(self) -> bool:
        return self._receiver is not None

    def open(self) -> None:
        address = self._address
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            receiver.setblocking(False)
            if address.kind == "udpout":
                self._fixed = _resolve(address.host, address.port)
            else:
                receiver.bind((address.host, address.port))
            if address.kind == "udppair":
                self._fixed = _resolve(address.send_host, address.send_port)
        except OSError:
            receiver.close()
            raise
        self._receiver = receiver
        if address.kind == "udppair":
            self._sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._sender.setblocking(False)
        else:
            self._sender = receiver

    def close(self) -> None:
        for end in {self._receiver, self._sender} - {None}:
            assert end is not None
            end.close()
        self._receiver = self._sender = None
        self._peers.clear()

    def files(self) -> list[int]:
        return [] if self._receiver is None else [self._receiver.fileno()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        assert self._receiver is not None
        datagrams: list[tuple[bytes, Hashable]] = []
        for data, peer in received(self._receiver, _LARGEST):
            datagrams.append((data, None))
            self._peers.pop(peer, None)
            self._peers[peer] = None
        while len(self._peers) > MOST_PEERS:
            del self._peers[next(iter(self._peers))]
        return datagrams

    def write(self, data: bytes) -> None:
        assert self._sender is not None
        if self._fixed is not None:
            self._sender.sendto(data, self._fixed)
            return
        failure: OSError | None = None
        for peer in self._peers:
            try:
                self._sender.sendto(data, peer)
            except OSError as error:
                # One unreachable peer must not keep the frame from the others.
                failure = error
        if failure is not None:
            raise failure

    def describe(self) -> str:
        address = self._address
        if address.kind == "udpout":
            return f"udpout:{address.host}:{address.port}"
        port = address.port if self._receiver is None else self._receiver.getsockname()[1]
        here = f"{address.kind}:{address.host}:{port}"
        if address.kind == "udppair":
            return f"{here}:{address.send_host}:{address.send_port}"
        return here


def received(end: socket.socket, largest: int) -> Iterator[tuple[bytes, Any]]:
    """The datagrams that have come, with their senders."""
    for _ in range(_BURST):
        try:
            yield end.recvfrom(largest)
        except BlockingIOError:
            return


def _resolve(host: str, port: int) -> tuple[str, int]:
    found = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)[0][4]
    return str(found[0]), int(found[1])
