"""Recordings of ROS 1 and 2 (.bag, .mcap, .db3, a rosbag2 folder): MAVROS, or a vehicle/state of
this suite, as the autopilot behind them would have told it.

Source: the MAVROS plugins imu, local_position, global_position, altitude, sys_status and
setpoint_raw (REP 103: x forward, y left, z up), chute_msgs/VehicleState; read by rosbags.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.tools.judge_log import told
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError, MessageLog, reason

FORMAT = "ROS recording"
SUFFIXES = (".bag", ".mcap", ".db3")

#: How a topic ends -> what makes of it what an autopilot sends.
_Take = Callable[[Any, float], None]
_NANO = 1e-9
#: Of times by their ages, s.
_ROUNDING = 0.005


def read(path: Path) -> FlightLog:
    """The log of this recording; LogError if it is none."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
        from rosbags.typesys.base import TypesysError
    except ImportError:
        raise LogError(
            f"{path}: a recording of ROS needs the package rosbags: python3 -m pip install rosbags"
        ) from None
    folder = path if path.suffix in (".bag", ".mcap") or path.is_dir() else path.parent
    teller = _Teller()
    try:
        with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            chosen = [one for one in reader.connections if teller.takes(one.topic)]
            for connection, time, raw in reader.messages(connections=chosen):
                try:
                    message = reader.deserialize(raw, connection.msgtype)
                except (KeyError, TypesysError):
                    teller.unknown.add(connection.msgtype)
                    continue
                teller.take(connection.topic, message, time * _NANO)
    except Exception as error:  # noqa: BLE001 - whatever a damaged file makes of its reader
        raise LogError(f"{path}: no recording of ROS that can be read: {reason(error)}") from None
    return teller.log(path)


class _Teller:
    """Makes of each message what an autopilot sends."""

    def __init__(self) -> None:
        self._out = MessageLog()
        self.unknown: set[str] = set()
        self._vehicle_type = dialect.MAV_TYPE_QUADROTOR
        self._autopilot = dialect.MAV_AUTOPILOT_GENERIC
        self._speed = self._altitude = math.nan
        self._where = (math.nan, math.nan)
        self._height_of = ""
        self._armed_told = False
        #: Of VehicleState: part -> when the newest value was measured.
        self._measured: dict[str, float] = {}
        #: The best source of the height comes first.
        self._takers: dict[str, _Take] = {
            "vehicle/state": self._vehicle_state,
            "global_position/rel_alt": lambda m, at: self._height("rel_alt", m.data, at),
            "altitude": lambda m, at: self._height("altitude", m.relative, at),
            "local_position/odom": self._odometry,
            "local_position/pose": lambda m, at: self._height("pose", m.pose.position.z, at),
            "local_position/velocity_local": self._velocity,
            "global_position/global": self._fix,
            "imu/data": self._imu,
            "imu/static_pressure": self._pressure,
            "battery": self._battery,
            "extended_state": self._extended,
            "setpoint_raw/target_attitude": self._target,
            "state": self._state,
        }

    def takes(self, topic: str) -> bool:
        """It says something of the vehicle."""
        return self._taker(topic) is not None

    def take(self, topic: str, message: Any, at: float) -> None:
        """One message, received at (s)."""
        taker = self._taker(topic)
        if taker is not None:
            taker(message, at)

    def log(self, path: Path) -> FlightLog:
        """All of it; LogError: nothing of a vehicle."""
        remarks: list[str] = []
        if not self._armed_told:
            remarks.append("nothing tells when it was armed: taken to be armed throughout")
            beat = told.heartbeat(self._vehicle_type, self._autopilot, True)
            for at in self._out.seconds():
                self._out.add_change(at, beat)
        messages = self._out.in_order(remarks)
        if not any(one.get_type() == "GLOBAL_POSITION_INT" for _, one in messages):
            wants = "vehicle/state, or mavros/global_position/rel_alt, altitude or local_position"
            types = ", ".join(sorted(self.unknown))
            lacking = f"; of these types it has no definition: {types}" if types else ""
            raise LogError(f"{path}: no topic tells a height (need {wants}){lacking}")
        if self.unknown:
            remarks.append(f"without a definition: {', '.join(sorted(self.unknown))}")
        return FlightLog(
            path, FORMAT, self._vehicle_type, self._autopilot, messages, remarks=remarks
        )

    def _taker(self, topic: str) -> _Take | None:
        if topic.endswith(("/safety/state", "/parachute/state")):
            return None
        # MAVROS has a topic `state`, beside which `vehicle/state` is another.
        return next(
            (take for name, take in self._takers.items() if topic.endswith(f"/{name}")), None
        )

    def _height(self, source: str, height: float, at: float) -> None:
        """Of several the first that came."""
        self._height_of = self._height_of or source
        if source == self._height_of and math.isfinite(height):
            speed = self._speed if math.isfinite(self._speed) else 0.0
            self._out.add(at, told.position(height, speed, self._altitude, *self._where))

    def _odometry(self, message: Any, at: float) -> None:
        pose, twist = message.pose.pose, message.twist.twist.linear
        # The twist is in the axes of the body: its vertical part is turned back.
        q = pose.orientation
        up = (
            2.0 * (q.x * q.z - q.w * q.y),
            2.0 * (q.y * q.z + q.w * q.x),
            1.0 - 2.0 * (q.x**2 + q.y**2),
        )
        self._speed = up[0] * twist.x + up[1] * twist.y + up[2] * twist.z
        self._height("odom", pose.position.z, at)

    def _velocity(self, message: Any, at: float) -> None:
        self._speed = message.twist.linear.z

    def _fix(self, message: Any, at: float) -> None:
        self._altitude = message.altitude
        self._where = (message.latitude, message.longitude)

    def _imu(self, message: Any, at: float) -> None:
        q, force = message.orientation, message.linear_acceleration
        roll, pitch, yaw = told.angles_of(q.w, q.x, q.y, q.z)
        self._out.add(at, told.attitude(roll, -pitch, math.pi / 2.0 - yaw))
        self._out.add(at, told.acceleration(0, force.x, -force.y, -force.z))

    def _pressure(self, message: Any, at: float) -> None:
        self._out.add(at, told.pressure(message.fluid_pressure))

    def _battery(self, message: Any, at: float) -> None:
        self._out.add(at, told.battery(message.voltage, message.percentage))

    def _state(self, message: Any, at: float) -> None:
        if hasattr(message, "armed"):
            self._armed(message.armed, at)

    def _extended(self, message: Any, at: float) -> None:
        if message.landed_state:
            self._out.add(at, told.landed(message.landed_state == dialect.MAV_LANDED_STATE_IN_AIR))

    def _target(self, message: Any, at: float) -> None:
        q = message.orientation
        roll, pitch, yaw = told.angles_of(q.w, q.x, q.y, q.z)
        turned = told.quaternion_of(roll, -pitch, math.pi / 2.0 - yaw)
        self._out.add(at, told.attitude_target(turned, message.thrust))

    def _armed(self, armed: bool, at: float) -> None:
        self._armed_told = True
        self._out.add(at, told.heartbeat(self._vehicle_type, self._autopilot, armed))

    def _vehicle_state(self, message: Any, at: float) -> None:
        """Of this suite: what was measured since the message before."""
        one = message
        if self._is_new("armed", one.armed_age, at) and one.armed:
            self._armed(one.armed == one.ARMED, at)
        if self._is_new("landed", one.landed_state_age, at) and one.landed_state:
            self._out.add(at, told.landed(one.landed_state == one.IN_AIR))
        if self._is_new("speed", one.vertical_speed_age, at):
            self._speed = one.vertical_speed
        if self._is_new("altitude", one.altitude_age, at):
            self._altitude = one.altitude
        if self._is_new("position", one.position_age, at):
            self._where = (one.latitude, one.longitude)
        if self._is_new("height", one.height_age, at):
            self._height("vehicle/state", one.height, at)
        if self._is_new("attitude", one.attitude_age, at):
            angles = (one.roll, one.pitch, one.yaw)
            # A source may tell its tilt alone.
            if not all(map(math.isfinite, angles)):
                angles = (one.tilt, 0.0, 0.0)
            self._out.add(at, told.attitude(*angles))
        if self._is_new("pressure", one.pressure_age, at):
            self._out.add(at, told.pressure(one.pressure))
        if self._is_new("acceleration", one.acceleration_age, at):
            self._out.add(at, told.acceleration(0, 0.0, 0.0, -one.acceleration))
        if self._is_new("battery", one.battery_age, at):
            self._out.add(at, told.battery(one.battery_voltage, one.battery_remaining))

    def _is_new(self, part: str, age: float, at: float) -> bool:
        """age: s; below 0: never measured."""
        measured = at - age
        # Ages are rounded to 32 bits.
        if age < 0.0 or not measured > self._measured.get(part, -math.inf) + _ROUNDING:
            return False
        self._measured[part] = measured
        return True
