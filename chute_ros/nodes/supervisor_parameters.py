"""The parameters of safety_supervisor and what they become."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chute_ros.nodes.parameters import Parameter, liveness_from
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.inputs import Mode

PARAMETERS = (
    Parameter(
        "mode",
        "ACTIVE",
        "mode at the start; SHADOW decides and says it, INHIBITED does nothing",
        choices=tuple(mode.name for mode in Mode),
    ),
    Parameter(
        "required_links",
        ["mavlink_parachute"],
        "links whose health flight depends on (node names)",
    ),
    Parameter("kill_links", ["mavlink_parachute"], "links that stop the motors (node names)"),
    Parameter(
        "deploy_links", ["mavlink_parachute"], "links that release a parachute (node names)"
    ),
    Parameter(
        "heartbeat_stale_after", 0.5, "a node silent for this long is STALE, s", 0.05, 600.0
    ),
    Parameter("heartbeat_lost_after", 1.0, "a node silent for this long is LOST, s", 0.05, 600.0),
    Parameter("startup_grace", 10.0, "how long links may take to come up, s", 0.0, 60.0),
    Parameter(
        "kill_to_deploy_delay",
        0.5,
        "the deploy waits for the kill's confirmation, but no longer than this, s",
        0.0,
        60.0,
    ),
    Parameter("deploy_timeout", 8.0, "how long a deploy may take to be confirmed, s", 0.1, 60.0),
    Parameter("kill_timeout", 6.0, "how long a kill may take to be confirmed, s", 0.1, 60.0),
    Parameter(
        "resend_interval",
        0.1,
        "a decision that nobody reported on is sent again after, s",
        0.02,
        60.0,
    ),
    Parameter(
        "vehicle_state_age",
        2.5,
        "parts of vehicle/state that are older do not count, s",
        0.1,
        60.0,
    ),
    Parameter(
        "require_vehicle_state",
        True,
        "block flight without vehicle/state: nobody could tell flight from ground",
    ),
    Parameter(
        "takeoff_height",
        2.0,
        "armed and higher is in the air, where no landed state is known, m",
        0.1,
        100.0,
    ),
)


def config_from(values: Mapping[str, Any]) -> SupervisorConfig:
    """The settings of the core; ParameterError where two parameters contradict each other."""
    return SupervisorConfig(
        required_links=tuple(values["required_links"]),
        kill_links=tuple(values["kill_links"]),
        deploy_links=tuple(values["deploy_links"]),
        heartbeat=liveness_from(values, "heartbeat"),
        startup_grace=values["startup_grace"],
        kill_to_deploy_delay=values["kill_to_deploy_delay"],
        deploy_timeout=values["deploy_timeout"],
        kill_timeout=values["kill_timeout"],
        resend_interval=values["resend_interval"],
        vehicle_state_age=values["vehicle_state_age"],
        require_vehicle_state=values["require_vehicle_state"],
        takeoff_height=values["takeoff_height"],
    )
