"""The defaults of the parameters of our nodes, by what parameters a node has."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from chute_ros.links.api import SUPERVISOR, load
from chute_ros.links.registered import links
from chute_ros.ros.supervisor_parameters import PARAMETERS
from chute_ros.settings import Parameter, Value, parameters_of


def defaults_for(node: str, names: Collection[str]) -> Mapping[str, Value]:
    """Parameter -> default. node: its name, if it is that of its kind; otherwise the kind all of
    whose parameters it has. Empty: it is none of ours."""
    kinds: dict[str, tuple[Parameter, ...]] = {SUPERVISOR: PARAMETERS}
    for name, kind in links().items():
        kinds[name] = parameters_of(load(kind.parameters))
    has = set(names)
    whole = [name for name, known in kinds.items() if {one.name for one in known} <= has]
    fitting = node if node in whole else max(whole, key=lambda one: len(kinds[one]), default="")
    return {one.name: one.default for one in kinds.get(fitting, ())}
