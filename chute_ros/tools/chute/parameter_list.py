"""The parameters of a node beside their defaults, as text."""

from __future__ import annotations

import array
import contextlib
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from chute_ros.errors import NotRegisteredError
from chute_ros.links.api import SUPERVISOR, load
from chute_ros.links.registered import links
from chute_ros.plain_text import plain
from chute_ros.ros.supervisor_parameters import PARAMETERS
from chute_ros.settings import Parameter, Value, parameters_of


@dataclass(frozen=True)
class Given:
    """One parameter. default: None where the node is none of ours, or ROS has brought it."""

    name: str
    value: Any
    default: Any
    differs: bool


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


def given(values: Mapping[str, Any], defaults: Mapping[str, Any]) -> list[Given]:
    """In the order of the defaults, then those of ROS."""
    ours = [name for name in defaults if name in values]
    return [
        _given(name, _listed(values[name]), _listed(defaults.get(name)))
        for name in [*ours, *sorted(values.keys() - defaults.keys())]
    ]


def _given(name: str, value: Any, default: Any) -> Given:
    return Given(name, value, default, default is not None and value != default)


def parameter_lines(node: str, parameters: Sequence[Given]) -> list[str]:
    """* marks those that differ, with the default."""
    width = max((len(one.name) for one in parameters), default=0)
    lines = [plain(node)]
    for one in parameters:
        text = f"{'*' if one.differs else ' '} {one.name:<{width}}  {_text(one.value)}"
        if one.differs:
            text += f"   (default: {_text(one.default)})"
        lines.append(f"  {plain(text)}")
    return lines if parameters else [*lines, "    all as by default"]


def _listed(value: Any) -> Any:
    if isinstance(value, (list, tuple, array.array)):
        # ROS has no type for an empty list: [""] stands for it in the defaults.
        return [one for one in value if one != ""]
    return value


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, default=str)
