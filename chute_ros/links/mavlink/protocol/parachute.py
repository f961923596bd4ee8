"""Status of one MAVLink parachute, normalised.

Source: Parachute Protocol, "Parachute Connection" (heartbeat, type, component id) and "STATUS".
"""

from __future__ import annotations

import datetime
import math
import re
from dataclasses import dataclass
from typing import Any

from chute_ros.links.mavlink.protocol import results
from chute_ros.links.mavlink.protocol.answers import Answers
from chute_ros.links.mavlink.protocol.twins import Twins
from chute_ros.model import (
    TRIGGER_SOURCES,
    DeploymentTrigger,
    ErrorFlags,
    LinkState,
    ParachuteState,
    ParachuteStatus,
    SafetyFlags,
    TriggerFlags,
    flag_names,
)
from chute_ros.protocol.boot_clock import Age, BootClock
from chute_ros.protocol.liveness import DeviceTracker, LinkChange, LivenessLimits
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.settings import Settings, parameter

_UNHEALTHY_STATES = {
    dialect.MAV_STATE_CRITICAL: "critical",
    dialect.MAV_STATE_EMERGENCY: "emergency",
    dialect.MAV_STATE_POWEROFF: "powering off",
    dialect.MAV_STATE_FLIGHT_TERMINATION: "flight termination",
}
_STARTING_STATES = {
    dialect.MAV_STATE_BOOT: "starting",
    dialect.MAV_STATE_CALIBRATING: "calibrating",
}
#: Without a status for so long it is asked for, s: the stream nominally brings one each second.
_STATUS_MISSED = 1.5
#: And for the next of a doubtful one not more often than so, s.
_ASK_AGAIN = 0.1
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")


@dataclass(frozen=True)
class ComponentInformation:
    """COMPONENT_INFORMATION_BASIC (MAVLink message 396) of one device."""

    vendor_name: str
    model_name: str
    software_version: str
    hardware_version: str
    serial_number: str
    manufacture_date: str  # YYYY-MM-DD in UTC, empty: not given
    capabilities: int
    uptime: float  # s


@dataclass(frozen=True)
class StatusLimits(Settings):
    """What of a PARACHUTE_STATUS is a fault."""

    status_timeout: float = parameter(
        3.5, "a PARACHUTE_STATUS older than this is a fault", 0.1, 600.0, "s"
    )
    ignored_errors: ErrorFlags = parameter(
        ErrorFlags(0),
        "mask of PARACHUTE_ERROR_FLAGS that are not faults of this parachute",
        0,
        2**32 - 1,
        name="ignored_error_flags",
    )


def packed_date(text: str) -> tuple[str, str]:
    """The packed date in text and what is wrong with it: (date, "") or ("", fault).

    "YYYY-MM-DD"; empty text: not given, which is no fault.
    """
    if not text:
        return "", ""
    try:
        if not _DATE.fullmatch(text):
            raise ValueError
        datetime.date.fromisoformat(text)
    except ValueError:
        return "", f"packed date {text!r} is no date YYYY-MM-DD"
    return text, ""


def component_information(message: Any) -> ComponentInformation:
    """What a COMPONENT_INFORMATION_BASIC says."""
    manufactured = ""
    if message.time_manufacture_s:
        epoch = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
        when = epoch + datetime.timedelta(seconds=message.time_manufacture_s)
        manufactured = when.date().isoformat()
    return ComponentInformation(
        message.vendor_name,
        message.model_name,
        message.software_version,
        message.hardware_version,
        message.serial_number,
        manufactured,
        message.capabilities,
        message.time_boot_ms / 1000.0,
    )


class ParachuteTracker(DeviceTracker):
    """Follows one parachute, told apart from others by its system and component id."""

    def __init__(
        self, system_id: int, component_id: int, liveness: LivenessLimits, status: StatusLimits
    ) -> None:
        super().__init__(liveness, status.status_timeout)
        self.system_id = system_id
        self.component_id = component_id
        self.information: ComponentInformation | None = None
        self.reboot_count = 0
        self.answers = Answers()
        self._clock = BootClock()
        self._twins = Twins()
        self._ignored_errors = int(status.ignored_errors)
        self._system_status = 0
        self._message: Any = None
        #: A status came that may be the first after a restart, or a delayed one from before.
        self._doubtful = False
        self._asked = -math.inf
        #: Of an arming or disarming: the newest refusal, and when it came.
        self._arming_refusal, self._arming_refused_at = "", -math.inf

    @property
    def device(self) -> str:
        """ "system/component"."""
        return f"{self.system_id}/{self.component_id}"

    @property
    def deployed(self) -> bool:
        """The device's own newest status says that the parachute was released."""
        return self._message is not None and self._message.deployment_status != 0

    @property
    def ground_cleared(self) -> bool:
        """The newest status says that it is far enough from the ground."""
        return self._message is not None and bool(
            self._message.safety_status & SafetyFlags.GROUND_CLEARED
        )

    @property
    def armed_triggers(self) -> TriggerFlags:
        """The trigger sources that are armed by the newest status."""
        return TriggerFlags(self._message.arm_status if self._message is not None else 0)

    def arming_answered(self, result: int, now: float) -> None:
        """It answered MAV_CMD_SET_PARACHUTE_ARM."""
        if result not in (results.ACCEPTED, results.IN_PROGRESS):
            self._arming_refusal, self._arming_refused_at = results.result_text(result), now

    def arming_refusal(self, since: float) -> str:
        """Its newest refusal to arm or to disarm since then, in words; empty: there was none."""
        return self._arming_refusal if self._arming_refused_at >= since else ""

    def heartbeat(self, message: Any, now: float) -> list[LinkChange]:
        """A HEARTBEAT of the device."""
        self._system_status = message.system_status
        changes = self.liveness.heard(now)
        if any(change.regained for change in changes):
            self.answers = Answers()
        return changes

    def parachute_status(self, message: Any, now: float) -> None:
        """A PARACHUTE_STATUS of the device."""
        if not self._twins.observe("PARACHUTE_STATUS", message.time_boot_ms, now):
            return
        age = self._clock.observe(message.time_boot_ms)
        if age is Age.RESTARTED and not self._twins.found(now):
            self.reboot_count += 1
            self.answers.restarted()
        self._doubtful = age is Age.DOUBTFUL
        if age in (Age.OLD, Age.DOUBTFUL):
            # Delayed: it must not undo what a newer one said.
            return
        self.status_came(now)
        self._message = message

    def component_information(self, message: Any) -> None:
        """A COMPONENT_INFORMATION_BASIC of the device."""
        self.information = component_information(message)

    def doubt(self, now: float) -> str:
        """Another device uses the same ids, in words; empty: none does."""
        return self._twins.doubt(f"two parachutes have the ids {self.device}", now)

    def deaf(self, now: float) -> str:
        """That it does not hear us, in words; empty: nothing tells so."""
        heard = self.liveness.state is LinkState.OK
        fault = self.answers.fault("command", now) if heard else ""
        return f"parachute {self.device} {fault}" if fault else ""

    def question_due(self, now: float) -> bool:
        """It is to be asked something now, to know that it hears us."""
        heard = self.liveness.state is LinkState.OK
        return heard and self.answers.due(self.liveness.since, now)

    def status_due(self, now: float) -> bool:
        """It is to be asked for its status now (MAV_CMD_REQUEST_MESSAGE; the full protocol only
        recommends the stream): none has come for too long, or a doubtful one."""
        if self.liveness.state is not LinkState.OK:
            return False
        wait = _ASK_AGAIN if self._doubtful else _STATUS_MISSED
        known = self.liveness.first_heard if self._message is None else self.status_received
        if now < max(known, self._asked) + wait:
            return False
        self._asked = now
        return True

    def status(self, now: float) -> ParachuteStatus:
        """The normalised picture at now."""
        faults = self._faults(now)
        message = self._message
        if message is None:
            state, link_state = self._state(now), self.liveness.state
            return ParachuteStatus(self.device, link_state, state, faults=tuple(faults))
        date, wrong = packed_date(message.parachute_packed_date)
        return ParachuteStatus(
            device=self.device,
            link_state=self.liveness.state,
            state=self._state(now),
            armed=bool(self.armed_triggers & TRIGGER_SOURCES),
            deployed=self.deployed,
            deployment_trigger=message.deployment_status,
            armed_triggers=self.armed_triggers,
            error_flags=ErrorFlags(message.error_status),
            safety_flags=SafetyFlags(message.safety_status),
            ats_arm_altitude=float(message.ats_arm_altitude),
            uptime=message.time_boot_ms / 1000.0,
            packed_date=date,
            faults=tuple([*faults, wrong] if wrong else faults),
        )

    @property
    def _errors(self) -> ErrorFlags:
        """The error flags that matter. On whole numbers: ~ of a flag drops the unnamed bits."""
        return ErrorFlags(self._message.error_status & ~self._ignored_errors)

    @property
    def _unhealthy(self) -> str:
        """What is wrong by the heartbeat; empty: nothing."""
        if self._system_status > dialect.MAV_STATE_FLIGHT_TERMINATION:
            return f"state {self._system_status}, which has no name"
        return _UNHEALTHY_STATES.get(self._system_status, "")

    def _faults(self, now: float) -> list[str]:
        faults = []
        silence = self.liveness.age(now)
        if self.liveness.state in (LinkState.STALE, LinkState.LOST):
            faults.append(f"heartbeat {self.liveness.state.name}: {silence:.1f} s old")
        if self._unhealthy:
            faults.append(f"heartbeat reports {self._unhealthy}")
        if self._message is None:
            return [*faults, "no PARACHUTE_STATUS received"]
        if self.overdue(now):
            faults.append(f"PARACHUTE_STATUS {now - self.status_received:.1f} s old")
        faults += flag_names(self._errors)
        if self._message.deployment_status > max(DeploymentTrigger):
            faults.append(f"deployment trigger {self._message.deployment_status} has no name")
        for kind, flags in (
            ("safety flag", flag_names(SafetyFlags(self._message.safety_status))),
            ("trigger flag", flag_names(self.armed_triggers)),
        ):
            faults += [f"{kind} {name} has no name" for name in flags if name.startswith("bit ")]
        return faults

    def _state(self, now: float) -> ParachuteState:
        """Onto the UPF numbering. Deployed wins over all; a fault wins over the rest."""
        message = self._message
        if message is not None and message.deployment_status != 0:
            on_ground = message.safety_status & SafetyFlags.ON_GROUND
            return ParachuteState.TOUCHDOWN if on_ground else ParachuteState.LAUNCHED
        if self._system_status in _STARTING_STATES:
            return ParachuteState.NOT_READY
        if self.liveness.state is LinkState.NEVER_SEEN or message is None:
            return ParachuteState.UNKNOWN
        if self._errors or self._unhealthy or self.overdue(now):
            return ParachuteState.ABNORMAL
        if self.armed_triggers & TRIGGER_SOURCES:
            return ParachuteState.ARMED
        cleared = message.safety_status & SafetyFlags.GROUND_CLEARED
        on_ground = message.safety_status & SafetyFlags.ON_GROUND
        return ParachuteState.TAKEOFF if cleared and not on_ground else ParachuteState.READY
