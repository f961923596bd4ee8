"""An autopilot's messages to the parts of the vehicle's picture.

Source: MAVLink common.xml: EXTENDED_SYS_STATE, GLOBAL_POSITION_INT, LOCAL_POSITION_NED, ALTITUDE,
ATTITUDE, ATTITUDE_QUATERNION, SYS_STATUS; of sensors and targets see sensors.py and targets.py.
A value that is not finite, or that the message marks as unknown, is not taken over: the reading
before it goes on ageing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from chute_ros.links.mavlink.protocol.readings import Readings
from chute_ros.links.mavlink.protocol.sensors import Accelerometers, Barometers
from chute_ros.links.mavlink.protocol.targets import Targets, vertical_axis
from chute_ros.model import LandedState
from chute_ros.protocol.boot_clock import BootClock
from chute_ros.protocol.rotation import angles_of

#: ALTITUDE's altitude differs from GLOBAL_POSITION_INT's: it counts where that is silent, s.
_POSITION_SILENCE = 1.0

Reader = Callable[[Any, float], None]


class VehicleReaders:
    """Reads each message into readings; clock: of the autopilot, to tell what is old."""

    def __init__(self, readings: Readings, clock: BootClock) -> None:
        self.targets = Targets(readings)
        self._readings = readings
        self._clock = clock
        self._barometers = Barometers(readings)
        self._accelerometers = Accelerometers(readings)
        self._readers: dict[str, Reader] = {
            "EXTENDED_SYS_STATE": self._extended_sys_state,
            "GLOBAL_POSITION_INT": self._global_position_int,
            "LOCAL_POSITION_NED": self._local_position_ned,
            "ALTITUDE": self._altitude,
            "ATTITUDE": self._attitude,
            "ATTITUDE_QUATERNION": self._attitude_quaternion,
            "SCALED_IMU": self._accelerometers.scaled_imu,
            "SCALED_IMU2": self._accelerometers.scaled_imu,
            "SCALED_IMU3": self._accelerometers.scaled_imu,
            "HIGHRES_IMU": self._highres_imu,
            "SCALED_PRESSURE": self._barometers.scaled_pressure,
            "SCALED_PRESSURE2": self._barometers.scaled_pressure,
            "SCALED_PRESSURE3": self._barometers.scaled_pressure,
            "SYS_STATUS": self._sys_status,
            "ATTITUDE_TARGET": self._attitude_target,
            "POSITION_TARGET_LOCAL_NED": self.targets.position_target_local_ned,
            "POSITION_TARGET_GLOBAL_INT": self.targets.position_target_global_int,
            "NAV_CONTROLLER_OUTPUT": self.targets.nav_controller_output,
        }

    def read(self, message: Any, now: float) -> bool:
        """Take what the message says; False: nothing that is read here."""
        reader = self._readers.get(message.get_type())
        if reader is None:
            return False
        reader(message, now)
        return True

    def _extended_sys_state(self, message: Any, now: float) -> None:
        if LandedState.UNKNOWN < message.landed_state <= max(LandedState):
            self._readings.set("landed_state", message.landed_state, now)
        self._readings.set("vtol_state", message.vtol_state, now)

    def _global_position_int(self, message: Any, now: float) -> None:
        self._readings.set("height", message.relative_alt / 1000.0, now)
        self._readings.set("vertical_speed", -message.vz / 100.0, now)
        latitude, longitude = message.lat / 1e7, message.lon / 1e7
        # 0, 0 is what autopilots send before they know; their altitude is 0 as well then.
        known = (latitude, longitude) != (0.0, 0.0)
        if known and abs(latitude) <= 90.0 and abs(longitude) <= 180.0:
            self._readings.set("latitude", latitude, now)
            self._readings.set("longitude", longitude, now)
            self._readings.set("altitude", message.alt / 1000.0, now)

    def _local_position_ned(self, message: Any, now: float) -> None:
        # Its origin may not be the take-off point: only targets from the same origin are set
        # against it.
        self._readings.set("vertical_speed", -message.vz, now)
        self._readings.set("above_origin", -message.z, now)

    def _altitude(self, message: Any, now: float) -> None:
        self._readings.set("height", message.altitude_relative, now)
        if not self._readings.age("latitude", now) <= _POSITION_SILENCE:
            self._readings.set("altitude", message.altitude_amsl, now)

    def _attitude(self, message: Any, now: float) -> None:
        if all(map(math.isfinite, (message.roll, message.pitch, message.yaw))):
            self._turned(message.roll, message.pitch, message.yaw, now)

    def _attitude_quaternion(self, message: Any, now: float) -> None:
        w, x, y, z = message.q1, message.q2, message.q3, message.q4
        length = math.sqrt(w * w + x * x + y * y + z * z)
        if not 0.5 < length < 2.0:
            return
        self._turned(*angles_of(w / length, x / length, y / length, z / length), now)

    def _turned(self, roll: float, pitch: float, yaw: float, now: float) -> None:
        if self.targets.lies_on_its_wing(now):
            return
        self._readings.set("roll", roll, now)
        self._readings.set("pitch", pitch, now)
        self._readings.set("yaw", yaw, now)
        axis = vertical_axis(roll, pitch, yaw)
        self._readings.set("tilt", math.acos(max(-1.0, min(1.0, axis[2]))), now)
        self.targets.attitude(axis, now)

    def _highres_imu(self, message: Any, now: float) -> None:
        self._accelerometers.highres_imu(message, now)
        self._barometers.highres_imu(message, now)

    def _sys_status(self, message: Any, now: float) -> None:
        if message.voltage_battery != 0xFFFF:
            self._readings.set("battery_voltage", message.voltage_battery / 1000.0, now)
        if 0 <= message.battery_remaining <= 100:
            self._readings.set("battery_remaining", message.battery_remaining / 100.0, now)

    def _attitude_target(self, message: Any, now: float) -> None:
        self.targets.attitude_target(message, self._clock.newest, now)
