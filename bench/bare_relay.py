"""The peer to compare with: kill switch from the bus to MAVLink and the answer back, nothing else.

Two sockets, one select, bytes by hand: no ROS, no supervisor, no checks, no retries.
Arguments: port of the CAN multicast bus 0, port of the MAVLink socket.
"""

from __future__ import annotations

import select
import socket
import struct
import sys

from chute_msgs.mavlink import parachute as dialect
from dronecan.dsdl.common import crc16_from_bytes

GROUP = "239.65.82.0"
_LOOPBACK = socket.inet_aton("127.0.0.1")
_NODE_ID = 100
_VEHICLE_SERVICE = 164
_KILLSWITCH = 1
_FORCE_DISARM = 21196
_HEARTBEAT, _COMMAND_ACK = 0, 77
_ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED


class Bus:
    """The CAN bus."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind((GROUP, port))
        group = socket.inet_aton(GROUP) + _LOOPBACK
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _LOOPBACK)
        self._out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        self._out.connect((GROUP, port))

    def kill_switch(self) -> tuple[int, int] | None:
        """Read one packet; (client, transfer id) if it is a kill switch."""
        packet = self.socket.recv(2048)
        identifier = struct.unpack_from("<I", packet, 6)[0] & 0x1FFFFFFF
        service = identifier >> 16 & 0xFF, identifier >> 8 & 0x7F, identifier & 0x8080
        data = packet[10:]
        if service != (_VEHICLE_SERVICE, _NODE_ID, 0x8080) or data[4] != _KILLSWITCH:
            return None
        return identifier & 0x7F, data[-1] & 0x1F

    def success(self, client: int, transfer_id: int) -> None:
        """Answer it."""
        identifier = 2 << 24 | _VEHICLE_SERVICE << 16 | client << 8 | 0x80 | _NODE_ID
        body = struct.pack("<HI", 0, identifier | 0x80000000) + bytes((0, 0xC0 | transfer_id))
        self._out.send(struct.pack("<HH", 0x2934, crc16_from_bytes(body)) + body)


class Network:
    """The MAVLink network with the autopilot."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", port))
        self._mavlink = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
        self._autopilot: tuple[str, int] | None = None
        self._wanted: set[int] = set()

    def kill(self) -> None:
        """Send the kill."""
        if self._autopilot is None:
            return
        self._wanted = {_HEARTBEAT, _COMMAND_ACK}
        kill = self._mavlink.command_long_encode(
            1, 1, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, _FORCE_DISARM, 0, 0, 0, 0, 0
        )
        self.socket.sendto(kill.pack(self._mavlink), self._autopilot)

    def killed(self) -> bool:
        """Read one packet; True: since the kill, this is the last of acknowledgement and
        heartbeat with motors off."""
        packet, self._autopilot = self.socket.recvfrom(2048)
        message_id = int.from_bytes(packet[7:10], "little")
        if message_id not in self._wanted or (message_id == _HEARTBEAT and packet[16] & _ARMED):
            return False
        self._wanted.discard(message_id)
        return not self._wanted


def main() -> None:
    """Relay until the end of the process."""
    bus, network = Bus(int(sys.argv[1])), Network(int(sys.argv[2]))
    waiting = None
    while True:
        for ready in select.select([bus.socket, network.socket], [], [])[0]:
            if ready is network.socket:
                if network.killed() and waiting is not None:
                    bus.success(*waiting)
                    waiting = None
            elif (request := bus.kill_switch()) is not None:
                waiting = request
                network.kill()


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass  # the usual way to end it
