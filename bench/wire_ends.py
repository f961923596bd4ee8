"""The two ends that are timed: a UPF controller on the bus, an autopilot on the network.

Both are in the measuring process and speak through sockets; what is between them is measured.
"""

from __future__ import annotations

import select
import time
from dataclasses import dataclass
from typing import Any

from bench.flood import Flood
from chute_ros.errors import ChuteError
from chute_ros.links.upf.protocol.definitions import PARACHUTE_STATUS, VEHICLE_SERVICE, Definitions
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.dronecan.transfer import TransferKind
from chute_ros.protocol.mavlink.dialect import FORCE_DISARM, dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.transport.address import parse_address
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_multicast import CanMulticastWire
from chute_ros.transport.udp import UdpWire

#: The node id of the controller, and of the vehicle that it asks.
CONTROLLER, VEHICLE = 33, 100
#: How often both ends say how they are, s.
_INTERVAL = 0.05
#: What both ends say by themselves, frames a second on either wire.
NOMINAL_RATE = 2.0 / _INTERVAL
#: Between the newest of that and a kill switch, s: it must not stand in the way.
_QUIET = 0.02


class RoundFailedError(ChuteError):
    """A round did not go as it must. The text says how."""


class WrongOrderError(RoundFailedError):
    """The answer came, but not after the kill: that is no matter of time."""


@dataclass(frozen=True)
class Round:
    """One kill switch, ms from its frame being written."""

    kill: float
    answer: float


class WireEnds:
    """Controller and autopilot around one peer: its bus is mcast:0:bus_port, its MAVLink socket
    listens on mavlink_port."""

    def __init__(self, definitions: Definitions, bus_port: int, mavlink_port: int) -> None:
        self._definitions = definitions
        self._bus = CanMulticastWire(parse_can_address(f"mcast:0:{bus_port}"))
        self._network = UdpWire(parse_address(f"udpout:127.0.0.1:{mavlink_port}"))
        self._bus.open()
        self._network.open()
        (network,) = self._network.files()
        #: Frames besides, on both wires.
        self.flood = Flood(network, mavlink_port, bus_port)
        self._endpoint = Endpoint(definitions.types, CONTROLLER)
        self._encoder = FrameEncoder(1, 1)
        self._decoder = FrameDecoder()
        self._armed = True
        self._killed_at = 0
        self._said = 0.0
        self._transfer_id = 0
        self._started = time.monotonic()
        #: How many came.
        self.kills = 0

    def close(self) -> None:
        """Close both sockets."""
        self.flood.close()
        self._bus.close()
        self._network.close()

    def say(self) -> None:
        """Status of both ends, when it is time."""
        now = time.monotonic()
        if now - self._said < _INTERVAL:
            return
        self._said = now
        state = self._definitions.types.message(PARACHUTE_STATUS).constants["STATE_ARMED"]
        uptime = int(now - self._started)
        self._endpoint.broadcast("uavcan.protocol.NodeStatus", {"uptime_sec": uptime})
        self._endpoint.broadcast(PARACHUTE_STATUS, {"state": state, "is_vehicle_connected": True})
        self._send_bus()
        self._heartbeat()
        landed = dialect.MAV_LANDED_STATE_IN_AIR
        self._send(dialect.MAVLink_extended_sys_state_message(0, landed))

    def arm(self) -> None:
        """The autopilot is armed again, and says so."""
        self._armed = True
        self._heartbeat()

    def listen(self, seconds: float) -> None:
        """Take in what comes, and say how both ends are when it is time."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self.say()
            self._hear(left)

    def kill_switch(self, timeout: float) -> Round:
        """Ask for it, and see the kill leave and the answer come."""
        # What is still on its way belongs to the round before.
        self.listen(0.001)
        self.arm()
        self._said = 0.0
        self.listen(_QUIET)
        self._transfer_id = (self._transfer_id + 1) % 32
        values = self._definitions.request(VEHICLE_SERVICE, "TYPE_KILLSWITCH")
        self._endpoint.request(VEHICLE, VEHICLE_SERVICE, self._transfer_id, values, 2)
        before, self._armed = self.kills, True
        end = time.monotonic() + timeout
        start = time.perf_counter_ns()
        self._send_bus()
        killed = 0
        while (now := time.monotonic()) < end:
            if now - self._said > 10 * _INTERVAL:
                self.say()
            answer = self._hear(0.05)
            if self.kills > before and not killed:
                killed = self._killed_at
            if answer:
                result, at = answer
                if result != "SUCCESS":
                    raise RoundFailedError(f"answered {result}")
                if not killed or at <= killed:
                    raise WrongOrderError("answered SUCCESS before the kill came")
                return Round((killed - start) / 1e6, (at - start) / 1e6)
        seen = "the kill came, but no answer" if killed else "no kill came"
        raise RoundFailedError(f"{seen} within {timeout:g} s")

    # -- inside ---------------------------------------------------------------------------------

    def _hear(self, seconds: float) -> tuple[str, int] | None:
        """Wait, and take in what came: obey a kill; (result, time) of an answer."""
        network, bus = self._network.files(), self._bus.files()
        ready = select.select([*network, *bus], [], [], seconds)[0]
        now = time.monotonic()
        for file in ready:
            if file in network:
                datagrams = self._network.read(file)
                # Before anything is decoded: what that takes here is not the peer's.
                at = time.perf_counter_ns()
                for data, _ in datagrams:
                    for frame in self._decoder.feed_datagram(data, now):
                        self._command(frame.message, at)
        found = None
        for file in ready:
            if file in bus:
                # Own packets wake us as well, so that the answer may come on the heels of a kill.
                packets = self._bus.read(file)
                at = time.perf_counter_ns()
                for data, _ in packets:
                    heard = self._endpoint.receive(data, now)
                    if heard is None or heard.kind is not TransferKind.RESPONSE:
                        continue
                    if (heard.name, heard.transfer_id) == (VEHICLE_SERVICE, self._transfer_id):
                        result = self._definitions.result_name(VEHICLE_SERVICE, heard.values)
                        found = (result, at)
        return found

    def _command(self, message: Any, at: int) -> None:
        if message.get_type() != "COMMAND_LONG":
            return
        disarms = message.command == dialect.MAV_CMD_COMPONENT_ARM_DISARM
        if disarms and message.param2 == FORCE_DISARM:
            if self._armed:
                self._killed_at = at
            self.kills += 1
            self._armed = False
        accepted = dialect.MAV_RESULT_ACCEPTED
        self._send(dialect.MAVLink_command_ack_message(message.command, accepted))
        if not self._armed:
            self._heartbeat()

    def _heartbeat(self) -> None:
        armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if self._armed else 0
        quadrotor, autopilot = dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_PX4
        self._send(dialect.MAVLink_heartbeat_message(quadrotor, autopilot, armed, 0, 4, 3))

    def _send(self, message: Any) -> None:
        self._network.write(self._encoder.encode(message, time.monotonic()))

    def _send_bus(self) -> None:
        for frame in self._endpoint.take_output():
            self._bus.write(frame)
