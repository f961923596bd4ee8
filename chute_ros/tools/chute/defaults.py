"""The defaults of the parameters of our nodes, by what parameters a node has."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator, Mapping

from chute_ros.errors import NotRegisteredError
from chute_ros.links.api import SUPERVISOR, load
from chute_ros.links.registered import links
from chute_ros.ros.supervisor_parameters import PARAMETERS
from chute_ros.settings import Parameter, Value, parameters_of


def defaults_for(node: str, names: Collection[str]) -> Mapping[str, Value]:
    """Parameter -> default. node: its name, if it is that of its kind; otherwise the kind all of
    whose parameters it has. Empty: it is none of ours."""
    has = set(names)

    def fits(known: tuple[Parameter, ...]) -> bool:
        return {one.name for one in known} <= has

    fitting: tuple[Parameter, ...] = next(filter(fits, _kinds(node)), ())
    if not fitting:
        fitting = max(filter(fits, _kinds(SUPERVISOR, *links())), key=len, default=())
    return {one.name: one.default for one in fitting}


def _kinds(*nodes: str) -> Iterator[tuple[Parameter, ...]]:
    """All parameters of each of these nodes that is known here, and whose settings are there."""
    for node in nodes:
        if node == SUPERVISOR:
            yield PARAMETERS
        elif node in links():
            # Where they are not there, no such node runs here.
            with contextlib.suppress(NotRegisteredError):
                yield parameters_of(load(links()[node].parameters))
