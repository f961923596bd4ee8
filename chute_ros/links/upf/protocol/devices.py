"""Status of one UPF controller and of one UPF trigger, normalised.

Source: Flyfire UPF UAVCAN protocol V1.0, "global working state" (flyfire.ParachuteStatus) and the
architecture with triggers (flyfire.TriggerStatus).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.machine import DEPLOYED, is_known_jump
from chute_ros.model import (
    NAN,
    ErrorFlags,
    LinkState,
    ParachuteState,
    ParachuteStatus,
    SafetyFlags,
    TriggerFlags,
)
from chute_ros.protocol.liveness import DeviceTracker, LinkChange

_HEALTH = ("OK", "WARNING", "ERROR", "CRITICAL")
#: Modes of NodeStatus.
OPERATIONAL, _INITIALIZATION = 0, 1
_MODES = {
    OPERATIONAL: "OPERATIONAL",
    _INITIALIZATION: "INITIALIZATION",
    2: "MAINTENANCE",
    3: "SOFTWARE_UPDATE",
    7: "OFFLINE",
}
#: Errors of ours that have a name among the flags of the MAVLink parachute protocol.
_FLAGS = {
    "IMU": ErrorFlags.IMU_ERROR,
    "BAROMETER": ErrorFlags.BAROMETER_ERROR,
    "TRIGGER_CONNECTION": ErrorFlags.POD_CONNECTION_ERROR,
    "LOW_POWER": ErrorFlags.LOW_POWER,
    "VEHICLE_CONNECTION": ErrorFlags.FC_CONNECTION_ERROR,
}
#: Of any other error, which must not pass for none: MAVLink's "fault of the parachute pod".
_ANY_OTHER = ErrorFlags.POD_CONNECTION_ERROR
_DISABLED = "PARACHUTE_DISABLED"


def _error_name(told: str) -> str:
    """Told by a bit's name (IMU) or by that of a field of its own (error_imu)."""
    return told.upper().removeprefix("ERROR_")


def mode_name(mode: int) -> str:
    """A mode of NodeStatus; one without a name by its number."""
    return _MODES.get(mode, str(mode))


class Device(DeviceTracker):
    """What controller and trigger have in common."""

    kind = ""

    def __init__(self, node_id: int, config: UpfConfig, definitions: Definitions) -> None:
        super().__init__(config.liveness, config.status_timeout)
        self.node_id = node_id
        self.restart_count = 0
        #: Fields of the newest status that we know nothing of.
        self.unknown_fields: dict[str, Any] = {}
        self.definitions = definitions
        self.values: Mapping[str, Any] = {}
        self.uptime = math.nan  # s, by NodeStatus
        self._health = 0
        self._mode = OPERATIONAL

    @property
    def device(self) -> str:
        """The node id in words."""
        return str(self.node_id)

    def node_status(self, values: Mapping[str, Any], now: float) -> list[LinkChange]:
        """A NodeStatus of the device."""
        self._health, self._mode = values["health"], values["mode"]
        self.uptime = float(values["uptime_sec"])
        return self.liveness.heard(now)

    def take_status(self, name: str, values: Mapping[str, Any], now: float) -> list[LinkChange]:
        """Its own status message."""
        self.status_came(now)
        self.values = values
        new = [
            one.rpartition(".")[2] for one in self.definitions.new if one.startswith(f"{name}.")
        ]
        self.unknown_fields = {field: values[field] for field in new if field in values}
        return self.liveness.heard(now)

    @property
    def alive(self) -> bool:
        """Not lost, and heard."""
        return self.liveness.state in (LinkState.OK, LinkState.STALE)

    def link_faults(self, now: float, name: str) -> list[str]:
        """What is wrong of link, health, mode and status stream."""
        faults = []
        if self.liveness.state in (LinkState.STALE, LinkState.LOST):
            silence = self.liveness.age(now)
            faults.append(
                f"{self.kind} {self.node_id} {self.liveness.state.name}: {silence:.1f} s"
            )
        if self._health:
            faults.append(f"NodeStatus of {self.node_id} reports {_HEALTH[self._health]}")
        if self._mode != OPERATIONAL:
            faults.append(f"NodeStatus of {self.node_id} reports mode {mode_name(self._mode)}")
        if self.overdue(now):
            faults.append(f"{name} {now - self.status_received:.1f} s old")
        return faults

    @property
    def unhealthy(self) -> bool:
        """By its NodeStatus: ERROR or CRITICAL, or a mode in which it does not work."""
        return self._health >= 2 or self._mode not in (OPERATIONAL, _INITIALIZATION)

    @property
    def starting(self) -> bool:
        """By its NodeStatus, which after a start may still say so when its status is READY."""
        return self._mode == _INITIALIZATION

    def number(self, field: str) -> float:
        """A measured value; NaN: not told."""
        value = self.values.get(field)
        return float(value) if isinstance(value, (int, float)) else NAN


#: So many statuses in a row must say "launched" that nobody ordered. Of two, where 30 % of all
#: frames were damaged, one flight in some thousand had its motors stopped.
SAYINGS = 3
#: And so many of one that was: a damaged one right after the order, which was damaged as well,
#: would end it.
SAYINGS_ORDERED = 2


class Trigger(Device):
    """Follows one trigger."""

    kind = "trigger"

    def __init__(self, node_id: int, config: UpfConfig, definitions: Definitions) -> None:
        super().__init__(node_id, config, definitions)
        self._sayings = 0
        #: A status that says that it has fired, and is not believed yet.
        self._doubted_values: Mapping[str, Any] | None = None

    def status_message(
        self, values: Mapping[str, Any], now: float, sayings: int
    ) -> list[LinkChange]:
        """A TriggerStatus. sayings: so many in a row must say "launched" until it is believed.

        A single frame has no checksum behind an slcan adapter, and damage must open no parachute,
        nor keep one closed: what the controller does not say as well is left aside until the
        trigger has said so again.
        """
        news = self._says_launched(values) and not self.launched
        self._sayings = self._sayings + 1 if news else 0
        self._doubted_values = None
        if news and self._sayings < sayings:
            self._doubted_values, values = values, self.values
        return self.take_status(names.TRIGGER_STATUS, values, now)

    @property
    def doubted(self) -> bool:
        """It says that it has fired, and is not believed yet."""
        return self._doubted_values is not None

    def believe(self) -> None:
        """Somebody else says so too: what was left aside, if anything was, is true."""
        if self._doubted_values is not None:
            self.values, self._doubted_values = self._doubted_values, None

    @property
    def state(self) -> str:
        """NOT_READY, READY, LAUNCHED, ABNORMAL; empty: not known."""
        return self.definitions.state_name(names.TRIGGER_STATUS, self.values)

    @property
    def launched(self) -> bool:
        """It says that it has fired, and is believed."""
        return self._says_launched(self.values)

    @property
    def sound(self) -> bool:
        """Heard in time and able to fire, by all that it says."""
        whole = not self.definitions.faults(names.TRIGGER_STATUS, self.values)
        heard = self.liveness.state is LinkState.OK and not self._overdue
        able = self.state in ("", "READY") and not self.launched and not self.doubted
        return heard and whole and able and not (self.unhealthy or self.starting)

    def faults(self, now: float) -> list[str]:
        """What is wrong, in words."""
        faults = self.link_faults(now, "TriggerStatus")
        told = self.definitions.faults(names.TRIGGER_STATUS, self.values)
        faults += [f"trigger {self.node_id}: {one}" for one in told]
        if self.state == "ABNORMAL" and not told:
            faults.append(f"trigger {self.node_id} is ABNORMAL")
        return faults

    def parachute_status(self, now: float) -> ParachuteStatus:
        """The picture of a parachute that has no controller."""
        by_name = {"NOT_READY": ParachuteState.NOT_READY, "READY": ParachuteState.READY}
        state = by_name.get(self.state, ParachuteState.UNKNOWN)
        if self.starting:
            state = ParachuteState.NOT_READY
        if self.state == "ABNORMAL" or self.overdue(now) or self.unhealthy:
            state = ParachuteState.ABNORMAL
        if self.launched:
            state = ParachuteState.LAUNCHED
        return ParachuteStatus(
            device=self.device,
            link_state=self.liveness.state,
            state=state,
            deployed=self.launched,
            backup_voltage=self.number("supply_voltage"),
            uptime=self.uptime,
            faults=tuple(self.faults(now)),
        )

    def _says_launched(self, values: Mapping[str, Any]) -> bool:
        state = self.definitions.state_name(names.TRIGGER_STATUS, values)
        return bool(values.get("is_launched")) or state == "LAUNCHED"


class Controller(Device):
    """Follows one controller, and checks what it does against the table of states."""

    kind = "controller"

    def __init__(self, node_id: int, config: UpfConfig, definitions: Definitions) -> None:
        super().__init__(node_id, config, definitions)
        self.state = ParachuteState.UNKNOWN
        self.state_since = math.nan
        #: Parameters as the device told them last.
        self.parameters: dict[str, p.Value | None] = {}
        self.unknown_jumps = 0
        self.newest_unknown_jump = ""
        self._number = 0

    def status_message(self, values: Mapping[str, Any], now: float) -> list[LinkChange]:
        """A ParachuteStatus. Whatever the device says is so; what the table knows is checked."""
        self._number = values["state"]
        state = self.definitions.state(self._number) or ParachuteState.UNKNOWN
        if not is_known_jump(self.state, state):
            self.unknown_jumps += 1
            self.newest_unknown_jump = f"{self.state.name} to {state.name}"
        if state is not self.state:
            self.state_since = now
        self.state = state
        return self.take_status(names.PARACHUTE_STATUS, values, now)

    @property
    def deployed(self) -> bool:
        """Its own newest status says that the parachute is out."""
        return self.state in DEPLOYED

    def switch(self, name: str) -> bool | None:
        """A parameter that switches something; None: not known."""
        return p.as_switch(self.parameters.get(name))

    def faults(self, now: float) -> list[str]:
        """What is wrong, in words."""
        faults = self.link_faults(now, "ParachuteStatus")
        told = self._told_errors()
        faults += told
        if self.state is ParachuteState.ABNORMAL and not told:
            faults.append("state ABNORMAL")
        if self.values and self.state is ParachuteState.UNKNOWN:
            faults.append(f"state {self._number} has no name")
        if self.values.get("is_vehicle_connected") is False:
            faults.append("the controller does not receive our VehicleStatus")
        if self.switch(p.ENABLE_PARACHUTE) is False:
            faults.append(f"{p.ENABLE_PARACHUTE} is off: it never deploys")
        aps_off = self.values.get("is_enable_auto_launch") is False
        if aps_off or self.switch(p.ENABLE_APS) is False:
            faults.append(f"{p.ENABLE_APS} is off: it deploys only by command")
        return faults

    @property
    def never_deploys(self) -> bool:
        """Its global switch is off: by its parameter, or where that was not read by its status, in
        which the name of the bit is assumed: it costs no deploy of one that says it is enabled."""
        switch = self.switch(p.ENABLE_PARACHUTE)
        told = map(_error_name, self._told_errors())
        return switch is False or (switch is None and _DISABLED in told)

    def _told_errors(self) -> list[str]:
        return self.definitions.faults(names.PARACHUTE_STATUS, self.values)

    def status(self, now: float, triggers: list[Trigger]) -> ParachuteStatus:
        """The normalised picture at now, with those of its triggers that are there."""
        flags = ErrorFlags(0)
        for one in self._told_errors():
            flags |= _FLAGS.get(_error_name(one), _ANY_OTHER)
        fired = any(trigger.launched and trigger.alive for trigger in triggers)
        faults = self.faults(now)
        for trigger in triggers:
            faults += trigger.faults(now)
        armed = self.state is ParachuteState.ARMED
        return ParachuteStatus(
            device=self.device,
            link_state=self.liveness.state,
            state=self._normalised(now, fired),
            armed=armed,
            deployed=self.deployed or fired,
            armed_triggers=TriggerFlags.ATS if armed else TriggerFlags(0),
            error_flags=flags,
            safety_flags=(
                SafetyFlags.ON_GROUND if self.state is ParachuteState.TOUCHDOWN else SafetyFlags(0)
            ),
            height=self.number("height_of_home"),
            backup_voltage=self.number("backup_power_voltage"),
            uptime=self.uptime,
            faults=tuple(faults),
        )

    def _normalised(self, now: float, fired: bool) -> ParachuteState:
        """Deployed wins over all; a fault wins over the rest."""
        if self.deployed:
            return self.state
        if fired:
            return ParachuteState.LAUNCHED
        if self.state in (ParachuteState.UNKNOWN, ParachuteState.NOT_READY) or not self.values:
            return self.state
        if self.overdue(now) or self.unhealthy or self.never_deploys:
            return ParachuteState.ABNORMAL
        return ParachuteState.NOT_READY if self.starting else self.state
