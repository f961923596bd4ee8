"""The two ends that are timed: a UPF controller on the bus, an autopilot on the network.

Both are in the measuring process and speak through sockets; what is between them is measured.
"""

from __future__ import annotations

import select
import time
from dataclasses import dataclass

from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.dronecan.transfer import Kind
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.protocol.upf.definitions import PARACHUTE_STATUS, VEHICLE_SERVICE, Definitions
from chute_ros.transport.address import parse_address
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_multicast import CanMulticastWire
from chute_ros.transport.udp import UdpWire

#: The node id of the controller, and of the vehicle that it asks.
CONTROLLER, VEHICLE = 33, 10
#: How often both ends say how they are, s.
_INTERVAL = 0.05


class RoundFailedError(Exception):
    """A round did not go as it must. The text says how."""


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
        self._endpoint = Endpoint(definitions.types, CONTROLLER)
        self._encoder = FrameEncoder(1, 1)
        self._decoder = FrameDecoder()
        self._armed = True
        self._said = 0.0
        self._transfer_id = 0
        self._started = time.monotonic()
        self.kills = 0

    def close(self) -> None:
        """Close both sockets."""
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

    def rest(self, seconds: float) -> None:
        """The autopilot is armed again; wait, and go on saying so."""
        self._armed = True
        end = time.monotonic() + seconds
        self._heartbeat()
        while time.monotonic() < end:
            self.say()
            self._wait(0.01)
            self._hear()

    def kill_switch(self, timeout: float) -> Round:
        """Ask for it, and see the kill leave and the answer come."""
        self._transfer_id = (self._transfer_id + 1) % 32
        values = self._definitions.request(VEHICLE_SERVICE, "TYPE_KILLSWITCH")
        self._endpoint.request(VEHICLE, VEHICLE_SERVICE, self._transfer_id, values, 2)
        before = self.kills
        start = time.perf_counter_ns()
        self._send_bus()
        killed = 0
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            self.say()
            self._wait(0.01)
            answer = self._hear()
            if self.kills > before and not killed:
                killed = self._killed_at
            if answer:
                result, at = answer
                if not killed:
                    raise RoundFailedError("answered before the kill left")
                if result != "SUCCESS":
                    raise RoundFailedError(f"answered {result}")
                return Round((killed - start) / 1e6, (at - start) / 1e6)
        seen = "the kill left, but no answer came" if killed else "no kill left"
        raise RoundFailedError(f"{seen} within {timeout:g} s")

    # -- inside ---------------------------------------------------------------------------------

    _killed_at = 0

    def _wait(self, seconds: float) -> None:
        files = [*self._bus.files(), *self._network.files()]
        select.select(files, [], [], seconds)

    def _hear(self) -> tuple[str, int] | None:
        """Take in what came: obey a kill; (result, time) of an answer to the kill switch."""
        now = time.monotonic()
        for file in self._network.files():
            for data, _ in self._network.read(file):
                for frame in self._decoder.feed_datagram(data, now):
                    self._command(frame.message)
        found = None
        for file in self._bus.files():
            for data, _ in self._bus.read(file):
                heard = self._endpoint.receive(data, now)
                if heard is None or heard.kind is not Kind.RESPONSE:
                    continue
                if (heard.name, heard.transfer_id) == (VEHICLE_SERVICE, self._transfer_id):
                    at = time.perf_counter_ns()
                    found = (self._definitions.result_name(VEHICLE_SERVICE, heard.values), at)
        return found

    def _command(self, message: object) -> None:
        if message.get_type() != "COMMAND_LONG":  # type: ignore[attr-defined]
            return
        number = message.command  # type: ignore[attr-defined]
        if number == dialect.MAV_CMD_DO_FLIGHTTERMINATION:
            self._killed_at = time.perf_counter_ns()
            self.kills += 1
            self._armed = False
        self._send(dialect.MAVLink_command_ack_message(number, dialect.MAV_RESULT_ACCEPTED))
        if not self._armed:
            self._heartbeat()

    def _heartbeat(self) -> None:
        armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if self._armed else 0
        quadrotor, autopilot = dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_PX4
        self._send(dialect.MAVLink_heartbeat_message(quadrotor, autopilot, armed, 0, 4, 3))

    def _send(self, message: object) -> None:
        self._network.write(self._encoder.encode(message, time.monotonic()))

    def _send_bus(self) -> None:
        for frame in self._endpoint.take_output():
            self._bus.write(frame)
