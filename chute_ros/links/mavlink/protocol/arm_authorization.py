"""An autopilot that asks whether it may arm (MAV_CMD_ARM_AUTHORIZATION_REQUEST), and our answer.

PX4 does with COM_ARM_AUTH_REQ 1: it sends the command to the system COM_ARM_AUTH_ID, and arms only
if COMMAND_ACK says ACCEPTED, for result_param2 seconds (COM_ARM_AUTH_MET 0: the arming that asked;
1: the next one). Sources: MAVLink common.xml; PX4 ArmAuthorization.cpp.
"""

from __future__ import annotations

from typing import Any

from chute_ros.links.mavlink.protocol.autopilot_settings import AutopilotSettings
from chute_ros.links.mavlink.protocol.firmware import Firmware
from chute_ros.protocol.mavlink.dialect import dialect

#: An authorization holds for so long, s: short where the arming that asks is the one that arms.
_AT_ONCE, _TWO_STEPS = 1, 5


def is_request(message: Any, own_ids: tuple[int, int]) -> bool:
    """A command to us that asks whether the autopilot may arm."""
    if message.get_type() != "COMMAND_LONG":
        return False
    meant = message.target_system == own_ids[0] and message.target_component in (0, own_ids[1])
    return bool(meant and message.command == dialect.MAV_CMD_ARM_AUTHORIZATION_REQUEST)


def answer(asking: tuple[int, int], blocked: str, settings: AutopilotSettings) -> Any:
    """The COMMAND_ACK. blocked: why flight is blocked; empty: it is not."""
    result, reason, seconds = dialect.MAV_RESULT_ACCEPTED, 0, _TWO_STEPS
    if settings.get("COM_ARM_AUTH_MET") == 0:
        seconds = _AT_ONCE
    if blocked:
        result, seconds = dialect.MAV_RESULT_DENIED, 0
        reason = dialect.MAV_ARM_AUTH_DENIED_REASON_GENERIC
    return dialect.MAVLink_command_ack_message(
        dialect.MAV_CMD_ARM_AUTHORIZATION_REQUEST, result, reason, seconds, *asking
    )


def asks(settings: AutopilotSettings, system_id: int) -> bool:
    """The autopilot asks system_id before it arms."""
    wanted = settings.get("COM_ARM_AUTH_REQ") == 1
    return wanted and settings.get("COM_ARM_AUTH_ID") == system_id


def block_text(settings: AutopilotSettings, system_id: int) -> str:
    """How a flight block is kept, for a person before flight."""
    if asks(settings, system_id):
        return "the autopilot asks us before it arms"
    return "arming on the ground is undone"


def block_warning(settings: AutopilotSettings, system_id: int) -> str:
    """Why a flight block may not be kept; empty: nothing known."""
    if settings.firmware is not Firmware.PX4 or asks(settings, system_id):
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
