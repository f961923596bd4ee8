"""Tells timed stories to a UpfLink over frames: simulated devices, made-up ones, the answers."""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dronecan
from dronecan.dsdl import parse_namespaces

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import NODE_ID, UpfConfig
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.devices import SAYINGS, SAYINGS_ORDERED
from chute_ros.links.upf.protocol.events import BusRequestFinished
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import (
    CONTROLLER_PARAMETERS,
    ControllerSettings,
    UpfController,
)
from chute_ros.links.upf.simulator.node import NodeSettings
from chute_ros.links.upf.simulator.trigger import UpfTrigger
from chute_ros.model import Armed, LandedState, LinkState, VehicleState
from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.protocol.dronecan.endpoint import Endpoint, ReceivedTransfer
from chute_ros.protocol.dronecan.transfer import TransferKind
from chute_ros.protocol.events import (
    AskSupervisor,
    Notice,
    ParachuteChanged,
    RequestFinished,
    RequestReport,
    SafetyAsk,
)
from chute_ros.sim.can_faults import CanFaultyLink

START = 1000.0
US, CONTROLLER, TRIGGER = NODE_ID, 33, 34
#: What the vehicle decides itself, so that its requests are not refused.
BY_REQUEST = dict.fromkeys((p.AUTO_TAKEOFF, p.AUTO_ARM, p.AUTO_DISARM, p.AUTO_LAND), False)

_ROOT = Path(__file__).parents[4]
LAYOUTS = {
    "ours": _ROOT / "msg_defs" / "dsdl" / "flyfire",
    "other": _ROOT / "test" / "dsdl_other" / "flyfire",
}


@dataclass(frozen=True)
class Layout:
    """One set of flyfire types."""

    name: str
    types: DataTypes
    definitions: Definitions


def types_of(folder):
    """The standard types, and those in folder."""
    standard = [one for name, one in dronecan.TYPENAMES.items() if name.startswith("uavcan.")]
    return DataTypes([*standard, *parse_namespaces([str(folder)])])


@functools.cache
def layout_of(name):
    types = types_of(LAYOUTS[name])
    return Layout(name, types, Definitions(types))


def flying(**changes):
    """A vehicle/state of a vehicle in the air."""
    values = {
        "link_state": LinkState.OK,
        "armed": Armed.ARMED,
        "armed_age": 0.0,
        "landed_state": LandedState.IN_AIR,
        "landed_state_age": 0.0,
        "height": 50.0,
        "height_age": 0.0,
        "vertical_speed": -1.5,
        "vertical_speed_age": 0.0,
    }
    return VehicleState(**{**values, **changes})


def landed(**changes):
    """One on the ground with its motors off."""
    return flying(
        **{
            "armed": Armed.DISARMED,
            "landed_state": LandedState.ON_GROUND,
            "height": 0.0,
            **changes,
        }
    )


class Bench:
    """One link; t is seconds since the start of the story.

    devices: simulated ones, each with the name that it has here. parameters: of the controller.
    knobs: what happens to frames between them and the bus.
    """

    def __init__(
        self,
        layout,
        devices="controller trigger",
        parameters=BY_REQUEST,
        settings=None,
        knobs=None,
        **config,
    ):
        self.layout, self.definitions = layout, layout.definitions
        values = {**CONTROLLER_PARAMETERS, **parameters}
        node = NodeSettings("upf.controller", values)
        self.controller = UpfController(
            self.definitions, ControllerSettings(node, **(settings or {}))
        )
        self.trigger = UpfTrigger(self.definitions)
        known = {"controller": self.controller, "trigger": self.trigger}
        self.devices = UpfBus([known[name] for name in devices.split()])
        #: Between the devices and the bus.
        self.plug = self.devices if knobs is None else CanFaultyLink(self.devices, knobs, seed=1)
        self.link = UpfLink(UpfConfig(**config), layout.types)
        self.t = 0.0
        self.events: list[Any] = []
        #: What the link sent, as its receivers understand it.
        self.heard: list[tuple[float, ReceivedTransfer]] = []
        #: Whether a frame is lost on its way: (from the link, its bytes).
        self.loses: Callable[[bool, bytes], bool] = lambda from_link, data: False
        #: The supervisor grants what it is asked for.
        self.supervised = True
        self.standing: set[str] = set()
        self.asks: list[tuple[float, AskSupervisor]] = []
        self.owner_lives = True
        self._ears: dict[int, Endpoint] = {}
        for node_id in (CONTROLLER, TRIGGER):
            self.puppet(node_id)

    @property
    def now(self):
        return START + self.t

    def ready(self):
        """The devices are up, and what happened on the way is forgotten."""
        return self.at(3.0).clear()

    def in_flight(self):
        """The controller is armed, up high."""
        self.ready()
        self.link.arm(-100, True, 0, self.now)
        self.at(self.t + 0.5)
        assert self.end(-100).success
        return self.clear()

    def at(self, t):
        """Go to t, waking at each deadline on the way."""
        assert t >= self.t
        for _ in range(100_000):
            self.step()
            wake = min(self.link.next_deadline(), self._devices_want()) - START
            if wake > t:
                break
            self.t = min(max(wake, self.t + 0.001), t)
            if self.t >= t:
                self.step()
                break
        self.t = t
        return self.step()

    def after(self, seconds):
        return self.at(self.t + seconds)

    def step(self):
        """All that can happen at this moment."""
        if self.owner_lives:
            self.link.owner_alive(self.now + 1.0)
        self.link.update(self.now)
        if self.devices.nodes:
            self.plug.update(self.now)
        moved = True
        while moved:
            moved = False
            for data in self.link.take_output():
                moved = True
                self._listen(data)
                if self.devices.nodes and not self.loses(True, data):
                    self.plug.receive(data, self.now)
            if self.devices.nodes:
                self.plug.update(self.now)
            for data in self.plug.take_output():
                moved = True
                if not self.loses(False, data):
                    self.link.receive(data, self.now)
            self._collect()
        return self

    def call(self, what, *arguments, **more):
        """Call this method of the link now; what it sends at once comes."""
        if what == "deploy":
            self.link.deploy(*arguments, self.now, **more)
        else:
            getattr(self.link, what)(*arguments, self.now)
        return self.step()

    # -- devices that are made up -----------------------------------------------------------------

    def puppet(self, node_id):
        """What speaks and listens in the name of this node."""
        return self._ears.setdefault(node_id, Endpoint(self.layout.types, node_id))

    def say(self, node_id, name, **values):
        """This node broadcasts; state in words."""
        if "state" in values:
            values["state"] = self.definitions.constant(name, f"STATE_{values['state']}")
        puppet = self.puppet(node_id)
        puppet.broadcast(name, self.definitions.present(name, values))
        return self.deliver(puppet)

    def status(self, state, node_id=CONTROLLER, **values):
        """A ParachuteStatus."""
        filled = {"is_vehicle_connected": True, "is_enable_auto_launch": True, **values}
        return self.say(node_id, names.PARACHUTE_STATUS, state=state, **filled)

    def trigger_status(self, state="READY", node_id=TRIGGER, **more):
        """A TriggerStatus."""
        more = {"is_launched": state == "LAUNCHED", **more}
        return self.say(node_id, names.TRIGGER_STATUS, state=state, **more)

    def trigger_out(self, node_id=TRIGGER):
        """A trigger says that it has fired so often that it is believed of itself."""
        for _ in range(SAYINGS):
            self.trigger_status("LAUNCHED", node_id)
        return self

    def trigger_fired(self, node_id=TRIGGER):
        """A trigger says so often enough that it has fired as it was ordered to."""
        for _ in range(SAYINGS_ORDERED):
            self.trigger_status("LAUNCHED", node_id)
        return self

    def node_status(self, node_id=CONTROLLER, uptime=5, health=0, mode=0):
        """A NodeStatus."""
        values = {"uptime_sec": uptime, "health": health, "mode": mode}
        return self.say(node_id, "uavcan.protocol.NodeStatus", **values)

    def ask(self, type_name, node_id=CONTROLLER, number=0, **values):
        """A request of VehicleService."""
        filled = dict(values)
        if type_name:
            filled = {**self.definitions.request(names.VEHICLE_SERVICE, type_name), **values}
        puppet = self.puppet(node_id)
        puppet.request(US, names.VEHICLE_SERVICE, number, filled, 16)
        return self.deliver(puppet)

    def answer_result(self, request, result, node_id=CONTROLLER):
        """Answer with one of the results of the flyfire services."""
        puppet = self.puppet(node_id)
        values = self.definitions.result(request.name, result)
        puppet.respond_to(US, request.name, request.transfer_id, values)
        return self.deliver(puppet)

    def answer_values(self, request, values, node_id):
        """Answer with these values."""
        puppet = self.puppet(node_id)
        puppet.respond_to(US, request.name, request.transfer_id, values)
        return self.deliver(puppet)

    def deliver(self, puppet):
        """What this node has sent comes."""
        for data in puppet.take_output():
            self.link.receive(data, self.now)
        return self.step()

    # -- what came out --------------------------------------------------------------------------

    def clear(self):
        self.events.clear()
        self.heard.clear()
        self.asks.clear()
        self.controller.requests_heard.clear()
        return self

    def messages(self, name):
        """What the link broadcast under this name."""
        return [one.values for _, one in self.heard if one.name == name]

    def requests(self, name, type_name=""):
        """What the link asked by this service."""
        asked = [
            one for _, one in self.heard if one.name == name and one.kind is TransferKind.REQUEST
        ]
        if not type_name:
            return asked
        return [one for one in asked if self.definitions.type_name(name, one.values) == type_name]

    def answers(self):
        """What the link answered to VehicleService, as results without their prefix."""
        service = names.VEHICLE_SERVICE
        responses = [one for _, one in self.heard if one.kind is TransferKind.RESPONSE]
        flyfire = [one for one in responses if one.name == service]
        return [self.definitions.result_name(service, one.values) for one in flyfire]

    def ends(self, token):
        requests = [one.finished for one in self.events if isinstance(one, RequestFinished)]
        return [one for one in requests if one.token == token]

    def end(self, token):
        """How the request ended; exactly once."""
        (end,) = self.ends(token)
        return end

    def bus_request(self, token):
        """How the bus request ended; exactly once."""
        (done,) = [
            one.done
            for one in self.events
            if isinstance(one, BusRequestFinished) and one.token == token
        ]
        return done

    def steps(self, token):
        reports = [one.report for one in self.events if isinstance(one, RequestReport)]
        return [report.outcome.name for report in reports if report.token == token]

    def notices(self):
        return [one.text for one in self.events if isinstance(one, Notice)]

    def pictures(self):
        return [one.status for one in self.events if isinstance(one, ParachuteChanged)]

    def picture(self):
        return self.link.devices.picture(self.now)

    def asked(self):
        """What the supervisor was asked for: (what, for whom)."""
        return [(ask.ask.name, ask.device) for _, ask in self.asks]

    def supervisor_says(self):
        """Its state, as it is."""
        self.link.supervisor_said(bool(self.standing), set(self.standing), self.now)
        return self.step()

    # -- inside ----------------------------------------------------------------------------------

    def _devices_want(self):
        return self.plug.next_deadline() if self.devices.nodes else math.inf

    def _listen(self, data):
        first = min(self._ears)
        for node_id, ear in self._ears.items():
            one = ear.receive(data, self.now)
            if one is not None and (one.kind is not TransferKind.MESSAGE or node_id == first):
                self.heard.append((self.t, one))

    def _collect(self):
        new = self.link.take_events()
        self.events += new
        for event in new:
            if isinstance(event, KeepTable):
                self.link.table_kept(event.number, self.now)
            elif isinstance(event, AskSupervisor):
                self.asks.append((self.t, event))
                self._supervise(event)

    def _supervise(self, event):
        if not self.supervised:
            return
        if event.ask is SafetyAsk.KILL:
            self.link.kill_confirmed(self.now)
            return
        if event.ask is SafetyAsk.FLIGHT_BLOCK:
            self.standing.add(event.device)
        else:
            self.standing.discard(event.device)
        self.link.supervisor_said(bool(self.standing), set(self.standing), self.now)
