"""A parachute on a MAVLink network, and the autopilot there."""

from __future__ import annotations

from chute_ros.links.api import AUTOPILOT_LINK, ConnectionArgument, LinkKind, Sockets, VehicleKind

_FOLDER = "chute_ros.links.mavlink"


def carries_parachute(vehicle: VehicleKind) -> bool:
    """Return whether the vehicle's parachute is on the MAVLink network."""
    return bool(vehicle.given(AUTOPILOT_LINK, "expect_parachute", True))


def _simulators(vehicle: VehicleKind, sockets: Sockets) -> tuple[tuple[str, ...], ...]:
    network = ("--connection", f"udpout:{sockets.network}")
    autopilot = ("sim_autopilot", *network, "--connection", f"udpin:{sockets.air}")
    feels = ("--connection", f"udpout:{sockets.air}")
    parachute = ("sim_mavlink_parachute", *network, *feels)
    return (autopilot, parachute) if carries_parachute(vehicle) else (autopilot,)


LINK = LinkKind(
    name=AUTOPILOT_LINK,
    description="a parachute on a MAVLink network, and the autopilot there",
    node=f"{_FOLDER}.node:MavlinkParachuteNode",
    parameters=f"{_FOLDER}.parameters:MavlinkParameters",
    argument=ConnectionArgument("connection", "address of the MAVLink network"),
    vehicles=(
        VehicleKind(
            "mavlink", "a MAVLink parachute, all as delivered", (AUTOPILOT_LINK,), {}, often=4
        ),
    ),
    simulators=_simulators,
    connection=lambda sockets: f"udpin:{sockets.network}",
    part=f"{_FOLDER}.virtual:MavlinkPart",
    device="mavlink",
    kit=f"{_FOLDER}.kit:KIT",
)
