"""The links that are installed, by their entries in the entry point group chute_ros.links."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType

from chute_ros.errors import NotRegisteredError
from chute_ros.links.api import AUTOPILOT_LINK, SUPERVISOR, LinkKind, VehicleKind

GROUP = "chute_ros.links"
#: What vehicle.launch.py and simulation.launch.py have besides the arguments of the links.
LAUNCH_ARGUMENTS = (
    "range",
    "namespace",
    "parachute",
    "config",
    "deploy_action",
    "enclaves",
    "port",
    "fly",
    "launch",
    "fail",
    "wind",
)
#: Parameters of the supervisor that name links.
_NAME_LINKS = ("required_links", "kill_links", "deploy_links", "unmonitored_links")
#: Those that the campaign takes from a vehicle. All others are known with ROS alone
#: (tools/launch_checks.py).
_FLOWN = (*_NAME_LINKS, "deploy_ladder", "profile")
#: As like that a parameter's name is another one misspelt, by difflib.
_MISSPELT = 0.85


@functools.cache
def links() -> Mapping[str, LinkKind]:
    """Return all links by the names of their nodes, in the order of their names; ours first.
    NotRegisteredError: there is none, an entry is wrong, or two have the same name for a node, a
    vehicle, a launch argument or a device."""
    # One that is found twice on the path is one.
    entries = sorted({(one.name, one.value): one for one in entry_points(group=GROUP)}.items())
    if not entries:
        raise NotRegisteredError(
            f"no link is registered (entry point group {GROUP}): build chute_ros and source "
            "install/setup.bash"
        )
    owners = {("node", SUPERVISOR): "the supervisor"}
    for name in LAUNCH_ARGUMENTS:
        owners["launch argument", name] = "the launch files of chute_ros"
    for _, entry in entries:
        _own(owners, [("node", entry.name)], entry)
    kinds = []
    for _, entry in entries:
        kinds.append(_kind(entry))
        _own(owners, _names(kinds[-1]), entry)
    kinds.sort(key=lambda one: (one.package != "chute_ros", one.name))
    return MappingProxyType({one.name: one for one in kinds})


@functools.cache
def vehicles() -> Mapping[str, VehicleKind]:
    """Return the vehicles that carry the device of any link, by their names. NotRegisteredError:
    one of them names what there is not."""
    every = {one.name: one for kind in links().values() for one in kind.vehicles}
    for vehicle in every.values():
        if problem := next(_problems(vehicle, every), ""):
            raise NotRegisteredError(
                f"vehicle {vehicle.name} of {package_of(vehicle.name)}: {problem}"
            )
    return MappingProxyType(every)


def package_of(vehicle: str) -> str:
    """Return the ROS package of the link that registers a vehicle."""
    return next(
        kind.package for kind in links().values() if vehicle in {one.name for one in kind.vehicles}
    )


def module_of(name: str) -> str:
    """Return the module of a node, for python -m."""
    if name == SUPERVISOR:
        return "chute_ros.ros.safety_supervisor"
    return links()[name].node.partition(":")[0].rpartition(".")[0]


def _kind(entry: EntryPoint) -> LinkKind:
    try:
        kind = entry.load()
    except (ImportError, AttributeError) as error:
        raise NotRegisteredError(f"{_told(entry)}: {error}") from error
    if not isinstance(kind, LinkKind) or kind.name != entry.name:
        raise NotRegisteredError(f"{_told(entry)}: need a LinkKind with the name {entry.name!r}")
    return kind


def _told(entry: EntryPoint) -> str:
    return f"{GROUP} {entry.name} = {entry.value}"


def _names(kind: LinkKind) -> Iterator[tuple[str, str]]:
    """What must not be another's, besides the node: what it is the name of, and the name."""
    yield "launch argument", kind.argument.name
    yield from (("vehicle", one.name) for one in kind.vehicles)
    if kind.kit:
        yield "device", kind.device


def _own(
    owners: dict[tuple[str, str], str], names: Iterable[tuple[str, str]], entry: EntryPoint
) -> None:
    for what, name in names:
        if (what, name) in owners:
            raise NotRegisteredError(
                f"{_told(entry)}: the {what} {name} is also that of {owners[what, name]}: give "
                "one of them another name, or remove its package"
            )
        owners[what, name] = _told(entry)


def _problems(vehicle: VehicleKind, every: Mapping[str, VehicleKind]) -> Iterator[str]:
    """What it names and is not there, each with what is."""
    for link in vehicle.links:
        if link not in links():
            yield f"there is no link {link}: need links of {', '.join(links())}"
    nodes = (*vehicle.links, SUPERVISOR)
    for node in vehicle.parameters:
        if node not in nodes:
            yield f"parameters has {node}, which it does not start: need one of {', '.join(nodes)}"
    given = vehicle.parameters.get(SUPERVISOR, {})
    for name in given:
        near = difflib.get_close_matches(name, _FLOWN, 1, _MISSPELT)
        if near and near != [name]:
            yield f"{SUPERVISOR} has no parameter {name}: did you mean {near[0]}?"
    for name in _NAME_LINKS:
        if not isinstance(given.get(name, []), list):
            yield f"{name} of {SUPERVISOR} is {given[name]!r}: need a list of links"
            return
        # Its default is a list of none.
        default = () if name == "unmonitored_links" else (AUTOPILOT_LINK,)
        for link in filter(None, vehicle.supervised(name, default)):
            if link not in vehicle.links:
                yield (
                    f"{name} of {SUPERVISOR} has {link}, which it does not start: need one of "
                    f"{', '.join(vehicle.links)}"
                )
    if vehicle.replaces and vehicle.replaces not in every:
        yield f"replaces is {vehicle.replaces!r}: need one of {', '.join(every)}, or nothing"
