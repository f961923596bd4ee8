"""The parameter protocol of a simulated autopilot: read and set by name.

Source: MAVLink developer guide, "Parameter protocol".
"""

from __future__ import annotations

import struct
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.autopilot_kinds import AutopilotKind


class ParameterServer:
    """The parameters of one autopilot, and its answers."""

    def __init__(self, kind: AutopilotKind) -> None:
        self.values = dict(kind.parameters)
        self._bytewise = kind.bytewise

    def answer(self, message: Any, asking: tuple[int, int]) -> Any | None:
        """The answer to a message that asks for a parameter or sets it; None: no answer."""
        kind, name = message.get_type(), message.param_id
        if name not in self.values:
            missing = dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST
            return dialect.MAVLink_param_error_message(*asking, name.encode(), -1, missing)
        if kind == "PARAM_SET":
            self.values[name] = self._decoded(name, message.param_value)
        return self._value(name)

    def _is_integer(self, name: str) -> bool:
        return isinstance(self.values[name], int)

    def _decoded(self, name: str, value: float) -> float:
        if not self._is_integer(name):
            return value
        if self._bytewise:
            return int(struct.unpack("<i", struct.pack("<f", value))[0])
        return int(value)

    def _value(self, name: str) -> Any:
        value, kind = self.values[name], dialect.MAV_PARAM_TYPE_REAL32
        if self._is_integer(name):
            kind = dialect.MAV_PARAM_TYPE_INT32
            if self._bytewise:
                (value,) = struct.unpack("<f", struct.pack("<i", int(value)))
        number = list(self.values).index(name)
        return dialect.MAVLink_param_value_message(
            name.encode(), value, kind, len(self.values), number
        )
