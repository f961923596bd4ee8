"""What autopilots tell besides a position and an attitude: altitude, pressure, a second
accelerometer, home, and what the vehicle was told to do.

Source: MAVLink common.xml. What has an origin of its own comes from the flight model, what belongs
to the estimator from the position that is told: whoever changes that changes all of it.
"""

from __future__ import annotations

import math
import random
from abc import abstractmethod
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.air import air_at
from chute_ros.sim.flight import GRAVITY, FlightModel
from chute_ros.sim.home import Home
from chute_ros.sim.mavlink_device import MavlinkDevice

HOME_LATITUDE, HOME_LONGITUDE = 474000000, 85000000  # degrees * 1e7
#: Noise of a barometer that is whole, standard deviation, m.
_PRESSURE_NOISE = 0.3
#: POSITION_TARGET_TYPEMASK: all is ignored but z and vz.
_HEIGHT_AND_SPEED = 0b1101_1101_1011
#: ATTITUDE_TARGET_TYPEMASK: the rates are ignored.
_ATTITUDE_ONLY = 0b111


class AutopilotTelemetry(MavlinkDevice):
    """model: what flies; home: where its heights begin."""

    def __init__(
        self, system_id: int, script: list[tuple[float, str]], model: FlightModel
    ) -> None:
        super().__init__(system_id, 1, script)
        self.model, self.home = model, Home()
        self._pressure_chance = random.Random(system_id)
        self.streams |= {
            dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position_ned,
            dialect.MAVLINK_MSG_ID_SCALED_PRESSURE: self._scaled_pressure,
            dialect.MAVLINK_MSG_ID_ATTITUDE_TARGET: self._attitude_target,
            dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self._position_target,
            dialect.MAVLINK_MSG_ID_HOME_POSITION: self._home_position,
        }
        # Only on request, as many autopilots are delivered.
        self.default_intervals |= dict.fromkeys(self.streams, math.inf)

    def add_second_imu(self) -> None:
        """It has another accelerometer, and tells of that as well."""
        self.streams[dialect.MAVLINK_MSG_ID_SCALED_IMU2] = self._scaled_imu2
        self.default_intervals[dialect.MAVLINK_MSG_ID_SCALED_IMU2] = math.inf

    def tell_targets_of_a_wing(self) -> None:
        """As ArduPlane does, in place of attitude and position targets."""
        for target in (
            dialect.MAVLINK_MSG_ID_ATTITUDE_TARGET,
            dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        ):
            del self.streams[target], self.default_intervals[target]
        wing = dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT
        self.streams[wing] = self._nav_controller_output
        self.default_intervals[wing] = math.inf

    @abstractmethod
    def _global_position_int(self) -> Any:
        """What the estimator says of height and speed."""

    def _pressure_height(self) -> float:
        """What the barometer feels, m above take-off."""
        return self.model.height + self._pressure_chance.gauss(0.0, _PRESSURE_NOISE)

    def _second_force(self) -> float:
        """What the second accelerometer feels, m/s^2."""
        return self.model.acceleration

    def _height_error(self) -> float:
        """By how much what was told of the height just now is too low, as far as the controller
        sees it, m."""
        return 0.0

    def _told_height(self) -> tuple[float, float]:
        """As told just now: m above take-off, m/s up."""
        position = self._global_position_int()
        return position.relative_alt / 1000.0 + self.home.offset, position.vz / -100.0

    def _local_position_ned(self) -> Any:
        height, speed = self._told_height()
        return dialect.MAVLink_local_position_ned_message(
            self.boot_ms(), 0.0, 0.0, -height, 0.0, 0.0, -speed
        )

    def _scaled_pressure(self) -> Any:
        altitude = self.home.altitude + self._pressure_height()
        pressure = math.nan if math.isnan(altitude) else air_at(altitude).pressure
        return dialect.MAVLink_scaled_pressure_message(self.boot_ms(), pressure / 100.0, 0.0, 2500)

    def _scaled_imu2(self) -> Any:
        milli_g = min(int(abs(self._second_force()) / GRAVITY * 1000.0), 32767)
        return dialect.MAVLink_scaled_imu2_message(
            self.boot_ms(), 0, 0, -milli_g, 0, 0, 0, 0, 0, 0
        )

    def _commanded_roll(self) -> float:
        """rad; what is out of control was last told to be upright."""
        return self.model.roll if self.model.controlled else 0.0

    def _commanded_height(self) -> float:
        """m above take-off; of what does as it is told, that is what it does."""
        if self.model.controlled or self.model.on_ground:
            return self._told_height()[0] + self._height_error()
        return self.model.target_height

    def _controlled_height(self) -> float:
        """Where its controller takes itself to be, m above take-off."""
        return self._told_height()[0]

    def _nav_controller_output(self) -> Any:
        too_low = self._commanded_height() - self._controlled_height()
        return dialect.MAVLink_nav_controller_output_message(
            math.degrees(self._commanded_roll()), 0.0, 0, 0, 0, too_low, 0.0, 0.0
        )

    def _attitude_target(self) -> Any:
        roll = self._commanded_roll()
        # A controller that cannot hold it gives all that it has.
        thrust = 1.0 if self.model.armed and self.model.motors_failed else 0.5
        turned = [math.cos(roll / 2.0), math.sin(roll / 2.0), 0.0, 0.0]
        return dialect.MAVLink_attitude_target_message(
            self.boot_ms(), _ATTITUDE_ONLY, turned, 0.0, 0.0, 0.0, thrust
        )

    def _position_target(self) -> Any:
        model, height = self.model, self._commanded_height()
        speed = model.vertical_speed if model.controlled or model.on_ground else 0.0
        return dialect.MAVLink_position_target_local_ned_message(
            *(self.boot_ms(), dialect.MAV_FRAME_LOCAL_NED, _HEIGHT_AND_SPEED),
            *(0.0, 0.0, -height, 0.0, 0.0, -speed, 0.0, 0.0, 0.0, 0.0, 0.0),
        )

    def _home_position(self) -> Any:
        home = self.home
        home.follow(self.model, self.now)
        return dialect.MAVLink_home_position_message(
            *(HOME_LATITUDE, HOME_LONGITUDE, int((home.altitude + home.offset) * 1000.0)),
            *(0.0, 0.0, -home.offset, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0),
        )
