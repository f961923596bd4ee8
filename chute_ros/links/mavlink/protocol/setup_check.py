"""Warnings about this autopilot's settings before flight, each reported once.

Which way a kill goes, what stands against it, and whether a flight block can be kept.
"""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.mavlink.protocol import arm_authorization
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
    warnings = [
        plan.warning(),
        arm_authorization.block_warning(settings, own_system_id),
        *_by_itself(settings),
    ]
    return Setup(
        settings.firmware.value,
        plan.text(),
        arm_authorization.block_text(settings, own_system_id),
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
