"""What the tests of upf_can share: quick parameters, a bus of its own, and its devices."""

import math
from pathlib import Path
from typing import Any

from chute_msgs.msg import LinkHeartbeat, VehicleState
from node_bench import stamped
from upf_party import Party

from chute_ros.links.upf.node import UpfCanNode
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.definitions import PARACHUTE_SERVICE, Definitions
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import (
    CONTROLLER_PARAMETERS,
    ControllerSettings,
    UpfController,
)
from chute_ros.links.upf.simulator.node import NodeSettings
from chute_ros.links.upf.simulator.trigger import TRIGGER_PARAMETERS, UpfTrigger
from chute_ros.model import LinkState
from chute_ros.sim.bundle import WireBundle
from chute_ros.sim.can_faults import CanFaultyLink
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_wire import make_can_wire
from chute_ros.transport.data_types import load_data_types
from chute_ros.transport.loop import WireLoop

#: Where the second, differently laid out set of data types is.
OTHER_LAYOUT = Path(__file__).parents[2] / "dsdl_other" / "flyfire"

#: Everything by command: nothing happens by itself.
BY_COMMAND: dict[str, p.Value] = dict.fromkeys(p.AUTOMATIC, False)
#: Between two statuses, ms.
INTERVAL = 50
#: Limits of a node whose device answers, however busy this machine is.
PATIENT = {"call_timeout": 2.0, "effect_timeout": 5.0, "give_up_after": 15.0}


def quick(**parameters):
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

    def __init__(self, definitions, self_test=0.0, kill_wait=0.05, **values):
        #: False: it says that it is too near the ground.
        self.cleared = True
        #: TYPE_* of every request that came over the wire, answered or not.
        self.came: list[str] = []
        quick_values = {p.NODE_STATUS_INTERVAL: 100, p.PARACHUTE_STATUS_INTERVAL: INTERVAL}
        all_values = CONTROLLER_PARAMETERS | BY_COMMAND | quick_values | values
        node = NodeSettings("upf.controller", all_values)
        super().__init__(definitions, ControllerSettings(node, self_test, kill_wait=kill_wait))

    def _serve(self, request):
        if request.name == PARACHUTE_SERVICE:
            self.came.append(self.definitions.type_name(PARACHUTE_SERVICE, request.values))
        super()._serve(request)

    def decide(self, name):
        if name.startswith("TYPE_DEPLOY") and not self.cleared:
            return "TEMPORARILY_REJECTED"
        return super().decide(name)


class Network:
    """The node, and what is plugged into its bus."""

    def __init__(self, bench, **parameters):
        self.bench = bench
        self.connection = quick(**parameters)["connection"]
        self.parameters = quick(**parameters) | {"connection": self.connection}
        #: What the simulated devices say they do, oldest first.
        self.said: list[str] = []
        self.node = bench.add(UpfCanNode, **self.parameters)
        folder = parameters.get("dsdl_path", "")
        self.definitions = Definitions(load_data_types(folder, "test"))

    @property
    def link(self):
        """The node's link, to look at."""
        return self.node.loop.link

    def restart(self):
        """The node ends and starts anew."""
        self.bench.remove(self.node)
        self.node = self.bench.add(UpfCanNode, **self.parameters)

    def controller(self, self_test=0.0, kill_wait=0.05, **values):
        """A controller for this bus, not plugged in."""
        return Controller(self.definitions, self_test, kill_wait, **values)

    def trigger(self, name="upf.trigger", **values):
        """A trigger for this bus, not plugged in."""
        all_values = TRIGGER_PARAMETERS | {p.NODE_STATUS_INTERVAL: 100} | values
        trigger = UpfTrigger(self.definitions, NodeSettings(name, all_values))
        trigger.status_interval = INTERVAL / 1000.0
        return trigger

    def plug(self, *nodes, knobs=None):
        """Plug devices in; the loop they run in."""
        bus: Any = UpfBus(list(nodes), [])
        return self._run(bus if knobs is None else CanFaultyLink(bus, knobs, seed=1))

    def party(self, node_id=50):
        """Plug a node of the test's own in."""
        party = Party(self.definitions, node_id)
        party.loop = self._run(party)
        return party

    def _run(self, link):
        wire = make_can_wire(parse_can_address(self.connection))
        loop = WireLoop(link, WireBundle([wire]), self._note)
        loop.start()
        self.bench.loops.append(loop)
        return loop

    def _note(self, events):
        self.said += [event for event in events if isinstance(event, str)]


class Devices:
    """A controller and a trigger on the network, heard and well, the controller's parameters
    known."""

    def __init__(self, network, self_test=0.0, **values):
        self.network, self.bench = network, network.bench
        self.controller, self.trigger = network.controller(self_test, **values), network.trigger()
        self.beats = self.bench.follow(LinkHeartbeat, "safety/heartbeat")
        self.loop = network.plug(self.controller, self.trigger)
        self.await_well()

    def await_well(self):
        """All is known of them and all is well."""
        known = self.network.link.devices.controllers

        def well():
            read = [len(one.parameters) for one in known.values()]
            ours = [beat for beat in self.beats if beat.link == "upf_can"]
            return bool(read == [12] and ours and ours[-1].device_healthy)

        self.bench.until(well, "the devices are heard and well")

    def await_beat(self, **fields):
        """The newest heartbeat of the node has these fields."""

        def so():
            ours = [beat for beat in self.beats if beat.link == "upf_can"]
            fits = ours and all(getattr(ours[-1], n) == value for n, value in fields.items())
            return ours[-1] if fits else None

        return self.bench.until(so, f"the heartbeat reports {fields}")

    def act(self, action):
        """Have them do so."""
        self.bench.have(self.loop, lambda bus: bus.act(action))

    def fly(self):
        """The vehicle says that it is in the air, until the node has heard it."""
        fly(self.bench, self.network)


def vehicle_state(bench, **fields):
    """A vehicle/state of which only these parts are known, now."""
    unknown = {
        name: math.nan
        for name in VehicleState.get_fields_and_field_types()
        if name.endswith("_age")
    }
    numbers = {"height": math.nan, "vertical_speed": math.nan}
    known = {"source": "1/1", "link_state": int(LinkState.OK)}
    return stamped(bench.client, VehicleState(**(unknown | numbers | known | fields)))


def fly(bench, network):
    """The vehicle says that it is in the air, until the node has heard it."""

    def said():
        message = vehicle_state(bench, landed_state=2, landed_state_age=0.0)
        bench.publish(message, "vehicle/state")
        return network.link._vehicle._state.landed_state == 2

    bench.until(said, "the node knows that it flies")


def tasks(diagnostics):
    """Task of upf_can -> its newest status."""
    found = {}
    for status in (status for array in diagnostics for status in array.status):
        node, _, task = status.name.partition(": ")
        if node.endswith("/upf_can"):
            found[task] = status
    return found


def values(status):
    """Key -> value of one diagnostic status."""
    return {pair.key: pair.value for pair in status.values}
