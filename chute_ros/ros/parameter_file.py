"""A ROS parameter file: what it has for one node, and what a started node took from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import yaml

from chute_ros.errors import ParameterError
from chute_ros.plain_yaml import Misread, load_marked
from chute_ros.transport.regular_file import read_regular_text

#: Names of nodes and parts of them in one file, at most.
_MOST_NAMES = 1000
#: Parameters that ROS gives every node, by what is before their first dot.
_EVERY_NODE_HAS = ("use_sim_time", "start_type_description_service", "qos_overrides")
#: How the files begin to which launch_ros writes what a launch file sets.
_OF_LAUNCH = "launch_params_"


def given_in(path: Path, node: str, also: str = "") -> dict[str, Any]:
    """Parameter, nested ones with dots -> value of what the file has for this node, the later over
    the earlier. node: its whole name; also: another that counts as it. ParameterError: the file
    cannot be read, has nothing for it (ROS would start the node on its defaults), or a value for
    it that YAML reads as another than it looks like, or twice."""
    whole = _read(path)
    found: dict[str, Any] = {}
    names = {True: set[str](), False: set[str]()}
    for name, section in _sections(path, whole):
        ours = any(_matches(name, one) for one in (node, also) if one)
        names[ours].add(name)
        if ours:
            found.update(_flat(section))
    for parameter, value in found.items():
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, Misread):
                raise ParameterError(f"{path}, line {one.line}: {parameter} is {one.problem}")
    if not names[True]:
        own, others = node.rpartition("/")[2], sorted(names[False])
        has = f" (it has some for {', '.join(others[:5])})" if others else ""
        raise ParameterError(
            f"{path} has no ros__parameters for {node}{has}: need for example '/**/{own}:' with "
            "'ros__parameters:' below"
        )
    return found


def named_in(path: Path, node: str) -> list[str]:
    """The parameters in sections of this node alone, whose last name has no wildcard. What a
    section of several nodes has may be for another. ParameterError as given_in has it."""
    return [
        name
        for pattern, section in _sections(path, _read(path))
        if "*" not in pattern.rpartition("/")[2] and _matches(pattern, node)
        for name, _ in _flat(section)
    ]


def of_every_node(parameter: str) -> bool:
    """ROS gives it to every node."""
    return parameter.partition(".")[0] in _EVERY_NODE_HAS


def files_of(arguments: Sequence[str]) -> list[Path]:
    """The parameter files among the arguments of a process, in their order."""
    return [Path(one) for one in _options(arguments, "--params-file")]


def assigned(arguments: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """Each -p among the arguments of a process: it, the node before its colon (empty: every node
    of the process) and the parameter."""
    for one in _options(arguments, "-p", "--param"):
        node, _, parameter = one.partition(":=")[0].rpartition(":")
        yield one, node, parameter


def renamed(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Each -r among the arguments of a process: it, and the name that is to be another."""
    for one in _options(arguments, "-r", "--remap"):
        yield one, one.partition(":=")[0].rpartition(":")[2]


def not_for_ros(arguments: Sequence[str]) -> list[str]:
    """The arguments of a process that are not between --ros-args and --. ROS takes NAME:=VALUE
    there for a name that is to be another."""
    return [one for _, one, ours in _each(arguments) if not ours]


def _options(arguments: Sequence[str], *flags: str) -> Iterator[str]:
    """What follows these flags where arguments are ROS's."""
    return (one for before, one, ours in _each(arguments) if ours and before in flags)


def _each(arguments: Sequence[str]) -> Iterator[tuple[str, str, bool]]:
    """The argument before it, it, and whether it is ROS's."""
    ours = False
    for before, one in zip(("", *arguments), arguments, strict=False):
        if one in ("--ros-args", "--"):
            ours = one == "--ros-args"
        else:
            yield before, one, ours


def taken(arguments: Sequence[str], node: str, known: Iterable[str], given: Iterable[str]) -> str:
    """What a node takes from where, in words. known: its parameters; given: those that ROS has a
    value for from a file or the command line. ParameterError as given_in has it."""
    every = set(known)
    left = every & set(given)
    parts = [f"{len(every - left)} by default"]
    for path in reversed(files_of(arguments)):
        here = left & given_in(path, node).keys()
        left -= here
        parts.insert(0, f"{len(here)} from {_place(path)}")
    if left:
        parts.insert(-1, f"{len(left)} from the command line")
    return f"{len(every)} parameters: {', '.join(parts)}"


def _place(path: Path) -> str:
    """What a person calls it."""
    return "the launch file" if path.name.startswith(_OF_LAUNCH) else str(path)


def _read(path: Path) -> Any:
    try:
        return load_marked(read_regular_text(path))
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror or error}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ParameterError(f"{path} cannot be read: {' '.join(str(error).split())}") from None


def _flat(section: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in section.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


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
