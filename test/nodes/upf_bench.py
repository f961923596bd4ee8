"""What the tests of upf_can share: quick parameters, a bus of its own, and its devices."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from node_bench import Bench

from chute_ros.nodes.upf_can_node import UpfCanNode
from chute_ros.protocol.dronecan.endpoint import Heard
from chute_ros.protocol.upf import parameters as p
from chute_ros.protocol.upf.definitions import PARACHUTE_SERVICE, Definitions
from chute_ros.sim.bundle import WireBundle
from chute_ros.sim.upf_bus import UpfBus
from chute_ros.sim.upf_controller import (
    CONTROLLER_PARAMETERS,
    ControllerSettings,
    UpfController,
)
from chute_ros.sim.upf_node import NodeSettings, UpfNode
from chute_ros.sim.upf_trigger import TRIGGER_PARAMETERS, UpfTrigger
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_wire import make_can_wire
from chute_ros.transport.data_types import load_data_types
from chute_ros.transport.loop import WireLoop

#: Where the second, differently laid out set of data types is.
OTHER_LAYOUT = Path(__file__).parents[1] / "dsdl_other" / "flyfire"

#: Everything by command: nothing happens by itself.
BY_COMMAND: dict[str, p.Value] = dict.fromkeys(p.EXCLUDES.values(), False)
#: Between two statuses, ms.
INTERVAL = 50


def quick(**parameters: Any) -> dict[str, Any]:
    """Parameters with short limits on a bus that nobody else uses."""
    return {
        "connection": f"mcast:0:{free_udp_ports(1)[0]}",
        "device_stale_after": 0.4,
        "device_lost_after": 0.8,
        "status_timeout": 0.4,
        "call_timeout": 0.1,
        "call_tries": 2,
        "effect_timeout": 0.4,
        "retry_interval": 0.1,
        "give_up_after": 0.8,
        "last_resort_after": 0.3,
        # A deploy that the device refuses must be seen to fail.
        "decided_deploy_forces": False,
        "allocator": False,
    } | parameters


class Controller(UpfController):
    """A controller that speaks often, and refuses to deploy when told to."""

    def __init__(self, definitions: Definitions, **values: p.Value) -> None:
        #: False: it says that it is too near the ground.
        self.cleared = True
        #: TYPE_* of every request that came over the wire, answered or not.
        self.came: list[str] = []
        quick_values = {p.NODE_STATUS_INTERVAL: 100, p.PARACHUTE_STATUS_INTERVAL: INTERVAL}
        all_values = CONTROLLER_PARAMETERS | BY_COMMAND | quick_values | values
        node = NodeSettings("upf.controller", all_values)
        super().__init__(definitions, ControllerSettings(node, self_test=0.0, kill_wait=0.05))

    def _serve(self, request: Heard) -> None:
        if request.name == PARACHUTE_SERVICE:
            self.came.append(self.definitions.type_name(PARACHUTE_SERVICE, request.values))
        super()._serve(request)

    def decide(self, name: str) -> str:
        if name.startswith("TYPE_DEPLOY") and not self.cleared:
            return "TEMPORARILY_REJECTED"
        return super().decide(name)


class Network:
    """The node, and what is plugged into its bus."""

    def __init__(self, bench: Bench, **parameters: Any) -> None:
        self.bench = bench
        self.connection = quick(**parameters)["connection"]
        self.parameters = quick(**parameters) | {"connection": self.connection}
        self.node = bench.add(UpfCanNode, **self.parameters)
        folder = parameters.get("dsdl_path", "")
        self.definitions = Definitions(load_data_types(folder, "test"))

    def controller(self, **values: p.Value) -> Controller:
        """A controller for this bus, not plugged in."""
        return Controller(self.definitions, **values)

    def trigger(self, **values: p.Value) -> UpfTrigger:
        """A trigger for this bus, not plugged in."""
        all_values = TRIGGER_PARAMETERS | {p.NODE_STATUS_INTERVAL: 100} | values
        trigger = UpfTrigger(self.definitions, NodeSettings("upf.trigger", all_values))
        trigger.status_interval = INTERVAL / 1000.0
        return trigger

    def plug(self, *nodes: UpfNode) -> WireLoop[Any]:
        """Plug devices in; the loop they run in."""
        wire = make_can_wire(parse_can_address(self.connection))
        loop = WireLoop(UpfBus(list(nodes), []), WireBundle([wire]), lambda events: None)
        loop.start()
        self.bench.loops.append(loop)
        return loop
