"""The parameters of relay and what they become."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.links.relay.output import FORMS, output_bytes
from chute_ros.links.relay.protocol.link import RelayConfig
from chute_ros.nodes.parameters import Parameter

PARAMETERS = (
    Parameter(
        "connection",
        "serial:/dev/ttyUSB0:9600",
        f"the output: {FORMS}; file: an output in /sys, a device or a pipe",
    ),
    Parameter(
        "output_fire",
        "hex:a00101a2",
        "what is written to fire: text as it is, or hex: and digits; the default closes channel 1 "
        "of a serial relay board LCUS-1",
    ),
    Parameter(
        "output_rest", "hex:a00100a1", "what is written at rest: text as it is, or hex: and digits"
    ),
    Parameter("pulse_time", 2.0, "the output fires for this long, s", 0.05, 60.0),
    Parameter("repeat_interval", 0.1, "interval at which output_fire is repeated, s", 0.02, 10.0),
    Parameter(
        "rest_interval",
        1.0,
        "interval at which output_rest is repeated, s: an output that cannot be written is LOST",
        0.05,
        60.0,
    ),
    Parameter(
        "give_up_after", 5.0, "a deploy that could not be written fails after this, s", 0.1, 60.0
    ),
)


def config_from(values: Mapping[str, Any]) -> RelayConfig:
    """The settings of the protocol; ParameterError for bytes that are none."""
    fire, rest = (output_bytes(values[name], name) for name in ("output_fire", "output_rest"))
    if fire == rest:
        raise ParameterError(
            f"parameters output_fire and output_rest are both {values['output_fire']!r}: need two "
            "that differ"
        )
    return RelayConfig(
        fire,
        rest,
        values["pulse_time"],
        values["repeat_interval"],
        values["rest_interval"],
        values["give_up_after"],
    )
