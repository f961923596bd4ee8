"""The parameters of a simulated UPF device: what is in use, what is kept, what is taken.

Source: Flyfire UPF UAVCAN protocol V1.0, "parameters"; uavcan.protocol.param.GetSet and
ExecuteOpcode.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import CONTROLLER_NODE_ID

#: The document gives no defaults but the static node id and the resistor; the others are chosen.
CONTROLLER_PARAMETERS: dict[str, p.Value] = {
    p.STATIC_NODE_ID: CONTROLLER_NODE_ID,
    p.AUTO_SAVE: True,
    p.CANBUS_RESISTER: False,
    p.ENABLE_PARACHUTE: True,
    p.ENABLE_APS: True,
    p.AUTO_TAKEOFF: True,
    p.AUTO_ARM: True,
    p.AUTO_DISARM: True,
    p.AUTO_LAND: True,
    p.LIGHT: True,
    p.NODE_STATUS_INTERVAL: 1000,
    p.PARACHUTE_STATUS_INTERVAL: 100,
}


class ParameterMemory:
    """The parameters of one device. delivered: its values as it leaves the factory."""

    def __init__(self, delivered: Mapping[str, p.Value]) -> None:
        self._delivered = dict(delivered)
        #: In use, and what a restart brings back.
        self.values: dict[str, p.Value] = dict(delivered)
        self.saved: dict[str, p.Value] = dict(delivered)

    def restart(self) -> None:
        """Only what was saved is left."""
        self.values = dict(self.saved)

    def set(self, name: str, wanted: p.Value) -> bool:
        """Take a value if its kind and range fit; keep it, if that is wanted. Whether it did."""
        value = fitting(p.BY_NAME[name], wanted)
        if value is None:
            return False
        self.values[name] = value
        if self.values[p.AUTO_SAVE]:
            # All: what was changed while it was off is kept now as well.
            self.saved = dict(self.values)
        elif name == p.AUTO_SAVE:
            self.saved[name] = value
        return True

    def name_of(self, request: Mapping[str, Any]) -> str:
        """Which parameter a GetSet means, by name or else by index; empty: none."""
        name = bytes(request["name"]).decode("utf-8", "replace")
        if name:
            return name if name in self.values else ""
        in_order, index = list(self.values), request["index"]
        return in_order[index] if index < len(in_order) else ""

    def answer(self, name: str) -> dict[str, Any]:
        """The answer to a GetSet; name empty: there is no such parameter."""
        if not name:
            return {}
        documented = p.BY_NAME[name]
        told: dict[str, Any] = {
            "name": name.encode(),
            "value": p.union_of(self.values[name]),
            "default_value": p.union_of(self._delivered[name]),
        }
        if documented.kind is int:
            told["min_value"] = {"integer_value": documented.minimum}
            told["max_value"] = {"integer_value": documented.maximum}
        return told

    def execute(self, opcode: int) -> bool:
        """Save what is in use, or go back to what was delivered; other codes are none."""
        if opcode == bus_requests.OPCODE_ERASE:
            self.values = dict(self._delivered)
        elif opcode != bus_requests.OPCODE_SAVE:
            return False
        self.saved = dict(self.values)
        return True


def fitting(documented: p.DocumentedParameter, wanted: p.Value) -> p.Value | None:
    """wanted as the parameter keeps it; None: another kind, or out of range."""
    if isinstance(wanted, str):
        return None
    if documented.kind is bool:
        return bool(wanted) if wanted in (0, 1) else None
    if isinstance(wanted, bool) or not documented.minimum <= wanted <= documented.maximum:
        return None
    return int(wanted) if wanted == int(wanted) else None
