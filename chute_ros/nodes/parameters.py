"""Parameters as one table a node: name, default, what it means, what is allowed.

A value that is not allowed stops the start with the parameter's name, the value and what is
allowed. Parameters are read-only unless a change in flight cannot be dangerous.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterUninitializedException,
)
from rclpy.node import Node

from chute_ros.errors import ParameterError
from chute_ros.protocol.liveness import LivenessLimits

Value = bool | int | float | str | list[str]


@dataclass(frozen=True)
class Parameter:
    """One parameter. minimum and maximum are inclusive; choices are for text. Where true and false
    are among them they may be given as YAML reads them, and come as text."""

    name: str
    default: Value
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    changeable: bool = False

    def allowed(self) -> str:
        """What may be given, in words."""
        kind = {bool: "true or false", str: "text", list: "a list of texts"}.get(
            type(self.default),
            "a whole number" if isinstance(self.default, int) else "a number (1.0, not 1)",
        )
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.minimum is None or self.maximum is None:
            return kind
        if isinstance(self.default, int):
            return f"{kind} from {int(self.minimum)} to {int(self.maximum)}"
        return f"{kind} from {self.minimum:g} to {self.maximum:g}"

    @property
    def takes_switch(self) -> bool:
        """True and false are among its choices."""
        return {"true", "false"} <= set(self.choices)

    def descriptor(self) -> ParameterDescriptor:
        """The same for ROS."""
        descriptor = ParameterDescriptor(
            description=self.description,
            additional_constraints=self.allowed(),
            read_only=not self.changeable,
            dynamic_typing=self.takes_switch,
        )
        if self.minimum is None or self.maximum is None:
            return descriptor
        if isinstance(self.default, float):
            span = FloatingPointRange(from_value=self.minimum, to_value=self.maximum)
            descriptor.floating_point_range.append(span)
        else:
            whole = IntegerRange(from_value=int(self.minimum), to_value=int(self.maximum))
            descriptor.integer_range.append(whole)
        return descriptor


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
                parameter.name, parameter.default, parameter.descriptor()
            ).value
        except (
            InvalidParameterTypeException,
            InvalidParameterValueException,
            ParameterUninitializedException,
        ):
            raise _not_allowed(node, parameter, _given(node, parameter)) from None
        if value is None:
            value = []  # how ROS reads an empty list on the command line
            if not isinstance(parameter.default, list):
                raise _not_allowed(node, parameter, value)
        if parameter.takes_switch and isinstance(value, bool):
            value = str(value).lower()
        if parameter.choices and value not in parameter.choices:
            raise _not_allowed(node, parameter, value)
        values[parameter.name] = value
    _tell_unknown(node, [parameter.name for parameter in parameters])
    return values


def _tell_unknown(node: Node, known: list[str]) -> None:
    for name in node._parameter_overrides:
        if node.has_parameter(name) or name.startswith("qos_overrides."):
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


def liveness_from(values: Mapping[str, Any], name: str) -> LivenessLimits:
    """The limits in the parameters name_stale_after and name_lost_after."""
    stale, lost = values[f"{name}_stale_after"], values[f"{name}_lost_after"]
    if stale >= lost:
        raise ParameterError(
            f"parameter {name}_stale_after is {stale} and {name}_lost_after is {lost}: "
            "a link is stale before it is lost; need a smaller first or a larger second"
        )
    return LivenessLimits(stale, lost)


def _given(node: Node, parameter: Parameter) -> object:
    # The value was refused before it was stored; what the user gave is among the overrides.
    overrides = node._parameter_overrides
    return overrides[parameter.name].value if parameter.name in overrides else None


def _not_allowed(node: Node, parameter: Parameter, value: object) -> ParameterError:
    return ParameterError(
        f"parameter {parameter.name} of {node.get_fully_qualified_name()} is {value!r}: "
        f"need {parameter.allowed()} ({parameter.description})"
    )
