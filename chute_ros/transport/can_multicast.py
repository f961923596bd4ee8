"""CAN over UDP multicast: a bus without hardware, among the processes of this host.

The packets are those of pydronecan's driver "mcast", which the DroneCAN GUI Tool and ArduPilot's
simulation use as well: uint16 0x2934, CRC-16-CCITT of all that follows, uint16 flags, uint32
identifier with the flags of struct can_frame (bit 31: extended), data; little endian. Group
239.65.82.BUS.

They speak to the local network; this wire never does. It sends on the loopback interface, where
every program of this host hears it, and drops what another host sent: a simulated parachute must
not answer, or be answered by, somebody else's vehicle.
"""

from __future__ import annotations

import errno
import socket
import struct
from binascii import crc_hqx
from collections import Counter
from collections.abc import Hashable

from chute_ros.protocol.dronecan.can_frame import LAYOUT, MOST_DATA, pack, unpack
from chute_ros.transport.can_address import CanAddress
from chute_ros.transport.udp import received

_GROUP = "239.65.82."
_MAGIC, _FLAG_FD = 0x2934, 0x0001
_HEAD, _BODY = struct.Struct("<HH"), struct.Struct("<HI")
_CRC_START = 0xFFFF
_MOST_DATA_FD = 64
_LARGEST = _HEAD.size + _BODY.size + _MOST_DATA_FD
_LOOPBACK, _BY_ROUTE = (socket.inet_aton(host) for host in ("127.0.0.1", "0.0.0.0"))


class CanMulticastWire:
    """mcast:BUS:PORT."""

    def __init__(self, address: CanAddress) -> None:
        self._bus, self._port = address.channel, address.port
        self._group = f"{_GROUP}{address.channel}"
        self._receiver: socket.socket | None = None
        self._sender: socket.socket | None = None
        self._own_name: tuple[str, int] = ("", 0)
        self._here: set[str] = set()
        #: Why a packet was dropped -> how often.
        self.counts: Counter[str] = Counter()

    @property
    def is_open(self) -> bool:
        return self._receiver is not None

    def open(self) -> None:
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            # All programs on a bus share its port.
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            receiver.bind((self._group, self._port))
            self._join(receiver)
            receiver.setblocking(False)
            # Not by the host's route for multicast: there may be none, or it changes in flight.
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _LOOPBACK)
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            sender.setblocking(False)
            sender.connect((self._group, self._port))
            self._own_name = sender.getsockname()
        except OSError:
            receiver.close()
            sender.close()
            raise
        self._receiver, self._sender = receiver, sender
        self._here = {self._own_name[0]}

    def _join(self, receiver: socket.socket) -> None:
        group = socket.inet_aton(self._group)
        # Loopback for what we and our kind send. A packet is delivered once however many
        # interfaces have joined, as it comes in on one of them.
        try:
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + _LOOPBACK)
        except OSError as error:
            raise OSError(error.errno, "the loopback interface is down") from None
        try:
            # For the others, who send by the host's route for multicast.
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + _BY_ROUTE)
        except OSError as error:
            # There is no such route (ENODEV), or it is the loopback interface (EADDRINUSE).
            if error.errno not in (errno.ENODEV, errno.EADDRINUSE):
                raise

    def close(self) -> None:
        for end in (self._receiver, self._sender):
            if end is not None:
                end.close()
        self._receiver = self._sender = None

    def files(self) -> list[int]:
        return [] if self._receiver is None else [self._receiver.fileno()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        assert self._receiver is not None
        frames: list[tuple[bytes, Hashable]] = []
        for packet, sender in received(self._receiver, _LARGEST + 1):
            if sender == self._own_name:
                continue  # a bus does not hear itself
            frame = self._frame(packet, sender[0])
            if frame is not None:
                frames.append((frame, None))
        return frames

    def write(self, data: bytes) -> None:
        assert self._sender is not None
        identifier, length, payload = LAYOUT.unpack(data)
        body = _BODY.pack(0, identifier) + payload[:length]
        self._sender.send(_HEAD.pack(_MAGIC, crc_hqx(body, _CRC_START)) + body)

    def describe(self) -> str:
        return f"mcast:{self._bus}:{self._port}"

    def _frame(self, packet: bytes, host: str) -> bytes | None:
        """The sixteen bytes of the frame in a packet; None, and counted, if there is none."""
        if not _HEAD.size + _BODY.size <= len(packet) <= _LARGEST:
            return self._drop("packets of a wrong length")
        magic, crc = _HEAD.unpack_from(packet)
        body = packet[_HEAD.size :]
        if magic != _MAGIC:
            return self._drop("packets of another kind")
        if crc != crc_hqx(body, _CRC_START):
            return self._drop("packets with a wrong CRC")
        if host not in self._here:
            if not is_of_this_host(host):
                return self._drop("packets from another host")
            self._here.add(host)
        flags, identifier = _BODY.unpack_from(body)
        data = body[_BODY.size :]
        if flags & _FLAG_FD:
            return self._drop("CAN FD frames")
        if len(data) > MOST_DATA:
            return self._drop("packets of a wrong length")
        frame = unpack(LAYOUT.pack(identifier, len(data), data))
        if frame is None:
            return self._drop("impossible CAN identifiers")
        if frame.error:
            # They tell about a controller, and there is none: nobody may report bus-off here.
            return self._drop("error frames")
        return pack(frame)

    def _drop(self, reason: str) -> bytes | None:
        """No frame, and why not."""
        self.counts[reason] += 1
        return None


def is_of_this_host(host: str) -> bool:
    """That IPv4 address belongs to one of this host's interfaces."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host, 0))
        except OSError:
            return False
    return True
