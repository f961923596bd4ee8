"""UDP as a wire: listening, sending, or a pair of one-way sockets."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Hashable, Iterator
from typing import Any

from chute_ros.transport.address import Address
from chute_ros.transport.tcp import GIVE_BACK_AFTER

#: Most senders that are answered.
MOST_PEERS = 8
#: Datagrams taken at once, so that a flood cannot keep the loop from its deadlines.
_BURST = 64
_LARGEST = 2048


class UdpWire:
    """udpin, udpout or udppair, by the kind of the address.

    udpin answers the senders of frames. One that sends frames keeps its place, whoever else comes;
    if all places are taken, the one that was silent longest gives way once it is as silent as a
    client of tcpin may be."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._receiver: socket.socket | None = None
        self._sender: socket.socket | None = None
        self._fixed: tuple[str, int] | None = None
        #: Of what was read last and the protocol has not taken yet, oldest first.
        self._senders: deque[tuple[str, int]] = deque()
        #: When each sent its newest frame, monotonic s; who was silent longest is the first.
        self._peers: dict[tuple[str, int], float] = {}

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
        self._senders.clear()

    def files(self) -> list[int]:
        return [] if self._receiver is None else [self._receiver.fileno()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        assert self._receiver is not None
        datagrams = list(received(self._receiver, _LARGEST))
        self._senders = deque(sender for _, sender in datagrams)
        return [(data, None) for data, _ in datagrams]

    def data_heard(self, stream: Hashable, framed: bool, now: float) -> None:
        """The protocol has taken the next datagram. framed: it held a frame."""
        if not self._senders:
            return
        sender = self._senders.popleft()
        if not framed or self._fixed is not None:
            return
        known = self._peers.pop(sender, None) is not None
        if not known and len(self._peers) >= MOST_PEERS:
            silent = next(iter(self._peers))
            if now - self._peers[silent] < GIVE_BACK_AFTER:
                return
            del self._peers[silent]
        self._peers[sender] = now

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
