"""Parameters in ROS: declared as the settings describe them.

A value that is not allowed stops the start with the parameter's name, the value and what is
allowed. Parameters are read-only unless a change in flight cannot be dangerous.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterUninitializedException,
)
from rclpy.node import Node

from chute_ros.errors import ParameterError
from chute_ros.ros.parameter_file import (
    assigned,
    files_of,
    named_in,
    of_every_node,
    renamed,
    taken,
)
from chute_ros.settings import Parameter


def descriptor(parameter: Parameter) -> ParameterDescriptor:
    """The parameter as ROS describes it."""
    described = ParameterDescriptor(
        description=parameter.meaning,
        additional_constraints=parameter.allowed(),
        read_only=not parameter.changeable,
        dynamic_typing=parameter.takes_switch,
    )
    if parameter.minimum is None or parameter.maximum is None:
        return described
    if isinstance(parameter.default, float):
        span = FloatingPointRange(from_value=parameter.minimum, to_value=parameter.maximum)
        described.floating_point_range.append(span)
    else:
        whole = IntegerRange(from_value=int(parameter.minimum), to_value=int(parameter.maximum))
        described.integer_range.append(whole)
    return described


#: As like as that a name is another one misspelt, by difflib; what is less like may belong to
#: another node that shares the file.
MISSPELT = 0.85


def declare(node: Node, parameters: tuple[Parameter, ...]) -> Mapping[str, Any]:
    """Declare all that node has and return name -> value; ParameterError for a value not allowed.
    A name that it does not have is told, and stops it where it is one that it has, misspelt: ROS
    would pass over it without a word."""
    values: dict[str, Any] = {}
    for parameter in parameters:
        try:
            value = node.declare_parameter(
                parameter.name, parameter.default, descriptor(parameter)
            ).value
        except (
            InvalidParameterTypeException,
            InvalidParameterValueException,
            ParameterUninitializedException,
        ):
            raise _not_allowed(node, parameter, _given(node, parameter)) from None
        if value is None:
            value = []  # how ROS reads an empty list on the command line
        if parameter.takes_switch and isinstance(value, bool):
            value = str(value).lower()
        if not parameter.takes(value):
            raise _not_allowed(node, parameter, value)
        values[parameter.name] = value
    _tell_unknown(node, [parameter.name for parameter in parameters])
    return values


def settings_taken(node: Node, names: Iterable[str], arguments: Sequence[str]) -> str:
    """How many of its parameters a node takes from where, in words. arguments: of its process.
    ParameterError: a file has nothing for it, or what is given cannot be for it."""
    own, known = node.get_fully_qualified_name(), list(names)
    text = taken(arguments, own, known, node._parameter_overrides)
    for one, other, name in assigned(arguments):
        if other and f"/{other}" != own:
            raise ParameterError(
                f"'-p {one}' is for a node /{other}, this one is {own}: leave '{other}:' out"
            )
        check_names([name], known, f"'-p {one}': {own}")
    for one, name in renamed(arguments):
        if name in known:
            raise ParameterError(f"'-r {one}' gives topics another name: {name} is set by '-p'")
    for path in files_of(arguments):
        check_names(named_in(path, own), known, f"{path}: {own}")
    return text


def check_names(given: Iterable[str], known: Iterable[str], node: str) -> None:
    """given: parameters that are for this node alone. ParameterError: it has none of a name, and
    whoever set it relies on it."""
    known = list(known)
    for name in given:
        if name not in known and not of_every_node(name):
            hint = what_was_meant(name, known)
            raise ParameterError(
                f"{node} has no parameter {name}{hint or ': correct its name, or leave it out'}"
            )


def _tell_unknown(node: Node, known: list[str]) -> None:
    for name in node._parameter_overrides:
        if node.has_parameter(name) or of_every_node(name):
            continue
        if near := nearest(name, known, MISSPELT):
            # Whoever set it relies on it: the default may be the opposite.
            raise ParameterError(
                f"{node.get_fully_qualified_name()} has no parameter {name}: did you mean "
                f"{near}? Correct its name, or leave it out"
            )
        hint = what_was_meant(name, known)
        node.get_logger().error(f"has no parameter {name}, its value is not used{hint}")


def nearest(name: str, known: Iterable[str], alike: float = 0.6) -> str:
    """The one of known that is most like this name; empty: none is as like it (0 to 1)."""
    near = difflib.get_close_matches(name, known, 1, alike)
    return near[0] if near else ""


def what_was_meant(name: str, known: Iterable[str]) -> str:
    """The end of a text that says that there is no such parameter; empty: none is like it."""
    near = nearest(name, known)
    return f": did you mean {near}?" if near else ""


def _given(node: Node, parameter: Parameter) -> object:
    # The value was refused before it was stored; what the user gave is among the overrides.
    overrides = node._parameter_overrides
    return overrides[parameter.name].value if parameter.name in overrides else None


def _not_allowed(node: Node, parameter: Parameter, value: object) -> ParameterError:
    return parameter.refusal(value, f" of {node.get_fully_qualified_name()}")
