"""A Flyfire UPF parachute on a DroneCAN bus."""

from __future__ import annotations

from chute_ros.links.api import (
    AUTOPILOT_LINK,
    SUPERVISOR,
    ConnectionArgument,
    LinkKind,
    Sockets,
    VehicleKind,
)
from chute_ros.links.upf.protocol.parameters import AUTOMATIC

_FOLDER = "chute_ros.links.upf"
_NAME = "upf_can"
_BOTH = [AUTOPILOT_LINK, _NAME]


def _simulators(vehicle: VehicleKind, sockets: Sockets) -> tuple[tuple[str, ...], ...]:
    # As a controller is delivered it takes off, arms, disarms and lands by itself, and refuses to
    # be told to: safety/arm would never succeed.
    by_command = [part for name in AUTOMATIC for part in ("--parameter", f"{name}=false")]
    feels = ("--vehicle", f"udpout:{sockets.air}")
    return (("sim_upf", "--connection", sockets.bus, *feels, *by_command),)


LINK = LinkKind(
    name=_NAME,
    description="a Flyfire UPF parachute on a DroneCAN bus",
    node=f"{_FOLDER}.node:UpfCanNode",
    parameters=f"{_FOLDER}.parameters:UpfParameters",
    argument=ConnectionArgument("bus", "address of the CAN bus of a UPF"),
    vehicles=(
        VehicleKind(
            "upf",
            "a UPF parachute on DroneCAN and a MAVLink autopilot",
            (AUTOPILOT_LINK, _NAME),
            {
                AUTOPILOT_LINK: {"expect_parachute": False},
                SUPERVISOR: {
                    "required_links": _BOTH,
                    "deploy_links": [_NAME],
                    "deploy_ladder": [_NAME, f"{_NAME}:trigger"],
                },
            },
            often=3,
        ),
        VehicleKind(
            "both",
            "a MAVLink parachute and a UPF parachute on DroneCAN",
            (AUTOPILOT_LINK, _NAME),
            {
                SUPERVISOR: {
                    "required_links": _BOTH,
                    "deploy_links": _BOTH,
                    "deploy_ladder": [*_BOTH, f"{_NAME}:trigger"],
                }
            },
            often=2,
        ),
    ),
    simulators=_simulators,
    connection=lambda sockets: sockets.bus,
    part=f"{_FOLDER}.virtual:UpfPart",
    device="upf",
    kit=f"{_FOLDER}.kit:KIT",
    stops_motors=False,
)
