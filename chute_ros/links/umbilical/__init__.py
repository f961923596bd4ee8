"""A rocket's flight computer on a serial umbilical."""

from __future__ import annotations

from chute_ros.links.api import SUPERVISOR, ConnectionArgument, LinkKind, Sockets, VehicleKind

_FOLDER = "chute_ros.links.umbilical"
_NAME = "umbilical"


def _simulators(vehicle: VehicleKind, sockets: Sockets) -> tuple[tuple[str, ...], ...]:
    return (("sim_flight_computer", "--link", sockets.terminal),)


LINK = LinkKind(
    name=_NAME,
    description="a rocket's flight computer on a serial umbilical",
    node=f"{_FOLDER}.node:UmbilicalNode",
    parameters=f"{_FOLDER}.parameters:UmbilicalParameters",
    argument=ConnectionArgument("cable", "serial port of an umbilical"),
    vehicles=(
        VehicleKind(
            "umbilical",
            "a flight computer on a serial umbilical",
            (_NAME,),
            {
                _NAME: {"publish_vehicle_state": True},
                SUPERVISOR: {
                    "required_links": [_NAME],
                    "kill_links": [_NAME],
                    "deploy_links": [_NAME],
                    "profile": "rocket",
                },
            },
            often=2,
            rig=f"{_FOLDER}.virtual:RocketRig",
        ),
    ),
    simulators=_simulators,
    connection=lambda sockets: f"serial:{sockets.terminal}",
    part=f"{_FOLDER}.virtual:UmbilicalPart",
    device=_NAME,
    kit=f"{_FOLDER}.kit:KIT",
)
