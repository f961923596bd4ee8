"""How a simulated UPF feels the simulated vehicle, and how the vehicle feels its canopy.

A real controller has sensors of its own. Here it asks the simulated autopilot, over a MAVLink wire
that only the two share, and tells it when the canopy is out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from chute_ros.model import DeploymentTrigger
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame
from chute_ros.protocol.rotation import tilt_of
from chute_ros.sim.mavlink_device import MavlinkDevice
from chute_ros.sim.motion import Motion
from chute_ros.transport.address import parse_address
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire import make_wire

_COMPONENT_ID = 192  # MAV_COMP_ID_ONBOARD_COMPUTER2
_AUTOPILOT = 1
#: How often what is felt is asked for, s; silence after which it is asked again, s.
_INTERVAL, _SILENCE = 0.05, 1.0
_FELT = (
    dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    dialect.MAVLINK_MSG_ID_ATTITUDE,
    dialect.MAVLINK_MSG_ID_SCALED_IMU,
)
_MILLI_G = 9.80665e-3


class VehicleSense(MavlinkDevice):
    """felt: gets the motion; released: says whether the canopy is out."""

    def __init__(
        self, system_id: int, felt: Callable[[Motion], None], released: Callable[[], bool]
    ) -> None:
        super().__init__(system_id, _COMPONENT_ID, [])
        self._felt, self._released = felt, released
        self._motion = Motion()
        self._heard = -math.inf
        self._asked = -math.inf
        self.streams = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS: self._status,
        }
        self.default_intervals = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
            dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS: 0.05,
        }

    def step(self, now: float) -> None:
        """Ask for what is not told often enough."""
        if now - self._heard > _SILENCE and now - self._asked > _SILENCE:
            self._asked = now
            for message_id in _FELT:
                number, interval_us = dialect.MAV_CMD_SET_MESSAGE_INTERVAL, _INTERVAL * 1e6
                self.send(
                    dialect.MAVLink_command_long_message(
                        *(self.system_id, _AUTOPILOT, number, 0),
                        *(float(message_id), interval_us, 0.0, 0.0, 0.0, 0.0, 0.0),
                    )
                )

    def heard(self, frame: Frame) -> None:
        """The autopilot tells how the vehicle moves."""
        message = frame.message
        if frame.system_id != self.system_id or frame.component_id != _AUTOPILOT:
            return
        kind = message.get_type()
        if kind == "GLOBAL_POSITION_INT":
            told = {"height": message.relative_alt / 1000.0, "vertical_speed": -message.vz / 100.0}
        elif kind == "ATTITUDE":
            self._heard = self.now
            told = {"tilt": tilt_of(message.roll, message.pitch)}
        elif kind == "SCALED_IMU":
            length = math.hypot(message.xacc, message.yacc, message.zacc)
            told = {"acceleration": length * _MILLI_G}
        else:
            return
        self._motion = replace(self._motion, **told)
        self._felt(self._motion)

    def _heartbeat(self) -> object:
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
        )

    def _status(self) -> object:
        trigger = DeploymentTrigger.ATS if self._released() else DeploymentTrigger.NONE
        return dialect.MAVLink_parachute_status_message(
            self.boot_ms(), 0, 0, int(trigger), 0, 0, b""
        )


@contextmanager
def sensing(
    address: str,
    system_id: int,
    felt: Callable[[Motion], None],
    released: Callable[[], bool],
) -> Iterator[None]:
    """A VehicleSense at work over the wire of this address."""
    device = VehicleSense(system_id, felt, released)
    loop = WireLoop(device, make_wire(parse_address(address)), lambda events: None)
    loop.start()
    try:
        yield
    finally:
        loop.stop()
