"""Warnings about this autopilot's settings before flight, each reported once.

Which way a kill goes, what stands against it, and whether a flight block can be kept.
"""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.mavlink.protocol.autopilot import AutopilotTracker
from chute_ros.links.mavlink.protocol.autopilot_settings import AutopilotSettings
from chute_ros.links.mavlink.protocol.firmware import Firmware
from chute_ros.links.mavlink.protocol.kill import KillPlan
from chute_ros.protocol.events import Severity


@dataclass(frozen=True)
class Setup:
    """The set-up of one autopilot, in words."""

    firmware: str
    kill: str
    block: str
    #: Forbids take-off; empty: nothing does.
    fault: str
    warnings: tuple[str, ...]
    #: Each of the autopilot's parameters that matter here, with its value.
    settings: dict[str, str]


def setup_of(autopilot: AutopilotTracker, plan: KillPlan, own_system_id: int) -> Setup:
    """As far as the autopilot has told it."""
    settings = autopilot.settings
    warnings = [plan.warning(), _block_warning(settings, own_system_id), *_by_itself(settings)]
    return Setup(
        settings.firmware.value,
        plan.text(),
        _block_text(settings, own_system_id),
        plan.fault(),
        tuple(text for text in warnings if text),
        settings.texts(),
    )


def _by_itself(settings: AutopilotSettings) -> list[str]:
    """What the autopilot does, or does to our measurements, without us."""
    told = []
    if settings.silent:
        told.append(
            f"{settings.firmware.value} answers no parameter request: its settings are not known"
        )
    if settings.firmware is Firmware.PX4 and settings.get("CBRK_FLIGHTTERM") == 0:
        told.append(
            "CBRK_FLIGHTTERM is 0: PX4 terminates, and releases, by its own failure detector too"
        )
    if settings.get("CHUTE_ENABLED") == 1:
        told.append("CHUTE_ENABLED is 1: the autopilot releases a parachute of its own")
    if settings.get("HOME_RESET_ALT") == 0:
        told.append(
            "HOME_RESET_ALT is 0: the autopilot sets its height to zero when it is disarmed, also "
            "by a kill in the air; set it to -1"
        )
    return told


def _asks(settings: AutopilotSettings, system_id: int) -> bool:
    """The autopilot asks system_id before it arms."""
    wanted = settings.get("COM_ARM_AUTH_REQ") == 1
    return wanted and settings.get("COM_ARM_AUTH_ID") == system_id


def _block_text(settings: AutopilotSettings, system_id: int) -> str:
    """How a flight block is kept, for a person before flight."""
    if _asks(settings, system_id):
        return "the autopilot asks us before it arms"
    return "a vehicle that arms on the ground is disarmed"


def _block_warning(settings: AutopilotSettings, system_id: int) -> str:
    """Why a flight block may not be kept; empty: nothing known."""
    if settings.firmware is not Firmware.PX4 or _asks(settings, system_id):
        return ""
    no_ramp = settings.get("MPC_TKO_RAMP_T") == 0 or settings.absent("MPC_TKO_RAMP_T")
    if settings.get("COM_SPOOLUP_TIME") == 0 and no_ramp:
        return (
            "a flight block may not hold: COM_SPOOLUP_TIME is 0 and MPC_TKO_RAMP_T is "
            f"{settings.text('MPC_TKO_RAMP_T')}, the vehicle takes off before its arming is "
            "undone; set COM_SPOOLUP_TIME to 1, or COM_ARM_AUTH_REQ to 1 and COM_ARM_AUTH_ID to "
            f"{system_id}"
        )
    if settings.get("COM_ARM_AUTH_REQ") == 1:
        return (
            f"COM_ARM_AUTH_ID is {settings.text('COM_ARM_AUTH_ID')}, and not our system id "
            f"{system_id}: the autopilot asks another component before it arms"
        )
    return ""


class SetupNews:
    """Says a set-up when it is first complete, and what changes of it."""

    def __init__(self) -> None:
        self._told: dict[str, set[str]] = {}

    def news(self, device: str, setup: Setup) -> list[tuple[Severity, str]]:
        """What was not said yet of the autopilot with this name."""
        said = [(Severity.INFO, f"autopilot {device} ({setup.firmware}): kill by {setup.kill}")]
        said += [(Severity.WARNING, f"autopilot {device}: {text}") for text in setup.warnings]
        if setup.fault:
            said.append((Severity.ERROR, f"forbids take-off: autopilot {device}: {setup.fault}"))
        told = self._told.get(device, set())
        self._told[device] = {text for _, text in said}
        return [(severity, text) for severity, text in said if text not in told]
