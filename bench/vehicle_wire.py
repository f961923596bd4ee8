"""The vehicle's own MAVLink network, in the measuring process: autopilot and parachute.

A thread reads one socket; the simulated devices answer, and what matters is put down with the time
at which the kernel had it: when this process gets the processor is not the nodes' matter.
"""

from __future__ import annotations

import select
import socket
import struct
import threading
import time
from collections.abc import Callable

from bench.flood import attitude
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.model import DeploymentTrigger
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.sim.autopilot_device import AutopilotDevice

#: What the two devices send by themselves once they are asked for measurements, frames a second.
NOMINAL_RATE = 65.0
#: SO_TIMESTAMPNS, also the type of its control message (asm-generic/socket.h): a struct timespec
#: of the wall clock. Python has no name for it.
_TIMESTAMPNS, _TIMESPEC = 35, struct.Struct("@qq")

#: In the text of a flight block.
_BLOCKED = "flight blocked"


class VehicleWire:
    """Talks to the node that listens on port."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, _TIMESTAMPNS, 1)
        self._node = ("127.0.0.1", port)
        self._autopilot = AutopilotDevice(1, [])
        self._parachute = ParachuteDevice(ParachuteSettings(), [])
        self._decoder = FrameDecoder()
        self._encoder = FrameEncoder(1, 1)
        self._text = ""
        self._flood_interval = 0.0
        self._flood_at = 0.0
        self._stopping = False
        self._calls: list[Callable[[], None]] = []
        #: perf_counter_ns of each frame that fires the parachute, and of each blocked flight.
        self.releases: list[int] = []
        self.blocks: list[int] = []
        #: Frames that the devices sent by themselves.
        self.said = 0
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Both devices are there from now on."""
        self._thread.start()

    def close(self) -> None:
        """Both are gone."""
        self._stopping = True
        self._thread.join()
        self._socket.close()

    def flood(self, times: float) -> None:
        """Send attitudes besides, so many times as much as the devices say; 0: no more."""
        self._flood_interval = 1.0 / (NOMINAL_RATE * times) if times else 0.0

    def pack(self) -> None:
        """The parachute is as new, the autopilot as if started anew."""

        def anew() -> None:
            self._parachute.deployment = DeploymentTrigger.NONE
            self._parachute.reboot()
            self._autopilot.terminated = False

        self._calls.append(anew)

    def _run(self) -> None:
        while not self._stopping:
            now = time.monotonic()
            while self._calls:
                self._calls.pop()()
            for device in (self._autopilot, self._parachute):
                device.update(now)
                for data in device.take_output():
                    self._socket.sendto(data, self._node)
                    self.said += 1
            self._add_to_flood(now)
            deadlines = [self._autopilot.next_deadline(), self._parachute.next_deadline()]
            deadlines += [self._flood_at] if self._flood_interval else []
            wait = max(0.0, min(min(deadlines) - now, 0.05))
            if select.select([self._socket], [], [], wait)[0]:
                self._hear()

    def _add_to_flood(self, now: float) -> None:
        if not self._flood_interval:
            self._flood_at = now
            return
        while self._flood_at <= now:
            self._flood_at += self._flood_interval
            self._socket.sendto(self._encoder.encode(attitude(now), now), self._node)

    def _hear(self) -> None:
        data, control, _, _ = self._socket.recvmsg(2048, socket.CMSG_SPACE(_TIMESPEC.size))
        now = time.monotonic()
        for frame in self._decoder.feed_datagram(data, now):
            self._note(frame.message, _came_at(control))
        for device in (self._autopilot, self._parachute):
            device.receive(data, now)

    def _note(self, message: dialect.MAVLink_message, at: int) -> None:
        kind = message.get_type()
        if kind == "STATUSTEXT":
            # The reason comes first, so that the word may be in a later chunk.
            before = self._text if message.chunk_seq else ""
            self._text = before + message.text
            if _BLOCKED in self._text and _BLOCKED not in before:
                self.blocks.append(at)
        if kind == "COMMAND_LONG" and message.command == dialect.MAV_CMD_DO_PARACHUTE:
            self.releases.append(at)


def _came_at(control: list[tuple[int, int, bytes]]) -> int:
    """perf_counter_ns at which the kernel had the datagram. control: its control messages."""
    (stamp,) = (data for _, kind, data in control if kind == _TIMESTAMPNS)
    seconds, nanoseconds = _TIMESPEC.unpack(stamp)
    wall_ahead = time.time_ns() - time.perf_counter_ns()
    return int(seconds) * 1_000_000_000 + int(nanoseconds) - wall_ahead
