"""The pilot of simulated flights hears the answers to its commands."""

from __future__ import annotations

import contextlib
import socket
import time

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.tools.pilot import Pilot

ARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM


def test_telemetry_that_waited_unread_hides_no_answer() -> None:
    """Given more telemetry than a socket keeps, while the pilot waits for something else."""
    ours, theirs = free_udp_ports(2)
    encoder = FrameEncoder(1, 1)
    with (
        contextlib.closing(Pilot(f"udppair:127.0.0.1:{ours}:127.0.0.1:{theirs}", 1)) as pilot,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as autopilot,
    ):
        autopilot.settimeout(20.0)
        autopilot.bind(("127.0.0.1", theirs))
        pilots = ("127.0.0.1", ours)
        alive = encoder.encode(dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3), 0.0)
        for _ in range(20_000):
            autopilot.sendto(alive, pilots)
        pilot.arm()
        autopilot.recv(1000)
        accepted = encoder.encode(dialect.MAVLink_command_ack_message(ARM, 0), 0.0)
        autopilot.sendto(accepted, pilots)
        until = time.monotonic() + 20.0
        while not pilot.accepted(ARM):
            assert time.monotonic() < until, "the answer is lost"
