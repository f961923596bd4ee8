"""A MAVLink autopilot with a small multirotor under it, seen from the wire.

Source: MAVLink common.xml; refuses a plain disarm in the air as PX4 and ArduPilot do.
"""

from __future__ import annotations

import math

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame
from chute_ros.protocol.mavlink.goals import FORCE_DISARM
from chute_ros.sim.acting import number_of
from chute_ros.sim.autopilot_telemetry import HOME_LATITUDE, HOME_LONGITUDE, AutopilotTelemetry
from chute_ros.sim.flight import GRAVITY, FlightModel
from chute_ros.sim.mavlink_device import Params

STEP = 0.02  # s
_MOTOR, _OFF = float(dialect.FAILURE_UNIT_SYSTEM_MOTOR), float(dialect.FAILURE_TYPE_OFF)


class AutopilotDevice(AutopilotTelemetry):
    """One vehicle."""

    def __init__(
        self, system_id: int, script: list[tuple[float, str]], model: FlightModel | None = None
    ) -> None:
        super().__init__(system_id, script, model or FlightModel())
        self.terminated = False
        self._stepped_to = math.nan
        own = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            dialect.MAVLINK_MSG_ID_SYSTEM_TIME: self._system_time,
            dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_sys_state,
            dialect.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position_int,
            dialect.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            dialect.MAVLINK_MSG_ID_SCALED_IMU: self._scaled_imu,
        }
        self.streams |= own
        # Attitude and acceleration only on request, as many autopilots are delivered.
        self.default_intervals |= dict.fromkeys(own, 1.0)
        self.default_intervals[dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT] = 0.2
        self.default_intervals[dialect.MAVLINK_MSG_ID_ATTITUDE] = math.inf
        self.default_intervals[dialect.MAVLINK_MSG_ID_SCALED_IMU] = math.inf
        self.commands |= {
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            dialect.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            dialect.MAV_CMD_NAV_TAKEOFF: self._takeoff,
            dialect.MAV_CMD_NAV_LAND: self._land,
            dialect.MAV_CMD_INJECT_FAILURE: self._inject_failure,
        }
        self.actions |= {
            "arm": lambda _: self._set_armed(True),
            "takeoff": lambda height: setattr(self.model, "target_height", float(height)),
            "fail-motor": lambda _: self._fail_motor(),
        }
        self.arguments |= {"takeoff": number_of("m", 10_000.0)}

    def reboot(self) -> None:
        """Start anew: an autopilot that restarts in the air does not hold the vehicle any more."""
        super().reboot()
        self.terminated = False
        self.model.armed = False
        self._stepped_to = self.now

    def step(self, now: float) -> None:
        """Fly on to now."""
        while now - self._stepped_to >= STEP:
            was_flying = not self.model.on_ground
            self.model.step(STEP)
            self._stepped_to += STEP
            if was_flying and self.model.on_ground:
                self.say("TOUCHDOWN")
                if self.model.target_height <= 0.0:
                    self._set_armed(False)

    def next_step(self) -> float:
        """The next step of the flight model."""
        return self._stepped_to + STEP

    def heard(self, frame: Frame) -> None:
        """The parachute's status decides whether a canopy is out."""
        message = frame.message
        released = message.get_type() == "PARACHUTE_STATUS" and message.deployment_status
        if released and frame.system_id == self.system_id and math.isnan(self.model.released_for):
            self.say(f"CANOPY at {self.model.height:.1f} m")
            self.model.release()

    def _set_armed(self, armed: bool) -> None:
        if armed is not self.model.armed:
            self.model.armed = armed
            self.say("ARMED" if armed else "DISARMED")
            # Shown at once, but after the acknowledgement of whatever command did it.
            self._due[dialect.MAVLINK_MSG_ID_HEARTBEAT] = self.now

    def _fail_motor(self) -> None:
        self.model.motors_failed = True
        self.say(f"MOTOR FAILURE at {self.model.height:.1f} m")

    def _arm_disarm(self, params: Params) -> int:
        arm, force = params[0] != 0.0, params[1] == FORCE_DISARM
        if arm and self.terminated:
            return int(dialect.MAV_RESULT_DENIED)
        if not arm and not force and not self.model.on_ground:
            return int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
        self._set_armed(arm)
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _terminate(self, params: Params) -> int:
        if params[0] < 0.5:
            return int(dialect.MAV_RESULT_DENIED)
        self.terminated = True
        self.say(f"FLIGHT TERMINATION at {self.model.height:.1f} m")
        self._set_armed(False)
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _takeoff(self, params: Params) -> int:
        if not self.model.armed or not params[6] > 0.0:
            return int(dialect.MAV_RESULT_DENIED)
        self.model.target_height = params[6]
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _land(self, params: Params) -> int:
        self.model.target_height = 0.0
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _inject_failure(self, params: Params) -> int:
        if params[:2] != (_MOTOR, _OFF):
            return int(dialect.MAV_RESULT_UNSUPPORTED)
        self._fail_motor()
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _heartbeat(self) -> object:
        armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if self.model.armed else 0
        state = dialect.MAV_STATE_ACTIVE if self.model.armed else dialect.MAV_STATE_STANDBY
        if self.terminated:
            state = dialect.MAV_STATE_FLIGHT_TERMINATION
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_PX4, armed, 0, state, 3
        )

    def _system_time(self) -> object:
        return dialect.MAVLink_system_time_message(0, self.boot_ms())

    def _extended_sys_state(self) -> object:
        landed = dialect.MAV_LANDED_STATE_IN_AIR
        if self.model.on_ground:
            landed = dialect.MAV_LANDED_STATE_ON_GROUND
        return dialect.MAVLink_extended_sys_state_message(0, landed)

    def _sys_status(self) -> object:
        return dialect.MAVLink_sys_status_message(0, 0, 0, 100, 15800, -1, 87, 0, 0, 0, 0, 0, 0)

    def _global_position_int(self) -> object:
        home, height = self.home, self.model.height
        home.follow(self.model, self.now)
        return dialect.MAVLink_global_position_int_message(
            self.boot_ms(),
            HOME_LATITUDE,
            HOME_LONGITUDE,
            int((home.altitude + height) * 1000.0),
            int((height - home.offset) * 1000.0),
            0,
            0,
            int(-self.model.vertical_speed * 100.0),
            0xFFFF,
        )

    def _attitude(self) -> object:
        return dialect.MAVLink_attitude_message(
            self.boot_ms(), self.model.roll, 0.0, 0.0, 0.0, 0.0, 0.0
        )

    def _scaled_imu(self) -> object:
        milli_g = int(self.model.acceleration / GRAVITY * 1000.0)
        return dialect.MAVLink_scaled_imu_message(
            self.boot_ms(), 0, 0, -min(milli_g, 32767), 0, 0, 0, 0, 0, 0
        )
