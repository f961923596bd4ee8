"""The parameters of umbilical and what they become."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol.config import (
    DeployStage,
    HeartbeatInFlight,
    MemoryLimits,
    UmbilicalConfig,
)
from chute_ros.links.umbilical.protocol.scheduler import SchedulerLimits
from chute_ros.nodes.parameters import Parameter, liveness_from
from chute_ros.protocol.effect import EffectLimits
from chute_ros.transport.address import SERIAL_FORMS

PARAMETERS = (
    Parameter(
        "connection",
        "usb:c0de:cafe",
        f"serial port of the flight computer, by path, by-id path or USB ids: {SERIAL_FORMS}",
    ),
    Parameter(
        "layout",
        "",
        "name of the $TELEM layout; empty: recognised by the lines that come",
    ),
    Parameter(
        "telem_path",
        "",
        "folder with $TELEM layouts (*.yaml) of your own; empty: the ones shipped",
    ),
    Parameter(
        "telemetry_stale_after", 3.0, "telemetry silent for this long is STALE, s", 0.05, 30.0
    ),
    Parameter(
        "telemetry_lost_after", 15.0, "telemetry silent for this long is LOST, s", 0.05, 600.0
    ),
    Parameter(
        "settle_time",
        0.2,
        "what comes within it after the port was opened is of before and is dropped, s",
        0.0,
        10.0,
    ),
    Parameter(
        "umbilical_heartbeat_interval",
        1.0,
        "between two <H> to the flight computer, s; its own limit is 3 to 15 s",
        0.25,
        5.0,
    ),
    Parameter(
        "umbilical_heartbeat_slack",
        0.5,
        "how much later a <H> may be for <V>, <D> and <d>, s",
        0.0,
        10.0,
    ),
    Parameter(
        "heartbeat_in_flight",
        HeartbeatInFlight.AUTO.value,
        "send <H> from Ascent until the landing; some firmware takes a connected umbilical in "
        "flight for a fault; auto: as the layout says, which is false for those shipped",
        choices=tuple(one.value for one in HeartbeatInFlight),
    ),
    Parameter(
        "command_spacing",
        0.12,
        "between two writes, s; the receiver sleeps 0.1 s after each command",
        0.1,
        1.0,
    ),
    Parameter(
        "effect_timeout",
        0.5,
        "from sending to effect, then a command that may be repeated is sent again, s",
        0.05,
        60.0,
    ),
    Parameter(
        "retry_interval",
        0.25,
        "before another try where a command found no place to wait, s",
        0.02,
        60.0,
    ),
    Parameter("give_up_after", 5.0, "for all tries of a command together, s", 0.1, 10.0),
    Parameter(
        "deploy_stage",
        DeployStage.DROGUE.value,
        "what ~/deploy and a decided deploy fire; next: the drogue, and the main once that is out "
        "or was fired from here",
        choices=tuple(stage.value for stage in DeployStage),
    ),
    Parameter(
        "decided_deploy_forces",
        True,
        "a deploy that the supervisor decided is sent in every flight mode",
    ),
    Parameter(
        "safe_opens_sv",
        False,
        "the firmware's <V> opens the SV to vent, where the reference has it closed",
    ),
    Parameter(
        "memory_answer_within",
        5.0,
        "from asking to the first sign of a dump or wipe, s",
        0.1,
        60.0,
    ),
    Parameter("dump_silence", 3.0, "a flash dump silent for this long is given up, s", 0.1, 600.0),
    Parameter("wipe_silence", 60.0, "a wipe silent for this long is given up, s", 0.1, 3600.0),
    Parameter(
        "fram_quiet",
        1.0,
        "a FRAM dump, which has no end mark, ends after this quiet, s",
        0.1,
        60.0,
    ),
    Parameter("dump_folder", "", "where dumps go; empty: under ROS_HOME (~/.ros)/chute_ros/dumps"),
    Parameter(
        "publish_vehicle_state",
        False,
        "publish vehicle/state by telemetry: where no autopilot on another link does",
    ),
)


def config_from(values: Mapping[str, Any]) -> UmbilicalConfig:
    """The settings of the protocol; ParameterError where two parameters contradict each other."""
    spacing, interval = values["command_spacing"], values["umbilical_heartbeat_interval"]
    if interval < 2 * spacing:
        raise ParameterError(
            f"parameter umbilical_heartbeat_interval is {interval} and command_spacing {spacing}: "
            "commands must fit in between; need an interval of at least two spacings"
        )
    return UmbilicalConfig(
        layout=values["layout"],
        telemetry=liveness_from(values, "telemetry"),
        scheduler=SchedulerLimits(spacing, interval, values["umbilical_heartbeat_slack"]),
        effect=EffectLimits(
            values["effect_timeout"], values["retry_interval"], values["give_up_after"]
        ),
        memory=MemoryLimits(
            values["memory_answer_within"],
            values["dump_silence"],
            values["wipe_silence"],
            values["fram_quiet"],
        ),
        settle_time=values["settle_time"],
        deploy=DeployStage(values["deploy_stage"]),
        safe_opens_sv=values["safe_opens_sv"],
        heartbeat_in_flight=HeartbeatInFlight(values["heartbeat_in_flight"]),
        decided_deploy_forces=values["decided_deploy_forces"],
    )
