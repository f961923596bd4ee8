"""A simulated UPF trigger, the unit that drives the canopy out.

Source: Flyfire UPF UAVCAN protocol V1.0, "system architecture" and TriggerService, TriggerLaunch,
TriggerStatus.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import TRIGGER_NODE_ID
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.simulator.errors import error_places, told_errors
from chute_ros.links.upf.simulator.node import NodeSettings, UpfNode
from chute_ros.protocol.dronecan.endpoint import ReceivedTransfer

STATUS_INTERVAL = 0.1  # s

TRIGGER_PARAMETERS: dict[str, p.Value] = {
    p.STATIC_NODE_ID: TRIGGER_NODE_ID,
    p.AUTO_SAVE: True,
    p.CANBUS_RESISTER: False,
    p.LIGHT: True,
    p.NODE_STATUS_INTERVAL: 1000,
}


class UpfTrigger(UpfNode):
    """One trigger. on_fire is called when the canopy leaves."""

    def __init__(
        self,
        definitions: Definitions,
        settings: NodeSettings | None = None,
        on_fire: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__(definitions, settings or NodeSettings("upf.trigger", TRIGGER_PARAMETERS))
        self.fired = False
        #: Says yes, but nothing comes out.
        self.stuck = False
        #: By the names of TriggerStatus without ERROR_.
        self.errors: set[str] = set()
        self.status_interval = STATUS_INTERVAL
        self._on_fire = on_fire
        self._error_places = error_places(definitions, names.TRIGGER_STATUS)
        self.services[names.TRIGGER_SERVICE] = self._trigger_service
        self.messages[names.TRIGGER_LAUNCH] = self._trigger_launch
        self.broadcasts[names.TRIGGER_STATUS] = (lambda: self.status_interval, self.status)
        self.actions |= {
            "trigger-error": lambda _: self._set_errors({"CIRCUIT_OPEN"}),
            "trigger-stuck": lambda _: setattr(self, "stuck", True),
            "trigger-free": lambda _: setattr(self, "stuck", False),
            "clear-errors": lambda _: self._set_errors(set()),
        }

    def repack(self) -> None:
        """Start anew with the canopy packed."""
        self.fired = self.stuck = False
        super().repack()

    def fire(self, cause: str) -> None:
        """The canopy leaves, once."""
        if self.stuck or self.fired:
            return
        self.fired = True
        self.say(f"FIRED by {cause}")
        self.send_soon(names.TRIGGER_STATUS)
        self._on_fire()

    def status(self) -> dict[str, Any]:
        """TriggerStatus as it is now."""
        name = "STATE_LAUNCHED" if self.fired else "STATE_READY"
        if self.errors and not self.fired:
            name = "STATE_ABNORMAL"
        return {
            "state": self.definitions.constant(names.TRIGGER_STATUS, name) or 0,
            "is_launched": self.fired,
            "supply_voltage": 12.0,
            **told_errors(self._error_places, self.errors),
        }

    def _set_errors(self, errors: set[str]) -> None:
        self.errors = errors
        self.send_soon(names.TRIGGER_STATUS)

    def _trigger_service(self, request: ReceivedTransfer) -> dict[str, Any]:
        service = names.TRIGGER_SERVICE
        if not self.definitions.magic_is_good(service, request.values):
            return self.definitions.result(service, "BAD_MAGIC_NUMBER")
        name = self.definitions.type_name(service, request.values)
        if name == "TYPE_LAUNCH":
            if (self.errors or self.refuses) and not self.fired:
                return self.definitions.result(service, "FAILED")
            self.fire(f"TriggerService of node {request.source}")
        elif name == "TYPE_SELF_TEST":
            return self.definitions.result(service, "FAILED" if self.errors else "SUCCESS")
        else:
            return self.definitions.result(service, "REJECTED")
        return self.definitions.result(service, "SUCCESS")

    def _trigger_launch(self, source: int, values: Mapping[str, Any]) -> None:
        constants = self.definitions.types.message(names.TRIGGER_LAUNCH).constants
        if self.mute or values["magic_number"] != constants[names.MAGIC]:
            return
        meant = values.get("node_id", 0) in (0, self.node_id)
        if meant and not self.errors and not self.refuses:
            self.fire(f"TriggerLaunch of node {source}")
