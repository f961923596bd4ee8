"""The settings of the supervisor from a ROS parameter file, as its node would start with them."""

from __future__ import annotations

from pathlib import Path

from chute_ros.errors import ParameterError
from chute_ros.ros.parameter_file import given_in, of_every_node
from chute_ros.ros.parameters import what_was_meant
from chute_ros.ros.supervisor_parameters import PARAMETERS, config_from
from chute_ros.supervisor.inputs import Mode
from chute_ros.tools.replaying import Other

NODE = "safety_supervisor"


def other_from(path: Path, node: str) -> Other:
    """What the file asks for; ParameterError says what is wrong with it. node: the whole name of
    the node that flew."""
    given = given_in(path, node, f"/{NODE}")
    known = {one.name: one for one in PARAMETERS}
    for name in given:
        if name not in known and not of_every_node(name):
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
