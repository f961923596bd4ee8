"""The settings of the supervisor from a ROS parameter file, as its node would start with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import yaml

from chute_ros import plain_yaml
from chute_ros.errors import ParameterError
from chute_ros.ros.parameters import what_was_meant
from chute_ros.ros.supervisor_parameters import PARAMETERS, config_from
from chute_ros.supervisor.inputs import Mode
from chute_ros.tools.replaying import Other

NODE = "safety_supervisor"
#: Names of nodes and parts of them in one file, at most.
_MOST_NAMES = 1000
#: What ROS gives every node.
_EVERYWHERE = {"use_sim_time", "start_type_description_service", "qos_overrides"}


def other_from(path: Path, node: str) -> Other:
    """What the file asks for; ParameterError says what is wrong with it. node: the whole name of
    the node that flew."""
    given = _given(path, node)
    known = {one.name: one for one in PARAMETERS}
    for name in given:
        if name.partition(".")[0] not in {*known, *_EVERYWHERE}:
            hint = what_was_meant(name, known)
            raise ParameterError(f"{path}: {NODE} has no parameter {name}{hint}")
    for name, parameter in known.items():
        if name in given and not parameter.takes(given[name]):
            raise ParameterError(f"{path}: {parameter.refusal(given[name], f' of {NODE}')}")
    values = {name: given.get(name, one.default) for name, one in known.items()}
    try:
        config = config_from(values)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
    return Other(config, Mode[given["mode"]] if "mode" in given else None)


def _given(path: Path, node: str) -> dict[str, Any]:
    """Name -> value of what the file has for this node, the later over the earlier."""
    try:
        whole = plain_yaml.load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror or error}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ParameterError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    found: dict[str, Any] = {}
    sections = 0
    for name, section in _sections(path, whole):
        if any(_matches(name, one) for one in (node, f"/{NODE}")):
            sections += 1
            found.update(section)
    if not sections:
        raise ParameterError(
            f"{path} has no ros__parameters for {node}: need for example "
            f"'/**/{NODE}:' with 'ros__parameters:' below"
        )
    return found


def _sections(path: Path, whole: Any) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Name of a node, with wildcards -> its parameters; names may be nested. ParameterError: there
    are so many that the file must hold itself, or multiply by its aliases."""
    waiting, walked = [("", whole)], 0
    while waiting:
        name, part = waiting.pop()
        walked += 1
        if walked > _MOST_NAMES:
            raise ParameterError(f"{path}: more than {_MOST_NAMES} names in it: no parameter file")
        if name.endswith("/ros__parameters"):
            yield name.removesuffix("/ros__parameters"), part if isinstance(part, dict) else {}
        elif isinstance(part, dict):
            inner = [(f"{name}/{str(key).strip('/')}", one) for key, one in part.items()]
            waiting += reversed(inner)


def _matches(pattern: str, node: str) -> bool:
    """As ROS: * is one name, ** any number of them."""
    if pattern in ("/**", node):
        return True
    parts, names = pattern.split("/")[1:], node.split("/")[1:]
    if parts[:1] == ["**"]:
        tail = parts[1:]
        names = names[len(names) - len(tail) :]
        parts = tail
    return len(parts) == len(names) and all(map(fnmatchcase, names, parts))
