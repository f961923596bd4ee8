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

_GROUP = "239.65.82.0"
_NODE_ID = 10
_VEHICLE_SERVICE = 164
_KILLSWITCH = 1
_ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED


def main() -> None:
    """Relay until the end of the process."""
    bus_port, mavlink_port = map(int, sys.argv[1:])
    bus = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bus.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bus.bind((_GROUP, bus_port))
    for interface in ("127.0.0.1", "0.0.0.0"):
        group = socket.inet_aton(_GROUP) + socket.inet_aton(interface)
        bus.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    network = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    network.bind(("127.0.0.1", mavlink_port))
    mavlink = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
    autopilot = None
    waiting = None
    print("ready", flush=True)
    while True:
        for ready in select.select([bus, network], [], [])[0]:
            packet, peer = ready.recvfrom(2048)
            if ready is network:
                autopilot = peer
                message_id = int.from_bytes(packet[7:10], "little")
                killed = message_id == 0 and not packet[10 + 6] & _ARMED
                if waiting is not None and killed:
                    client, transfer_id = waiting
                    waiting = None
                    identifier = 2 << 24 | _VEHICLE_SERVICE << 16 | client << 8 | 0x80 | _NODE_ID
                    body = struct.pack("<HI", 0, identifier | 0x80000000)
                    body += bytes((0, 0xC0 | transfer_id))
                    head = struct.pack("<HH", 0x2934, crc16_from_bytes(body))
                    out.sendto(head + body, (_GROUP, bus_port))
                continue
            identifier = struct.unpack_from("<I", packet, 6)[0] & 0x1FFFFFFF
            service = identifier >> 16 & 0xFF, identifier >> 8 & 0x7F, identifier & 0x8080
            data = packet[10:]
            if service != (_VEHICLE_SERVICE, _NODE_ID, 0x8080) or data[4] != _KILLSWITCH:
                continue
            waiting = (identifier & 0x7F, data[-1] & 0x1F)
            if autopilot is not None:
                kill = mavlink.command_long_encode(
                    1, 1, dialect.MAV_CMD_DO_FLIGHTTERMINATION, 0, 1, 0, 0, 0, 0, 0, 0
                )
                network.sendto(kill.pack(mavlink), autopilot)


if __name__ == "__main__":
    main()
