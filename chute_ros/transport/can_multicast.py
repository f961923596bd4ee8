"""CAN over UDP multicast: a bus without hardware, among the processes of this host.

The packets are those of pydronecan's driver "mcast", which the DroneCAN GUI Tool and ArduPilot's
simulation use as well: uint16 0x2934, CRC-16-CCITT of all that follows, uint16 flags, uint32
identifier (bit 31: extended), data; little endian. Group 239.65.82.BUS.
"""

from __future__ import annotations

import socket
import struct
from collections import Counter
from collections.abc import Hashable

from dronecan.dsdl.common import crc16_from_bytes

from chute_ros.protocol.dronecan.can_frame import EXTENDED_FLAG, CanFrame, pack, unpack
from chute_ros.transport.can_address import CanAddress

_GROUP = "239.65.82."
_MAGIC, _FLAG_FD = 0x2934, 0x0001
_HEAD, _BODY = struct.Struct("<HH"), struct.Struct("<HI")
_LARGEST = 74  # 64 bytes of CAN FD
#: Packets taken at once, so that a flood cannot keep the loop from its deadlines.
_BURST = 64
#: Frames never leave this host: a simulated parachute must not reach a real bus by accident.
_TIME_TO_LIVE = 0
_INTERFACE = "127.0.0.1"


class CanMulticastWire:
    """mcast:BUS:PORT."""

    def __init__(self, address: CanAddress) -> None:
        self._group, self._port = f"{_GROUP}{address.channel}", address.port
        self._bus = address.channel
        self._receiver: socket.socket | None = None
        self._sender: socket.socket | None = None
        self._own_port = 0
        #: Why a packet was dropped -> how often.
        self.counts: Counter[str] = Counter()

    @property
    def is_open(self) -> bool:
        return self._receiver is not None

    def open(self) -> None:
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            receiver.bind((self._group, self._port))
            group = socket.inet_aton(self._group)
            for interface in (socket.inet_aton(_INTERFACE), socket.inet_aton("0.0.0.0")):
                try:
                    receiver.setsockopt(
                        socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + interface
                    )
                except OSError:
                    # A host without a route for multicast has only the first.
                    if interface == socket.inet_aton(_INTERFACE):
                        raise
            receiver.setblocking(False)
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, _TIME_TO_LIVE)
            sender.setblocking(False)
            _connect(sender, self._group, self._port)
        except OSError:
            receiver.close()
            sender.close()
            raise
        self._receiver, self._sender = receiver, sender
        self._own_port = sender.getsockname()[1]

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
        for _ in range(_BURST):
            try:
                packet, sender = self._receiver.recvfrom(_LARGEST + 1)
            except BlockingIOError:
                break
            if sender[1] == self._own_port:
                continue  # a bus does not hear itself
            frame = self._frame(packet)
            if frame is not None:
                frames.append((frame, None))
        return frames

    def write(self, data: bytes) -> None:
        assert self._sender is not None
        frame = unpack(data)
        assert frame is not None  # the protocol makes them
        identifier = frame.identifier | (EXTENDED_FLAG if frame.extended else 0)
        body = _BODY.pack(0, identifier) + frame.data
        self._sender.send(_HEAD.pack(_MAGIC, crc16_from_bytes(body)) + body)

    def describe(self) -> str:
        return f"mcast:{self._bus}:{self._port}"

    def _frame(self, packet: bytes) -> bytes | None:
        """The sixteen bytes of the frame in a packet; None, and counted, if there is none."""
        if len(packet) < _HEAD.size + _BODY.size or len(packet) > _LARGEST:
            return self._drop("packets of a wrong length")
        magic, crc = _HEAD.unpack_from(packet)
        body = packet[_HEAD.size :]
        if magic != _MAGIC:
            return self._drop("packets of another kind")
        if crc != crc16_from_bytes(body):
            return self._drop("packets with a wrong CRC")
        flags, identifier = _BODY.unpack_from(body)
        data = body[_BODY.size :]
        if flags & _FLAG_FD or len(data) > 8:
            return self._drop("CAN FD frames")
        extended = bool(identifier & EXTENDED_FLAG)
        number = identifier & ~EXTENDED_FLAG & 0xFFFFFFFF
        if number > (0x1FFFFFFF if extended else 0x7FF):
            return self._drop("identifiers that no CAN frame has")
        return pack(CanFrame(number, data, extended))

    def _drop(self, reason: str) -> None:
        self.counts[reason] += 1


def _connect(sender: socket.socket, group: str, port: int) -> None:
    """By the host's own route for multicast, where all its programs listen; without one, by the
    loopback interface."""
    try:
        sender.connect((group, port))
    except OSError:
        interface = socket.inet_aton(_INTERFACE)
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        sender.connect((group, port))
