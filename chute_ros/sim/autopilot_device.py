"""A MAVLink autopilot with a small multirotor under it, seen from the wire.

Source: MAVLink common.xml; refuses a plain disarm in the air as PX4 and ArduPilot do.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Any

from chute_ros.protocol.mavlink.dialect import FORCE_DISARM, dialect
from chute_ros.protocol.mavlink.frames import Frame
from chute_ros.sim.acting import NotNowError, number_of, one_of
from chute_ros.sim.arm_authorization import ArmAuthorization
from chute_ros.sim.autopilot_kinds import GENERIC, AutopilotKind, Termination
from chute_ros.sim.autopilot_parameters import ParameterServer
from chute_ros.sim.autopilot_telemetry import HOME_LATITUDE, HOME_LONGITUDE, AutopilotTelemetry
from chute_ros.sim.battery import Battery
from chute_ros.sim.flight import GRAVITY
from chute_ros.sim.gusts import GustyModel
from chute_ros.sim.lies import LIES, TRUTH, LyingEstimator
from chute_ros.sim.mavlink_device import Params

STEP = 0.02  # s
#: From arming to the take-off of action fly, s: as long as autopilots spool up.
_SPOOLS_UP = 1.0
#: Usual strength of the gusts of each m/s of wind, m/s^2.
GUSTS_OF_WIND = 0.15
#: The same in still air: no vehicle hovers without moving; what does not is taken for stuck.
_STILL_AIR = 0.1
_MOTOR, _OFF = float(dialect.FAILURE_UNIT_SYSTEM_MOTOR), float(dialect.FAILURE_TYPE_OFF)


class AutopilotDevice(AutopilotTelemetry):
    """One vehicle."""

    model: GustyModel

    def __init__(
        self,
        system_id: int,
        script: list[tuple[float, str]],
        model: GustyModel | None = None,
        kind: AutopilotKind = GENERIC,
    ) -> None:
        model = model or GustyModel(gusts=_STILL_AIR, chance=random.Random(system_id))
        super().__init__(system_id, script, model)
        self.kind = kind
        self.battery = Battery()
        self.lying = LyingEstimator()
        self.parameters = ParameterServer(kind)
        self._authorization = ArmAuthorization()
        #: What was ordered and takes its time: (when, what).
        self._later: list[tuple[float, Callable[[], None]]] = []
        #: A take-off was ordered: from when on it says IN_AIR.
        self._in_air_from = math.inf
        #: Disarmed in the air, it takes itself to stand from here on.
        self._stands_from = math.inf
        self.terminated = False
        self._stepped_to = math.nan
        if kind.targets_of_a_wing:
            self.tell_targets_of_a_wing()
        for message, make, interval in (
            (dialect.MAVLINK_MSG_ID_HEARTBEAT, self._heartbeat, 1.0),
            (dialect.MAVLINK_MSG_ID_SYSTEM_TIME, self._system_time, 1.0),
            (dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, self._extended_sys_state, 1.0),
            (dialect.MAVLINK_MSG_ID_SYS_STATUS, self._sys_status, 1.0),
            (dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, self._global_position_int, 0.2),
            # Attitude and acceleration only on request, as many autopilots are delivered.
            (dialect.MAVLINK_MSG_ID_ATTITUDE, self._attitude, math.inf),
            (dialect.MAVLINK_MSG_ID_SCALED_IMU, self._scaled_imu, math.inf),
        ):
            self.streams[message], self.default_intervals[message] = make, interval
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
            "fly": lambda height: self._arm_and_leave(float(height)),
            "land": lambda _: self._come_down(),
            "fail-motor": lambda _: self._fail_motor(),
            "battery": lambda volts: self.battery.drain_to(float(volts), self.now),
            "lie": lambda kind: self.lying.lie(kind, self.model, self.now),
            "wind": lambda speed: self._blow(float(speed)),
            "mend": lambda _: self._mend(),
        }
        self.arguments |= {
            "takeoff": number_of("m", 10_000.0),
            "fly": number_of("m", 10_000.0),
            "battery": number_of("V", 30.0),
            "lie": one_of(dict.fromkeys(LIES)),
            "wind": number_of("m/s", 30.0),
        }

    def reboot(self) -> None:
        """Start anew: an autopilot that restarts in the air does not hold the vehicle any more."""
        super().reboot()
        self.lying.lie(TRUTH, self.model, self.now)
        self.terminated = False
        self.model.armed = False
        self._in_air_from = math.inf
        self._stands_from = self.now + self.kind.stands_disarmed
        self._later.clear()
        self._stepped_to = self.now

    def step(self, now: float) -> None:
        """Live on to now."""
        self._act_late(now)
        self._fly(now)

    def _act_late(self, now: float) -> None:
        """Do what was ordered and took its time."""
        for entry in [entry for entry in self._later if now >= entry[0]]:
            self._later.remove(entry)
            entry[1]()
        if (order := self._authorization.overdue(now)) is not None:
            self.say("ARM AUTHORIZATION: no response")
            self.acknowledge(order, dialect.MAV_RESULT_TEMPORARILY_REJECTED)

    def _fly(self, now: float) -> None:
        """Move the vehicle on to now."""
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
        if message.get_type() in ("PARAM_REQUEST_READ", "PARAM_SET"):
            self._parameter(frame)
        elif message.get_type() == "COMMAND_ACK":
            self._authorized(message)
        elif message.get_type() == "TIMESYNC" and message.tc1 == 0:
            self.send(dialect.MAVLink_timesync_message(self.boot_ms() * 1_000_000, message.ts1))
        released = message.get_type() == "PARACHUTE_STATUS" and message.deployment_status
        if released and frame.system_id == self.system_id and math.isnan(self.model.released_for):
            self.say(f"CANOPY at {self.model.height:.1f} m")
            self.model.release()

    def _set_armed(self, armed: bool) -> None:
        if armed is not self.model.armed:
            self.model.armed = armed
            self.say("ARMED" if armed else "DISARMED")
            self._in_air_from = math.inf
            self._stands_from = math.inf if armed else self.now + self.kind.stands_disarmed
            if self.kind.quick_heartbeat:
                # Shown at once, but after the acknowledgement of whatever command did it.
                self._due[dialect.MAVLINK_MSG_ID_HEARTBEAT] = self.now

    def _fail_motor(self) -> None:
        self.model.motors_failed = True
        self.say(f"MOTOR FAILURE at {self.model.height:.1f} m")

    def _arm_and_leave(self, height: float) -> None:
        if self.model.motors_failed or not math.isnan(self.model.released_for):
            raise NotNowError("the vehicle is broken or its canopy is out: start over (mend)")
        if not self.model.on_ground:
            raise NotNowError(f"the vehicle is in the air, at {self.model.height:.1f} m")
        if self.terminated:
            raise NotNowError("flight termination holds until the autopilot restarts (reboot)")
        self._set_armed(True)
        self._after(_SPOOLS_UP, lambda: self._leave(height))

    def _leave(self, height: float) -> None:
        if self.model.armed:
            self._climb_to(height)
        else:
            self.say("NO TAKE-OFF: it was disarmed")

    def _climb_to(self, height: float) -> None:
        self.model.target_height = height
        self._in_air_from = self.now + self.kind.early_in_air

    def _come_down(self) -> None:
        self.model.target_height = 0.0

    def _blow(self, speed: float) -> None:
        self.model.calm()
        self.model.gusts = max(_STILL_AIR, GUSTS_OF_WIND * speed)

    def _mend(self) -> None:
        self.model.mend()
        self.battery = Battery()
        self.reboot()

    def _arm_disarm(self, params: Params) -> int:
        arm, force = params[0] != 0.0, params[1] == FORCE_DISARM
        if arm and self.terminated:
            return int(dialect.MAV_RESULT_DENIED)
        if not arm and not force and self._takes_itself_to_fly:
            return self.kind.disarm_refused
        self._after(self.kind.settles, lambda: self._set_armed(arm))
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _terminate(self, params: Params) -> int:
        if params[0] < 0.5:
            return int(dialect.MAV_RESULT_DENIED)
        releases = self.kind.termination is Termination.RELEASES
        if self.kind.termination is Termination.NEEDS_AFS and not self._afs_terminates():
            return int(dialect.MAV_RESULT_FAILED)
        if releases and self.terminated:
            return int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
        if releases and not self.model.armed:
            return int(dialect.MAV_RESULT_DENIED)
        self._after(self.kind.settles, self._end_flight)
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _end_flight(self) -> None:
        self.terminated = self.kind.termination is not Termination.DISARMS
        self.say(f"FLIGHT TERMINATION at {self.model.height:.1f} m")
        self._set_armed(False)
        if self.kind.termination is Termination.RELEASES:
            release = (dialect.MAV_CMD_DO_PARACHUTE, 0, float(dialect.PARACHUTE_RELEASE))
            parachute = (self.system_id, dialect.MAV_COMP_ID_PARACHUTE)
            self.send(dialect.MAVLink_command_long_message(*parachute, *release, *[0.0] * 6))

    def _afs_terminates(self) -> bool:
        values = self.parameters.values
        return (values["AFS_ENABLE"], values["AFS_TERM_ACTION"]) == (1, 42)

    @property
    def _takes_itself_to_fly(self) -> bool:
        if self.now >= self._stands_from:
            return False
        return not self.model.on_ground or self.now >= self._in_air_from

    def _after(self, delay: float, function: Callable[[], None]) -> None:
        """Have function called after delay, s."""
        if delay > 0.0:
            self._later.append((self.now + delay, function))
        else:
            function()

    def _command(self, frame: Frame) -> None:
        message = frame.message
        arms = message.command == dialect.MAV_CMD_COMPONENT_ARM_DISARM and message.param1 != 0.0
        asks = self.parameters.values.get("COM_ARM_AUTH_REQ") == 1
        if not (arms and asks) or self.mute:
            super()._command(frame)
            return
        authorizer = int(self.parameters.values["COM_ARM_AUTH_ID"])
        self.send(self._authorization.ask(frame, authorizer, self.now))

    def _authorized(self, message: Any) -> None:
        order, allowed = self._authorization.answered(message, self.system_id)
        if order is not None and allowed:
            super()._command(order)
        elif order is not None:
            self.say("ARM AUTHORIZATION: denied")
            self.acknowledge(order, dialect.MAV_RESULT_TEMPORARILY_REJECTED)

    def _parameter(self, frame: Frame) -> None:
        message = frame.message
        if message.target_system == self.system_id and self.kind.parameters and not self.mute:
            answer = self.parameters.answer(message, (frame.system_id, frame.component_id))
            self.send(answer)

    def _set_message_interval(self, params: Params) -> int:
        heartbeat = int(params[0]) == dialect.MAVLINK_MSG_ID_HEARTBEAT
        if heartbeat and self.kind.autopilot == dialect.MAV_AUTOPILOT_PX4:
            return int(dialect.MAV_RESULT_ACCEPTED)  # and ignored
        return super()._set_message_interval(params)

    def _takeoff(self, params: Params) -> int:
        if not self.model.armed or not params[6] > 0.0:
            return int(dialect.MAV_RESULT_DENIED)
        self._climb_to(params[6])
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _land(self, params: Params) -> int:
        self._come_down()
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
            self.kind.vehicle_type, self.kind.autopilot, armed, self.kind.custom_mode, state, 3
        )

    def _system_time(self) -> object:
        return dialect.MAVLink_system_time_message(0, self.boot_ms())

    def _extended_sys_state(self) -> object:
        landed = dialect.MAV_LANDED_STATE_IN_AIR
        if not self._takes_itself_to_fly:
            landed = dialect.MAV_LANDED_STATE_ON_GROUND
        return dialect.MAVLink_extended_sys_state_message(self.kind.vtol_state, landed)

    def _sys_status(self) -> object:
        millivolts = round(self.battery.voltage(self.now) * 1000.0)
        percent = round(self.battery.remaining(self.now) * 100.0)
        return dialect.MAVLink_sys_status_message(
            0, 0, 0, 100, millivolts, -1, percent, 0, 0, 0, 0, 0, 0
        )

    def _global_position_int(self) -> object:
        home, (height, speed, _) = self.home, self.lying.belief(self.model, self.now)
        home.follow(self.model, self.now)
        return dialect.MAVLink_global_position_int_message(
            self.boot_ms(),
            HOME_LATITUDE,
            HOME_LONGITUDE,
            int((home.altitude + height) * 1000.0),
            int((height - home.offset) * 1000.0),
            0,
            0,
            int(-speed * 100.0),
            0xFFFF,
        )

    def _height_error(self) -> float:
        # Whatever the estimator makes up, the controller holds what it was told to.
        return self.model.height - self._told_height()[0]

    def _attitude(self) -> object:
        roll = self.lying.belief(self.model, self.now).roll
        return dialect.MAVLink_attitude_message(self.boot_ms(), roll, 0.0, 0.0, 0.0, 0.0, 0.0)

    def _scaled_imu(self) -> object:
        milli_g = int(self.model.acceleration / GRAVITY * 1000.0)
        return dialect.MAVLink_scaled_imu_message(
            self.boot_ms(), 0, 0, -min(milli_g, 32767), 0, 0, 0, 0, 0, 0
        )
