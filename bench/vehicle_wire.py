"""The vehicle's own MAVLink network, in the measuring process: autopilot and parachute.

A thread reads one socket; the simulated devices answer, and what matters is put down with its
time.
"""

from __future__ import annotations

import select
import threading
import time
from collections.abc import Callable

from bench.flood import attitude
from chute_ros.model import DeploymentTrigger
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.sim.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.transport.address import parse_address
from chute_ros.transport.udp import UdpWire

#: What the two devices send by themselves once they are asked for measurements, frames a second.
NOMINAL_RATE = 65.0


class VehicleWire:
    """Talks to the node that listens on port."""

    def __init__(self, port: int) -> None:
        self._wire = UdpWire(parse_address(f"udpout:127.0.0.1:{port}"))
        self._wire.open()
        self._autopilot = AutopilotDevice(1, [])
        self._parachute = ParachuteDevice(ParachuteSettings(), [])
        self._decoder = FrameDecoder()
        self._encoder = FrameEncoder(1, 1)
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
        self._wire.close()

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
                    self._wire.write(data)
                    self.said += 1
            self._add_to_flood(now)
            deadlines = [self._autopilot.next_deadline(), self._parachute.next_deadline()]
            deadlines += [self._flood_at] if self._flood_interval else []
            wait = max(0.0, min(min(deadlines) - now, 0.05))
            if select.select(self._wire.files(), [], [], wait)[0]:
                self._hear()

    def _add_to_flood(self, now: float) -> None:
        if not self._flood_interval:
            self._flood_at = now
            return
        while self._flood_at <= now:
            self._flood_at += self._flood_interval
            self._wire.write(self._encoder.encode(attitude(now), now))

    def _hear(self) -> None:
        for file in self._wire.files():
            for data, _ in self._wire.read(file):
                # Before anything is decoded: what that takes here is not the nodes'.
                at, now = time.perf_counter_ns(), time.monotonic()
                for frame in self._decoder.feed_datagram(data, now):
                    self._note(frame.message, at)
                for device in (self._autopilot, self._parachute):
                    device.receive(data, now)

    def _note(self, message: dialect.MAVLink_message, at: int) -> None:
        kind = message.get_type()
        if kind == "STATUSTEXT" and "flight blocked" in str(message.text):
            self.blocks.append(at)
        if kind == "COMMAND_LONG" and message.command == dialect.MAV_CMD_DO_PARACHUTE:
            self.releases.append(at)
