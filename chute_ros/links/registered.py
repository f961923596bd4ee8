"""The links that are installed, by their entries in the entry point group chute_ros.links."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType

from chute_ros.errors import NotRegisteredError
from chute_ros.links.api import SUPERVISOR, LinkKind, VehicleKind

GROUP = "chute_ros.links"


@functools.cache
def links() -> Mapping[str, LinkKind]:
    """Return all links by the names of their nodes, in the order of their names; ours first."""
    found = entry_points(group=GROUP)
    kinds = [_kind(one) for one in {one.name: one for one in found}.values()]
    if not kinds:
        raise NotRegisteredError(
            f"no link is registered (entry point group {GROUP}): build chute_ros and source "
            "install/setup.bash"
        )
    kinds.sort(key=lambda one: (one.package != "chute_ros", one.name))
    return MappingProxyType({one.name: one for one in kinds})


@functools.cache
def vehicles() -> Mapping[str, VehicleKind]:
    """Return the vehicles that carry the device of any link, by their names."""
    return MappingProxyType({one.name: one for kind in links().values() for one in kind.vehicles})


def module_of(name: str) -> str:
    """Return the module of a node, for python -m."""
    if name == SUPERVISOR:
        return "chute_ros.ros.safety_supervisor"
    return links()[name].node.partition(":")[0].rpartition(".")[0]


def _kind(entry: EntryPoint) -> LinkKind:
    try:
        kind = entry.load()
    except (ImportError, AttributeError) as error:
        raise NotRegisteredError(f"{GROUP} {entry.name} = {entry.value}: {error}") from error
    if not isinstance(kind, LinkKind) or kind.name != entry.name:
        raise NotRegisteredError(
            f"{GROUP} {entry.name} = {entry.value}: need a LinkKind with the name {entry.name!r}"
        )
    return kind
