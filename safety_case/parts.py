"""Parts that may fail and control actions, each with what it stands for in the code's own lists:
no section of the FMEA or of the STPA can be missing."""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping

from chute_ros.campaign.scenario import part
from chute_ros.links.api import SUPERVISOR, VehicleKind
from chute_ros.links.registered import links
from chute_ros.model import Action
from chute_ros.protocol.vehicle_merge import AUTOPILOTS, IMU, ODOMETRY
from safety_case.documents import ROOT

#: Links of this repository, and the vehicles that they register. The case is of no others.
LINKS = {name: kind for name, kind in links().items() if kind.package == "chute_ros"}
VEHICLES = {one.name: one for kind in LINKS.values() for one in kind.vehicles}

#: Section of fmea.sdoc -> nodes, devices and sources of the vehicle's state that it speaks of.
#: A section without any is a part that the code has no list of. A link has one wire, which stands
#: in the section of what hangs on it.
PARTS: Mapping[str, tuple[str, ...]] = {
    "mavlink_parachute: the parachute and its wire": ("parachute",),
    "mavlink_parachute: the autopilot": ("vehicle/state",),
    "upf_can: the controller and the bus": ("controller",),
    "upf_can: the trigger": ("trigger",),
    "umbilical: the flight computer and the cable": (),
    "relay: an output without telemetry": ("board",),
    "other sources of the vehicle": ("odometry", "imu", "mavros"),
    "a device node": ("mavlink_parachute", "upf_can", "umbilical", "relay"),
    "the ROS network and its middleware": (),
    "the supervisor": ("safety_supervisor",),
    "a hot standby": ("standby",),
    # A recorder only listens: what it takes is processor and disk.
    "the computer: clock, memory, processor, disk, power": ("recorder",),
    "a person at chute, the panel or a service": ("chute", "panel", "console", "deploy_action"),
    "profile, parameters and other settings": (),
    "barometer, IMU and receiver of the autopilot": (),
    "motors, ESCs and the way of the kill": (),
    "routers, hubs and supplies between the parts": (),
    "the canopy and its charge": (),
}
#: Section of stpa.sdoc -> decisions and services of the supervisor that give this action.
ACTIONS: Mapping[str, tuple[str, ...]] = {
    "Flight block": ("FLIGHT_BLOCK",),
    "Release of the flight block": ("FLIGHT_BLOCK_RELEASE",),
    "Kill": ("KILL", "safety/kill"),
    "Deploy": ("DEPLOY", "safety/deploy"),
    "Arm the parachute": ("safety/arm",),
    "Disarm the parachute": ("safety/arm",),
    "Reset": ("safety/reset",),
    "Change of mode (ACTIVE, SHADOW, INHIBITED)": ("safety/set_mode",),
}


def without_section() -> Iterable[str]:
    """What the code has and no section above speaks of, each in a line."""
    for name in LINKS:
        if not any(section.startswith(f"{name}: ") for section in PARTS):
            yield f"the link {name} has no part in safety_case/parts.py"
    spoken = {name for names in PARTS.values() for name in names}
    for name in sorted({*_nodes(), *_devices(), *AUTOPILOTS, ODOMETRY, IMU} - spoken):
        yield f"{name} has no part in safety_case/parts.py"
    actions = {one.name for one in Action if one is not Action.NONE}
    given = {name for names in ACTIONS.values() for name in names}
    for name in sorted({*actions, *_services()} - given):
        yield f"{name} has no control action in safety_case/parts.py"


def carried_by(section: str) -> list[str]:
    """The vehicles of config/ that have this part; all, if it is not one of a link."""
    link = section.partition(": ")[0]
    all_vehicles = VEHICLES.values()
    if link not in LINKS:
        return [vehicle.name for vehicle in all_vehicles]
    devices = {*PARTS[section]} & _devices()
    return [
        vehicle.name
        for vehicle in all_vehicles
        if link in vehicle.links and (not devices or devices & _devices_of(vehicle))
    ]


def _devices() -> set[str]:
    return {device for vehicle in VEHICLES.values() for device in _devices_of(vehicle)}


def _devices_of(vehicle: VehicleKind) -> set[str]:
    """Those that the campaign takes the power from."""
    parts = (part(link) for link in vehicle.links if LINKS[link].part)
    return {device for one in parts for device in one.stopping(vehicle)}


@functools.cache
def _policy() -> ElementTree.Element:
    # Tests compare it with what each node offers and asks for.
    return ElementTree.parse(ROOT / "config" / "security" / "policy.xml").getroot()


def _nodes() -> set[str]:
    return {one.attrib["node"] for one in _policy().iter("profile")}


def _services() -> set[str]:
    offers = _policy().findall(
        f".//profile[@node='{SUPERVISOR}']/services[@reply='ALLOW']/service"
    )
    names = {(one.text or "").strip() for one in offers}
    return {name for name in names if name.startswith("safety/")}
