"""A MAVLink parachute module, seen from the wire.

Source: Parachute Protocol. What it refuses and how follows the protocol's public emulator: release
with no command trigger armed is FAILED, without ground clearance TEMPORARILY_REJECTED, a trigger
bit beyond 128 is DENIED.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chute_ros.model import DeploymentTrigger, ErrorFlags, SafetyFlags, TriggerFlags
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame
from chute_ros.sim.acting import one_of
from chute_ros.sim.mavlink_device import MavlinkDevice, Params

_ALL_TRIGGERS = 0xFF
#: The automatic trigger fires after falling faster than this for this long, m/s and s.
ATS_SINK_SPEED = 10.0
ATS_SINK_TIME = 0.3
#: A height that was told is known for so long, s.
HEIGHT_LASTS = 3.0
#: Up or down faster, heights are not counted from another home than before, cm/s.
_MOVES = 100


@dataclass(frozen=True)
class ParachuteSettings:
    """How the simulated module starts."""

    system_id: int = 1
    component_id: int = 161  # MAV_COMP_ID_PARACHUTE
    armed_triggers: int = 0
    deployment: int = 0
    errors: int = 0
    #: "yes", "no", or "auto": by height where a vehicle is heard, otherwise yes.
    ground_cleared: str = "auto"
    ats_arm_altitude: int = 50  # m
    clear_height: float = 8.0  # m
    packed_date: str = "2026-06-19"
    system_status: int = 3  # MAV_STATE_STANDBY


class ParachuteDevice(MavlinkDevice):
    """One module."""

    def __init__(self, settings: ParachuteSettings, script: list[tuple[float, str]]) -> None:
        super().__init__(settings.system_id, settings.component_id, script)
        self.settings = settings
        self.armed = TriggerFlags(0)
        self.deployment = DeploymentTrigger.NONE
        self.errors = ErrorFlags(0)
        #: It answers FAILED to a release.
        self.refuses = False
        self.height = math.nan
        self._height_at = -math.inf
        #: Altitude that heights count from, m: a module's own sensor knows nothing of a home that
        #: an autopilot moves while it falls (PX4 does).
        self._ground = math.nan
        self._sinking_since = math.nan
        self.streams = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS: self.status,
            dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC: self._information,
        }
        self.default_intervals = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
            dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS: 1.0,
            dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC: math.inf,
        }
        self.commands |= {
            dialect.MAV_CMD_DO_PARACHUTE: self._do_parachute,
            dialect.MAV_CMD_SET_PARACHUTE_ARM: self._set_parachute_arm,
        }
        self.actions |= {
            "error": lambda name: setattr(self, "errors", self.errors | ErrorFlags[name]),
            "clear-errors": lambda _: setattr(self, "errors", ErrorFlags(0)),
            "deploy": lambda name: self.deploy(DeploymentTrigger[name]),
            "refuse": lambda _: setattr(self, "refuses", True),
            "accept": lambda _: setattr(self, "refuses", False),
            "repack": lambda _: self._repack(),
        }
        self.arguments |= {
            "error": one_of(ErrorFlags.__members__),
            "deploy": one_of({one.name: one for one in DeploymentTrigger if one}),
        }

    def reboot(self) -> None:
        """Start as the settings say; what was released stays released."""
        super().reboot()
        self._ground = math.nan
        self.armed = TriggerFlags(self.settings.armed_triggers)
        self.errors = ErrorFlags(self.settings.errors)
        if self.deployment is DeploymentTrigger.NONE:
            self.deployment = DeploymentTrigger(self.settings.deployment)

    def _repack(self) -> None:
        self.deployment, self.refuses = DeploymentTrigger.NONE, False
        self.reboot()

    def heard(self, frame: Frame) -> None:
        """The vehicle's own autopilot tells height and sink speed, as on a real network."""
        autopilot = (frame.system_id, frame.component_id) == (self.system_id, 1)
        if frame.message.get_type() != "GLOBAL_POSITION_INT" or not autopilot:
            return
        before = self._height()
        told = frame.message
        if math.isnan(self._ground) or abs(told.vz) < _MOVES:
            self._ground = (told.alt - told.relative_alt) / 1000.0
        self.height, self._height_at = told.alt / 1000.0 - self._ground, self.now
        self._automatic_trigger(before, frame.message.vz / 100.0)

    def _height(self) -> float:
        """The height that was told last, m; NaN: none was, or not lately."""
        return self.height if self.now - self._height_at <= HEIGHT_LASTS else math.nan

    def safety(self) -> SafetyFlags:
        """PARACHUTE_SAFETY_FLAGS by settings and height."""
        flags = SafetyFlags(0)
        height = self._height()
        cleared = self.settings.ground_cleared == "yes"
        if self.settings.ground_cleared == "auto":
            cleared = not height < self.settings.clear_height
        if cleared:
            flags |= SafetyFlags.GROUND_CLEARED
        if height < 0.3:
            flags |= SafetyFlags.ON_GROUND
        return flags

    def status(self) -> object:
        """PARACHUTE_STATUS as it is now."""
        return dialect.MAVLink_parachute_status_message(
            self.boot_ms(),
            int(self.errors),
            int(self.armed),
            int(self.deployment),
            int(self.safety()),
            self.settings.ats_arm_altitude,
            self.settings.packed_date.encode(),
        )

    def _heartbeat(self) -> object:
        kind, autopilot = dialect.MAV_TYPE_PARACHUTE, dialect.MAV_AUTOPILOT_INVALID
        status = self.settings.system_status
        return dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, status, 3)

    def _information(self) -> object:
        texts = (b"chute_ros", b"simulated parachute", b"0.1.0", b"1", b"SIM-0001")
        return dialect.MAVLink_component_information_basic_message(
            self.boot_ms(), 0, 1_750_000_000, *texts
        )

    def _do_parachute(self, params: Params) -> int:
        action = int(params[0])
        if action == dialect.PARACHUTE_RELEASE:
            return self._release()
        if action == dialect.PARACHUTE_ENABLE:
            self.armed |= TriggerFlags.ATS
        elif action == dialect.PARACHUTE_DISABLE:
            self.armed &= ~TriggerFlags.ATS
        else:
            return int(dialect.MAV_RESULT_DENIED)
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _release(self) -> int:
        if self.deployment is not DeploymentTrigger.NONE:
            return int(dialect.MAV_RESULT_ACCEPTED)
        if self.refuses or not self.armed & (TriggerFlags.FC | TriggerFlags.OFFBOARD):
            return int(dialect.MAV_RESULT_FAILED)
        if not self.safety() & SafetyFlags.GROUND_CLEARED:
            return int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
        by_fc = self.armed & TriggerFlags.FC
        self.deploy(DeploymentTrigger.DRONE if by_fc else DeploymentTrigger.MAVLINK)
        return int(dialect.MAV_RESULT_ACCEPTED)

    def _set_parachute_arm(self, params: Params) -> int:
        arm, select = int(params[0]), int(params[1])
        if not (0 <= arm <= _ALL_TRIGGERS and 0 <= select <= _ALL_TRIGGERS):
            return int(dialect.MAV_RESULT_DENIED)
        self.armed = TriggerFlags(int(self.armed) & ~select | arm & select)
        self.say(f"armed triggers: {self.armed!r}")
        return int(dialect.MAV_RESULT_ACCEPTED)

    def deploy(self, trigger: DeploymentTrigger) -> None:
        """Release, unless that was done before."""
        if self.deployment is DeploymentTrigger.NONE:
            self.deployment = trigger
            self.say(f"RELEASED by {trigger.name}")
            # On the vehicle's network the release is news; its own stream may be a second away.
            self._due[dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS] = self.now

    def _automatic_trigger(self, before: float, sink_speed: float) -> None:
        # As it passes the altitude: what was commanded above or below it holds until then.
        altitude = self.settings.ats_arm_altitude
        high = self.height >= altitude
        if self.armed & TriggerFlags.ATS_AUTO_ARM and high and not before >= altitude:
            self.armed |= TriggerFlags.ATS
        if self.armed & TriggerFlags.ATS_AUTO_DISARM and not high and not before < altitude:
            self.armed &= ~TriggerFlags.ATS
        if sink_speed < ATS_SINK_SPEED:
            self._sinking_since = math.nan
        elif math.isnan(self._sinking_since):
            self._sinking_since = self.now
        fires = self.now - self._sinking_since >= ATS_SINK_TIME
        if fires and self.armed & TriggerFlags.ATS and self.safety() & SafetyFlags.GROUND_CLEARED:
            self.deploy(DeploymentTrigger.ATS)
