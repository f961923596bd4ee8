"""What the autopilot on the same network says of the vehicle.

Source: MAVLink common.xml: HEARTBEAT, EXTENDED_SYS_STATE, GLOBAL_POSITION_INT, LOCAL_POSITION_NED,
ALTITUDE, ATTITUDE, ATTITUDE_QUATERNION, SCALED_IMU, HIGHRES_IMU, SYS_STATUS, SYSTEM_TIME.
A value that is not finite, or that the message marks as unknown, is not taken over: the reading
before it goes on ageing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from chute_ros.model import Armed, LandedState, Reading, VehicleState
from chute_ros.protocol.boot_clock import Age, BootClock
from chute_ros.protocol.liveness import LinkChange, Liveness, LivenessLimits
from chute_ros.protocol.mavlink.autopilot_settings import AutopilotSettings
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.firmware import firmware_of
from chute_ros.protocol.mavlink.motor_signs import MotorSigns
from chute_ros.protocol.mavlink.stream_watch import ASKED_FOR, StreamWatch

STANDARD_GRAVITY = 9.80665  # m/s^2
#: What was said longer ago (s) proves nothing about now.
STREAM_SILENCE = 2.5

_NEVER = Reading()

#: Types that never fly the vehicle, whatever their heartbeat says in its field autopilot.
_NOT_FLYING = frozenset(
    {
        dialect.MAV_TYPE_ANTENNA_TRACKER,
        dialect.MAV_TYPE_GCS,
        dialect.MAV_TYPE_ONBOARD_CONTROLLER,
        dialect.MAV_TYPE_GIMBAL,
        dialect.MAV_TYPE_ADSB,
        dialect.MAV_TYPE_CAMERA,
        dialect.MAV_TYPE_CHARGING_STATION,
        dialect.MAV_TYPE_FLARM,
        dialect.MAV_TYPE_SERVO,
        dialect.MAV_TYPE_ODID,
        dialect.MAV_TYPE_BATTERY,
        dialect.MAV_TYPE_PARACHUTE,
        dialect.MAV_TYPE_LOG,
        dialect.MAV_TYPE_OSD,
        dialect.MAV_TYPE_IMU,
        dialect.MAV_TYPE_GPS,
        dialect.MAV_TYPE_WINCH,
    }
)


def is_autopilot(heartbeat: Any) -> bool:
    """A flight controller sends this heartbeat: not a ground station or another component."""
    no_autopilot = heartbeat.autopilot == dialect.MAV_AUTOPILOT_INVALID
    return not no_autopilot and heartbeat.type not in _NOT_FLYING


class AutopilotTracker:
    """Follows one autopilot."""

    def __init__(self, system_id: int, component_id: int, limits: LivenessLimits) -> None:
        self.system_id = system_id
        self.component_id = component_id
        self.liveness = Liveness(limits)
        self.reboot_count = 0
        self.rebooted_in_flight = False
        #: HEARTBEAT.type.
        self.vehicle_type = 0
        self.settings = AutopilotSettings()
        self.motor_signs = MotorSigns()
        #: How often it was seen to arm.
        self.arming_count = 0
        self._readings: dict[str, Reading] = {}
        self._system_status = 0
        self._streams = StreamWatch()
        self._clock = BootClock()
        self._in_flight_before = False
        self._readers: dict[str, Callable[[Any, float], None]] = {
            "EXTENDED_SYS_STATE": self._extended_sys_state,
            "GLOBAL_POSITION_INT": self._global_position_int,
            "LOCAL_POSITION_NED": self._local_position_ned,
            "ALTITUDE": self._altitude,
            "ATTITUDE": self._attitude,
            "ATTITUDE_QUATERNION": self._attitude_quaternion,
            "SCALED_IMU": self._scaled_imu,
            "HIGHRES_IMU": self._highres_imu,
            "SYS_STATUS": self._sys_status,
        }

    @property
    def device(self) -> str:
        """ "system/component"."""
        return f"{self.system_id}/{self.component_id}"

    @property
    def armed(self) -> Armed:
        """By the newest heartbeat."""
        reading = self._readings.get("armed")
        return Armed.UNKNOWN if reading is None else Armed(int(reading.value))

    @property
    def landed_state(self) -> LandedState:
        """By the newest EXTENDED_SYS_STATE."""
        reading = self._readings.get("landed_state")
        return LandedState.UNKNOWN if reading is None else LandedState(int(reading.value))

    def reading(self, name: str) -> Reading:
        """The newest value of a part of the picture; NaN: none."""
        return self._readings.get(name, _NEVER)

    def on_ground(self, now: float) -> bool:
        """The autopilot says so now: what it said before its stream fell silent proves nothing."""
        age = self._readings.get("landed_state", _NEVER).age(now)
        return self.landed_state is LandedState.ON_GROUND and age < STREAM_SILENCE

    @property
    def motors_off(self) -> bool:
        """The autopilot's own state shows that the motors do not turn any more."""
        terminated = self._system_status == dialect.MAV_STATE_FLIGHT_TERMINATION
        return self.armed is Armed.DISARMED or terminated

    def heartbeat(self, message: Any, now: float) -> list[LinkChange]:
        """A HEARTBEAT of the autopilot."""
        armed = message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
        self.arming_count += bool(armed) and self.armed is Armed.DISARMED
        self.vehicle_type = message.type
        self.motor_signs.armed(bool(armed))
        self._set("armed", Armed.ARMED if armed else Armed.DISARMED, now)
        self._system_status = message.system_status
        changes = self.liveness.heard(now)
        firmware = firmware_of(message.autopilot)
        if changes or firmware is not self.settings.firmware:
            self._streams.begin()
            self.settings.begin(firmware, now)
        return changes

    def ask_anew(self) -> None:
        """It is to be asked for other intervals from now on."""
        self._streams = StreamWatch()

    def messages_due(self, interval: float, now: float) -> tuple[int, ...]:
        """The messages to ask for now, so that each comes each interval (s)."""
        return self._streams.due(interval, now)

    def message(self, message: Any, now: float) -> bool:
        """Any other message of the autopilot; True: the vehicle's picture changed."""
        kind = message.get_type()
        self.motor_signs.heard(message, now)
        if kind in ("PARAM_VALUE", "PARAM_ERROR"):
            self.settings.heard(message)
        reader = self._readers.get(kind)
        # Others (NAMED_VALUE_FLOAT, ...) carry times that a user's script may have filled in.
        if reader is not None or kind == "SYSTEM_TIME":
            self._watch_clock(getattr(message, "time_boot_ms", 0), now)
        if reader is None:
            return False
        reader(message, now)
        return True

    def vehicle_state(self, now: float) -> VehicleState:
        """The picture at now, each part with its age."""

        def value(name: str) -> float:
            return self._readings.get(name, _NEVER).value

        def age(name: str) -> float:
            return self._readings.get(name, _NEVER).age(now)

        return VehicleState(
            source=self.device,
            link_state=self.liveness.state,
            armed=self.armed,
            armed_age=age("armed"),
            landed_state=self.landed_state,
            landed_state_age=age("landed_state"),
            height=value("height"),
            height_age=age("height"),
            vertical_speed=value("vertical_speed"),
            vertical_speed_age=age("vertical_speed"),
            roll=value("roll"),
            pitch=value("pitch"),
            yaw=value("yaw"),
            tilt=value("tilt"),
            attitude_age=age("tilt"),
            acceleration=value("acceleration"),
            acceleration_age=age("acceleration"),
            latitude=value("latitude"),
            longitude=value("longitude"),
            position_age=age("latitude"),
            battery_voltage=value("battery_voltage"),
            battery_remaining=value("battery_remaining"),
            battery_age=age("battery_voltage"),
            system_status=self._system_status,
            uptime=self._clock.uptime,
            reboot_count=self.reboot_count,
            rebooted_in_flight=self.rebooted_in_flight,
        )

    def _set(self, name: str, value: float, now: float) -> None:
        if math.isfinite(value):
            self._readings[name] = Reading(float(value), now)
            if name in ASKED_FOR:
                self._streams.heard(name, now)

    def _watch_clock(self, boot_ms: int, now: float) -> None:
        age = self._clock.observe(boot_ms)
        if age is Age.DOUBTFUL:
            known = self.landed_state is not LandedState.UNKNOWN
            in_air = known and self.landed_state is not LandedState.ON_GROUND
            # Restarts again before it said where it is: it is where it was.
            still_there = not known and self.rebooted_in_flight
            self._in_flight_before = in_air or still_there or self.armed is Armed.ARMED
        if age is not Age.RESTARTED:
            return
        self.reboot_count += 1
        self.rebooted_in_flight = self._in_flight_before
        self._streams.begin()
        self.settings.begin(self.settings.firmware, now)
        # What the autopilot said before its restart describes a vehicle that it no longer knows.
        for name in ("armed", "landed_state"):
            self._readings.pop(name, None)

    def _extended_sys_state(self, message: Any, now: float) -> None:
        if LandedState.UNKNOWN < message.landed_state <= max(LandedState):
            self._set("landed_state", message.landed_state, now)

    def _global_position_int(self, message: Any, now: float) -> None:
        self._set("height", message.relative_alt / 1000.0, now)
        self._set("vertical_speed", -message.vz / 100.0, now)
        latitude, longitude = message.lat / 1e7, message.lon / 1e7
        # 0, 0 is what autopilots send before they know.
        known = (latitude, longitude) != (0.0, 0.0)
        if known and abs(latitude) <= 90.0 and abs(longitude) <= 180.0:
            self._set("latitude", latitude, now)
            self._set("longitude", longitude, now)

    def _local_position_ned(self, message: Any, now: float) -> None:
        # Its origin may not be the take-off point, so that only the speed is taken from it.
        self._set("vertical_speed", -message.vz, now)

    def _altitude(self, message: Any, now: float) -> None:
        self._set("height", message.altitude_relative, now)

    def _attitude(self, message: Any, now: float) -> None:
        if not all(map(math.isfinite, (message.roll, message.pitch, message.yaw))):
            return
        self._set("roll", message.roll, now)
        self._set("pitch", message.pitch, now)
        self._set("yaw", message.yaw, now)
        upright = math.cos(message.roll) * math.cos(message.pitch)
        self._set("tilt", math.acos(max(-1.0, min(1.0, upright))), now)

    def _attitude_quaternion(self, message: Any, now: float) -> None:
        w, x, y, z = message.q1, message.q2, message.q3, message.q4
        length = math.sqrt(w * w + x * x + y * y + z * z)
        if not 0.5 < length < 2.0:
            return
        w, x, y, z = w / length, x / length, y / length, z / length
        self._set("roll", math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), now)
        self._set("pitch", math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))), now)
        self._set("yaw", math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)), now)
        self._set("tilt", math.acos(max(-1.0, min(1.0, 1 - 2 * (x * x + y * y)))), now)

    def _scaled_imu(self, message: Any, now: float) -> None:
        length = math.sqrt(message.xacc**2 + message.yacc**2 + message.zacc**2)
        self._set("acceleration", length * STANDARD_GRAVITY / 1000.0, now)

    def _highres_imu(self, message: Any, now: float) -> None:
        parts = (message.xacc, message.yacc, message.zacc)
        if all(map(math.isfinite, parts)):
            self._set("acceleration", math.hypot(*parts), now)

    def _sys_status(self, message: Any, now: float) -> None:
        if message.voltage_battery != 0xFFFF:
            self._set("battery_voltage", message.voltage_battery / 1000.0, now)
        if 0 <= message.battery_remaining <= 100:
            self._set("battery_remaining", message.battery_remaining / 100.0, now)
