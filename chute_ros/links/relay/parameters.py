"""The parameters of relay."""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.relay.output import FORMS, make_output
from chute_ros.links.relay.runtime import RelaySettings
from chute_ros.settings import Settings, nested, parameter, parameters_of


@dataclass(frozen=True)
class RelayParameters(Settings):
    """All parameters of the node; first its connection."""

    connection: str = parameter(
        "serial:/dev/ttyUSB0:9600",
        f"the output: {FORMS}; file: an output in /sys, a device or a pipe",
    )
    runtime: RelaySettings = nested(RelaySettings())

    def __post_init__(self) -> None:
        super().__post_init__()
        make_output(self.connection)


PARAMETERS = parameters_of(RelayParameters)
