"""The parameters of mavlink_parachute and what they become."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chute_ros.links.mavlink.protocol.commands import CommandLimits
from chute_ros.links.mavlink.protocol.config import KillMethod, MavlinkConfig
from chute_ros.links.mavlink.protocol.parachute import StatusLimits
from chute_ros.model import ErrorFlags, TriggerFlags
from chute_ros.nodes.parameters import liveness_from
from chute_ros.protocol.effect import EffectLimits
from chute_ros.settings import Parameter
from chute_ros.transport.address import FORMS

PARAMETERS = (
    Parameter(
        "connection",
        "udppair:127.0.0.1:14541:127.0.0.1:14540",
        f"where the MAVLink network is: {FORMS}",
    ),
    Parameter("system_id", 1, "our own MAVLink system id: the vehicle's", 1, 255),
    Parameter("component_id", 191, "our own MAVLink component id", 1, 255),
    Parameter(
        "expect_parachute",
        True,
        "a parachute is on this network; false: it is on another link, and this one's heartbeat "
        "stands for the autopilot",
    ),
    Parameter(
        "parachute_system_id", 0, "system id of our parachutes; 0: of the first one heard", 0, 255
    ),
    Parameter("parachute_component_id", 0, "component id of our parachute; 0: any", 0, 255),
    Parameter(
        "autopilot_system_id", 0, "system id of our autopilot; 0: of the first one heard", 0, 255
    ),
    Parameter("autopilot_component_id", 1, "component id of our autopilot; 0: any", 0, 255),
    Parameter(
        "parachute_stale_after", 2.5, "parachute silent for this long is STALE, s", 0.1, 600.0
    ),
    Parameter(
        "parachute_lost_after", 5.0, "parachute silent for this long is LOST, s", 0.1, 600.0
    ),
    Parameter(
        "autopilot_stale_after", 2.5, "autopilot silent for this long is STALE, s", 0.1, 600.0
    ),
    Parameter(
        "autopilot_lost_after", 5.0, "autopilot silent for this long is LOST, s", 0.1, 600.0
    ),
    Parameter("status_timeout", 3.5, "PARACHUTE_STATUS older than this is a fault, s", 0.1, 600.0),
    Parameter(
        "ignored_error_flags",
        0,
        "mask of PARACHUTE_ERROR_FLAGS that are no fault of this product",
        0,
        2**32 - 1,
    ),
    Parameter(
        "ack_timeout", 0.2, "wait for an acknowledgement before sending again, s", 0.02, 60.0
    ),
    Parameter("ack_tries", 5, "how often a command is sent at most", 1, 100),
    Parameter("in_progress_timeout", 5.0, "wait after an answer IN_PROGRESS, s", 0.1, 600.0),
    Parameter(
        "late_ack_window", 5.0, "how long a late acknowledgement may still come, s", 0.1, 60.0
    ),
    Parameter(
        "effect_timeout",
        1.5,
        "from acknowledgement to effect, then the command is tried again, s",
        0.05,
        60.0,
    ),
    Parameter("retry_interval", 0.25, "between two tries, and between two looks, s", 0.02, 60.0),
    Parameter("give_up_after", 5.0, "for all tries of a command together, s", 0.1, 600.0),
    Parameter(
        "default_triggers",
        int(TriggerFlags.FC | TriggerFlags.OFFBOARD),
        "trigger sources that ~/arm means with 0: mask of PARACHUTE_TRIGGER_FLAGS",
        1,
        255,
    ),
    Parameter(
        "deploy_arms_trigger",
        True,
        "a deploy that the supervisor decided arms the flight-controller trigger on its way",
    ),
    Parameter(
        "kill_method",
        "auto",
        "which way the motors are stopped is tried first; the other follows where it fails, and "
        "none that releases a parachute is taken before a deploy was decided",
        choices=tuple(method.value for method in KillMethod),
    ),
    Parameter(
        "takeoff_height",
        2.0,
        "a flight block holds until the vehicle was higher than this above where it was armed, m",
        0.1,
        100.0,
    ),
    Parameter("disarm_when_blocked", True, "undo arming on the ground while flight is blocked"),
    Parameter(
        "autopilot_message_rate",
        10.0,
        "rate to ask of the autopilot for vehicle/state, Hz; 0: do not ask",
        0.0,
        100.0,
        changeable=True,
    ),
    Parameter(
        "needed_message_rate",
        5.0,
        "rate that the rules need of GLOBAL_POSITION_INT, ATTITUDE and SCALED_IMU each, Hz: below "
        "it take-off is forbidden; 0: not judged",
        0.0,
        100.0,
    ),
    Parameter(
        "signing_key_file",
        "",
        "file with the MAVLink signing key (32 bytes or 64 hexadecimal digits); empty: none",
    ),
    Parameter("signing_link_id", 0, "link id in our signatures", 0, 255),
)


def config_from(values: Mapping[str, Any]) -> MavlinkConfig:
    """The settings of the protocol; ParameterError where two parameters contradict each other."""
    return MavlinkConfig(
        system_id=values["system_id"],
        component_id=values["component_id"],
        parachute_system_id=values["parachute_system_id"],
        parachute_component_id=values["parachute_component_id"],
        autopilot_system_id=values["autopilot_system_id"],
        autopilot_component_id=values["autopilot_component_id"],
        parachute_liveness=liveness_from(values, "parachute"),
        autopilot_liveness=liveness_from(values, "autopilot"),
        status=StatusLimits(values["status_timeout"], ErrorFlags(values["ignored_error_flags"])),
        commands=CommandLimits(
            values["ack_timeout"],
            values["ack_tries"],
            values["in_progress_timeout"],
            values["late_ack_window"],
        ),
        effect=EffectLimits(
            values["effect_timeout"], values["retry_interval"], values["give_up_after"]
        ),
        default_triggers=TriggerFlags(values["default_triggers"]),
        kill_method=KillMethod(values["kill_method"]),
        autopilot_message_rate=values["autopilot_message_rate"],
        needed_message_rate=values["needed_message_rate"],
        disarm_when_blocked=values["disarm_when_blocked"],
        takeoff_height=values["takeoff_height"],
    )
