"""An autopilot's barometers and accelerometers: one pressure of several, one force of several.

Source: MAVLink common.xml; ArduPilot 4.7.0-dev and PX4 main of 2026-08 for which sensor a message
carries. SCALED_IMU, SCALED_IMU2 and SCALED_IMU3 are three sensors, in a fixed order. HIGHRES_IMU
is the one that the estimator flies on, so one of these again; RAW_IMU is the first again, in units
that differ between autopilots, and is not read.
"""

from __future__ import annotations

import math
from typing import Any

from chute_ros.links.mavlink.protocol.readings import Readings
from chute_ros.model import Reading
from chute_ros.protocol.mavlink.dialect import dialect

#: The messages of sensors that are asked for besides SCALED_IMU: message id -> name.
PRESSURE = {dialect.MAVLINK_MSG_ID_SCALED_PRESSURE: "SCALED_PRESSURE"}
FURTHER_ACCELEROMETERS = {
    dialect.MAVLINK_MSG_ID_SCALED_IMU2: "SCALED_IMU2",
    dialect.MAVLINK_MSG_ID_SCALED_IMU3: "SCALED_IMU3",
}
STANDARD_GRAVITY = 9.80665  # m/s^2
#: Pa in a hPa.
_HPA = 100.0
#: hPa: outside of this no vehicle flies, and 0 is sent where there is no barometer.
_LOWEST, _HIGHEST = 1.0, 1200.0
#: HIGHRES_IMU.fields_updated: its pressure is a new one.
_PRESSURE_UPDATED = 1 << 9
#: Barometers differ by some hPa, which is tens of metres: the first one heard counts until it is
#: silent for so long, s.
BAROMETER_SILENCE = 1.0
#: An accelerometer that was heard longer ago, s, is not set against the others.
ACCELEROMETER_SILENCE = 0.3
#: The accelerometer that the estimator flies on, told apart from the others by no number.
_IN_USE = "HIGHRES_IMU"
#: Autopilots send these for a compass of that number as well; without an accelerometer it reads 0.
_MAY_BE_NONE = ("SCALED_IMU2", "SCALED_IMU3")


class Barometers:
    """Of several the one that was heard first."""

    def __init__(self, readings: Readings) -> None:
        self._readings = readings
        self._chosen = ""
        self._heard = -math.inf

    def scaled_pressure(self, message: Any, now: float) -> None:
        """SCALED_PRESSURE, SCALED_PRESSURE2 or SCALED_PRESSURE3."""
        self._take(message.get_type(), message.press_abs, now)

    def highres_imu(self, message: Any, now: float) -> None:
        """HIGHRES_IMU: what of it was not measured anew is repeated."""
        if message.fields_updated & _PRESSURE_UPDATED:
            self._take(message.get_type(), message.abs_pressure, now)

    def _take(self, sensor: str, hpa: float, now: float) -> None:
        if not _LOWEST <= hpa <= _HIGHEST:
            return
        if sensor != self._chosen and now - self._heard <= BAROMETER_SILENCE:
            return
        self._chosen, self._heard = sensor, now
        self._readings.set("pressure", hpa * _HPA, now)


class Accelerometers:
    """The middle one of those that are heard, and by how much they differ."""

    def __init__(self, readings: Readings) -> None:
        self._readings = readings
        self._newest: dict[str, Reading] = {}

    def scaled_imu(self, message: Any, now: float) -> None:
        """SCALED_IMU, SCALED_IMU2 or SCALED_IMU3: thousandths of the standard gravity."""
        sensor = message.get_type()
        parts = (message.xacc, message.yacc, message.zacc)
        if sensor in _MAY_BE_NONE and sensor not in self._newest and not any(parts):
            return
        self._take(sensor, math.hypot(*parts) * STANDARD_GRAVITY / 1000.0, now)

    def highres_imu(self, message: Any, now: float) -> None:
        """HIGHRES_IMU: m/s^2."""
        force = math.hypot(message.xacc, message.yacc, message.zacc)
        if math.isfinite(force):
            self._take(_IN_USE, force, now)

    def _take(self, sensor: str, force: float, now: float) -> None:
        self._newest[sensor] = Reading(force, now)
        forces = {
            name: one.value
            for name, one in self._newest.items()
            if one.age(now) <= ACCELEROMETER_SILENCE
        }
        if len(forces) > 1:
            forces.pop(_IN_USE, None)
        values = sorted(forces.values())
        middle = (values[(len(values) - 1) // 2] + values[len(values) // 2]) / 2.0
        self._readings.set("acceleration", middle, now)
        if len(values) > 1:
            self._readings.set("acceleration_spread", values[-1] - values[0], now)
        else:
            self._readings.forget("acceleration_spread")
