"""Picture of the vehicle from the autopilot on the same network.

Source: MAVLink common.xml: HEARTBEAT, SYSTEM_TIME, and what vehicle_readers.py reads.
"""

from __future__ import annotations

import math
from typing import Any

from chute_ros.links.mavlink.protocol.answers import Answers
from chute_ros.links.mavlink.protocol.autopilot_settings import AutopilotSettings
from chute_ros.links.mavlink.protocol.firmware import Firmware, firmware_of, shows_vtol
from chute_ros.links.mavlink.protocol.motor_signs import MotorSigns
from chute_ros.links.mavlink.protocol.readings import Readings
from chute_ros.links.mavlink.protocol.round_trip import RoundTrip
from chute_ros.links.mavlink.protocol.sensors import FURTHER_ACCELEROMETERS, PRESSURE
from chute_ros.links.mavlink.protocol.stream_watch import (
    IntervalRequest,
    OptionalStreams,
    StreamWatch,
)
from chute_ros.links.mavlink.protocol.targets import AutopilotVehicle
from chute_ros.links.mavlink.protocol.twins import WINDOW, Twins
from chute_ros.links.mavlink.protocol.vehicle_readers import VehicleReaders
from chute_ros.model import (
    VTOL,
    Armed,
    LandedState,
    LinkState,
    Reading,
    VehicleState,
)
from chute_ros.protocol.boot_clock import Age, BootClock
from chute_ros.protocol.liveness import LinkChange, Liveness, LivenessLimits
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.stream_rate import StreamRate
from chute_ros.protocol.vehicle_readings import PARTS

#: What was said longer ago (s) proves nothing about now.
STREAM_SILENCE = 2.5

#: Their time_boot_ms is the autopilot's own time now. That of others (NAMED_VALUE_FLOAT, ...) a
#: user's script may have filled in, and a target keeps the time at which it was set.
_CLOCKS = frozenset(
    {
        "ATTITUDE",
        "ATTITUDE_QUATERNION",
        "GLOBAL_POSITION_INT",
        "LOCAL_POSITION_NED",
        "SCALED_IMU",
        "SYSTEM_TIME",
    }
)

#: What these tell is told with the next of the others: each picture is work for all who hear it.
_TOLD_WITH_THE_NEXT = frozenset(
    {
        *("SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3", "SCALED_IMU2", "SCALED_IMU3"),
        *("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT"),
        "NAV_CONTROLLER_OUTPUT",
    }
)

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
    """Follows one autopilot. needed_rate: of each message that the rules need, Hz."""

    def __init__(
        self, system_id: int, component_id: int, limits: LivenessLimits, needed_rate: float
    ) -> None:
        self.system_id = system_id
        self.component_id = component_id
        self.liveness = Liveness(limits)
        self.reboot_count = 0
        self.rebooted_in_flight = False
        #: HEARTBEAT.type, and that its VTOL state has shown otherwise.
        self._told_type, self._shown_vtol = 0, False
        self.settings = AutopilotSettings()
        self.motor_signs = MotorSigns()
        self.round_trip = RoundTrip()
        self.answers = Answers()
        #: How often it was seen to arm; when it last said whether it is armed, monotonic s.
        self.arming_count = 0
        self.armed_told_at = -math.inf
        self._system_status = 0
        self._streams = StreamWatch(needed_rate)
        self._optional = OptionalStreams()
        #: Of each message that is read, by name.
        self._rates: dict[str, StreamRate] = {}
        self._clock = BootClock()
        self._readings = Readings(self._streams.heard)
        self._readers = VehicleReaders(self._readings, self._clock)
        self._in_flight_before = False
        self._twins = Twins()
        #: A restart was seen that may be another device's clock.
        self._restart_pending = False
        #: When the newest restart was counted, and what was known before it.
        self._restarted: tuple[float, int, bool] = (-math.inf, 0, False)

    @property
    def device(self) -> str:
        """ "system/component"."""
        return f"{self.system_id}/{self.component_id}"

    @property
    def armed(self) -> Armed:
        """By the newest heartbeat."""
        value = self._readings.value("armed")
        return Armed.UNKNOWN if math.isnan(value) else Armed(int(value))

    @property
    def landed_state(self) -> LandedState:
        """By the newest EXTENDED_SYS_STATE."""
        value = self._readings.value("landed_state")
        return LandedState.UNKNOWN if math.isnan(value) else LandedState(int(value))

    def reading(self, name: str) -> Reading:
        """The newest value of a part of the picture; NaN: none."""
        return self._readings.get(name)

    def on_ground(self, now: float) -> bool:
        """The autopilot says so now: what it said before its stream fell silent proves nothing."""
        age = self._readings.age("landed_state", now)
        return self.landed_state is LandedState.ON_GROUND and age < STREAM_SILENCE

    @property
    def vehicle_type(self) -> int:
        """HEARTBEAT.type; VTOL where EXTENDED_SYS_STATE has shown that it is one, as ArduPlane's
        quadplanes say FIXED_WING, or what their users would have a ground station show."""
        return VTOL if self._shown_vtol else self._told_type

    @property
    def motors_off(self) -> bool:
        """The autopilot's own state shows that the motors do not turn any more."""
        terminated = self._system_status == dialect.MAV_STATE_FLIGHT_TERMINATION
        return self.armed is Armed.DISARMED or terminated

    def heartbeat(self, message: Any, now: float, copy: bool = False) -> list[LinkChange]:
        """A HEARTBEAT of the autopilot. copy: of one that came before, which tells nothing new."""
        # Of two with the same ids nobody knows whose it is: what was known ages.
        if not copy and not self._twins.found(now):
            self.armed_told_at = now
            armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            self.arming_count += armed and self.armed is Armed.DISARMED
            self._told_type = message.type
            self.motor_signs.armed(armed)
            self._readings.set("armed", Armed.ARMED if armed else Armed.DISARMED, now)
            self._system_status = message.system_status
            self._readers.targets.vehicle = AutopilotVehicle(
                message.autopilot, self.vehicle_type, message.custom_mode
            )
        changes = self.liveness.heard(now)
        if any(change.regained for change in changes):
            self.answers = Answers()
        firmware = firmware_of(message.autopilot)
        if changes or firmware is not self.settings.firmware:
            self._begin_streams()
            self.settings.begin(firmware, now)
        return changes

    def ask_anew(self) -> None:
        """It is to be asked for other intervals from now on."""
        self._streams.fill_stores()
        self._begin_streams()

    def messages_due(self, interval: float, now: float) -> tuple[IntervalRequest, ...]:
        """What to ask for now, so that each needed message comes each interval (s)."""
        needed = self._streams.due(interval, now)
        if needed:
            return needed
        targets = self._readers.targets.vehicle.target_messages
        wanted = {**PRESSURE, **targets, **FURTHER_ACCELEROMETERS}
        if self._streams.line_is_slow(now) or self.round_trip.late(now):
            return self._optional.give_up(wanted, now)
        return self._optional.due(wanted, self._rates, interval, now)

    def message(self, message: Any, now: float) -> bool:
        """Any other message of the autopilot; True: the vehicle's picture is to be told."""
        kind = message.get_type()
        if kind in _CLOCKS:
            if not self._twins.observe(kind, message.time_boot_ms, now):
                return False
            self._watch_clock(message.time_boot_ms, now)
        elif not self._twins.ours(getattr(message, "time_boot_ms", 0), now):
            return False
        self.motor_signs.heard(message, now)
        if kind in ("PARAM_VALUE", "PARAM_ERROR"):
            answer = self.settings.heard(message)
        elif kind == "TIMESYNC":
            answer = self.round_trip.heard(message, now)
        else:
            answer = False
        if answer:
            self.answers.answered(now)
        self._streams.received(len(message.get_msgbuf()))
        if not self._readers.read(message, now):
            return False
        if kind == "EXTENDED_SYS_STATE":
            self._shown_vtol |= shows_vtol(self._told_type, message.vtol_state)
        self._rates.setdefault(kind, StreamRate()).heard(now)
        return kind not in _TOLD_WITH_THE_NEXT

    def rates(self, now: float) -> dict[str, float]:
        """Hz of each message that is read and came at least twice, by name."""
        rates = {name: stream.rate(now) for name, stream in self._rates.items()}
        return {name: rate for name, rate in rates.items() if not math.isnan(rate)}

    def vehicle_state(self, now: float) -> VehicleState:
        """The picture at now, each part with its age."""
        fields: dict[str, Any] = {}
        for part, names in PARTS.items():
            fields |= {name: self._readings.value(name) for name in names}
            fields[f"{part}_age"] = self._readings.age(names[0], now)
        fields |= {"armed": self.armed, "landed_state": self.landed_state}
        targets = ("target_vertical_speed", "below_target", "target_age")
        fields |= zip(targets, self._readers.targets.at(now), strict=True)
        return VehicleState(
            source=self.device,
            link_state=self.liveness.state,
            system_status=self._system_status,
            vehicle_type=self.vehicle_type,
            uptime=self._clock.uptime,
            reboot_count=self.reboot_count,
            rebooted_in_flight=self.rebooted_in_flight,
            faults=self._faults(now),
            **fields,
        )

    def _faults(self, now: float) -> tuple[str, ...]:
        # Of one that is not heard that is the reason, not its rates.
        if self.liveness.state is not LinkState.OK:
            return ()
        faults = [*self._streams.faults(now), *self.round_trip.faults(now)]
        asked = "command, TIMESYNC or parameter request"
        if self.known_to_answer and (deaf := self.answers.fault(asked, now)):
            faults.append(f"autopilot {self.device} {deaf}")
        return tuple(faults)

    @property
    def known_to_answer(self) -> bool:
        """Its firmware is one that answers commands, TIMESYNC and parameter requests."""
        return self.settings.firmware is not Firmware.OTHER

    def _begin_streams(self) -> None:
        self.round_trip = RoundTrip()
        self._streams.begin()
        self._optional.begin()
        self._rates.clear()

    def doubt(self, now: float) -> str:
        """Another device uses the same ids, in words; empty: none does."""
        return self._twins.doubt(f"two autopilots have the ids {self.device}", now)

    def _watch_clock(self, boot_ms: int, now: float) -> None:
        age = self._clock.observe(boot_ms)
        if age is Age.DOUBTFUL:
            known = self.landed_state is not LandedState.UNKNOWN
            in_air = known and self.landed_state is not LandedState.ON_GROUND
            # Restarts again before it said where it is: it is where it was.
            still_there = not known and self.rebooted_in_flight
            self._in_flight_before = in_air or still_there or self.armed is Armed.ARMED
        self._restart_pending = self._restart_pending or age is Age.RESTARTED
        if self._twins.found(now):
            self._restart_pending = False
            at, count, in_flight = self._restarted
            if now - at <= WINDOW:
                self.reboot_count, self.rebooted_in_flight = count, in_flight
        elif self._restart_pending and not self._twins.by_turns(now):
            self._restart_pending = False
            self._restart(now)

    def _restart(self, now: float) -> None:
        self._restarted = now, self.reboot_count, self.rebooted_in_flight
        self.reboot_count += 1
        self.rebooted_in_flight = self._in_flight_before
        self._begin_streams()
        self.answers.restarted()
        self.settings.begin(self.settings.firmware, now)
        # What the autopilot said before its restart describes a vehicle that it no longer knows.
        self._readings.forget("armed", "landed_state")
