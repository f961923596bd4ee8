"""A loop around a CAN wire, and frames to send over it, for the tests of the CAN transport."""

import contextlib
import os
import socket
import struct
import threading
from binascii import crc_hqx
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from loop_bench import Recorder, Running

from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_bus import CanBusWire
from chute_ros.transport.can_wire import make_can_wire
from chute_ros.transport.loop import WireLoop

#: One of each kind that a bus carries: both lengths of identifier, no data, some, and all of it.
FRAMES = [
    CanFrame(0x18040A7B, b"\x01\x02\x03\x04\x05\x06\x07\xc0"),
    CanFrame(0x1FFFFFFF, b""),
    CanFrame(0, b"\x00"),
    CanFrame(0x7FF, b"\xff" * 8, extended=False),
    CanFrame(0x001, b"", extended=False),
]


class CanRunning(Running):
    """A Recorder on a CAN bus."""

    def __init__(self, connection: str, bitrate: int = 0) -> None:
        self.link = Recorder()
        self.delivered = []
        self.wire = make_can_wire(parse_can_address(connection, bitrate))
        self.loop = WireLoop(self.link, self.wire, self.delivered.extend)

    @property
    def frames(self) -> list[CanFrame | None]:
        """The frames that were heard."""
        return [unpack(data) for data, _ in self.link.received]

    def send_frame(self, frame: CanFrame) -> None:
        """Have the protocol send frame."""
        self.send(pack(frame))


@contextmanager
def running_can(connection: str, bitrate: int = 0) -> Iterator[CanRunning]:
    """A loop over connection, ended at the end."""
    one = CanRunning(connection, bitrate)
    one.loop.start()
    try:
        yield one
    finally:
        one.loop.stop()


def packet(identifier: int, data: bytes, flags: int = 0, magic: int = 0x2934) -> bytes:
    """A packet of pydronecan's multicast, made independently of ours."""
    body = struct.pack("<HI", flags, identifier) + data
    return struct.pack("<HH", magic, crc_hqx(body, 0xFFFF)) + body


def multicaster(group: str, port: int, by_route: bool = False) -> socket.socket:
    """A socket that sends to a group on this host, by loopback or the host's own route."""
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    if not by_route:
        end.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
    end.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    end.connect((group, port))
    return end


def need_multicast_route() -> None:
    """Skip where other people's drivers cannot work: they let the host choose an interface."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        member = socket.inet_aton("239.255.0.1") + socket.inet_aton("0.0.0.0")
        try:
            end.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
        except OSError as error:
            pytest.skip(f"this host has no route for multicast: {error}")


def multicast_ear(group: str, port: int) -> socket.socket:
    """A socket that hears what is sent to a group on this host."""
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    end.bind((group, port))
    member = socket.inet_aton(group) + socket.inet_aton("127.0.0.1")
    end.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
    end.settimeout(20.0)
    return end


def children() -> list[str]:
    """The processes that this one has started and that are still there."""
    found = []
    for task in os.listdir("/proc/self/task"):
        # A thread of another story may end at this moment; it has started none.
        with (
            contextlib.suppress(FileNotFoundError, ProcessLookupError),
            open(f"/proc/self/task/{task}/children") as listing,
        ):
            found += listing.read().split()
    return found


def opened(connection: str, bitrate: int = 0) -> CanBusWire:
    """The wire itself, without a loop; whoever opens it closes it."""
    wire = CanBusWire(parse_can_address(connection, bitrate))
    wire.open()
    return wire


def readers() -> list[str]:
    """Names of the threads that wait for frames."""
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("reader ")]
