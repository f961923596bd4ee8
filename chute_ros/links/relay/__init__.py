"""A parachute without telemetry, fired by a relay, GPIO or PWM output."""

from __future__ import annotations

from chute_ros.links.api import (
    AUTOPILOT_LINK,
    SUPERVISOR,
    ConnectionArgument,
    LinkKind,
    Sockets,
    VehicleKind,
)

_FOLDER = "chute_ros.links.relay"
_NAME = "relay"


def _simulators(vehicle: VehicleKind, sockets: Sockets) -> tuple[tuple[str, ...], ...]:
    return (("sim_relay", "--link", sockets.terminal, "--vehicle", f"udpout:{sockets.air}"),)


LINK = LinkKind(
    name=_NAME,
    description="a parachute without telemetry, fired by a relay, GPIO or PWM output",
    node=f"{_FOLDER}.node:RelayNode",
    parameters=f"{_FOLDER}.parameters:RelayParameters",
    argument=ConnectionArgument("output", "output that fires a parachute without telemetry"),
    vehicles=(
        VehicleKind(
            "relay",
            "a parachute on a relay output and a MAVLink autopilot",
            (AUTOPILOT_LINK, _NAME),
            {
                AUTOPILOT_LINK: {"expect_parachute": False},
                SUPERVISOR: {
                    "required_links": [AUTOPILOT_LINK, _NAME],
                    "deploy_links": [_NAME],
                    "unmonitored_links": [_NAME],
                },
            },
            often=10,
            replaces="mavlink",
        ),
    ),
    simulators=_simulators,
    connection=lambda sockets: f"serial:{sockets.terminal}",
    part=f"{_FOLDER}.virtual:RelayPart",
    stops_motors=False,
)
