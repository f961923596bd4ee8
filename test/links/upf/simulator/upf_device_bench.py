"""Simulated UPF devices on a bus without any wire, and a small vehicle to talk to them."""

import math
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import (
    CONTROLLER_PARAMETERS,
    ControllerSettings,
    UpfController,
)
from chute_ros.links.upf.simulator.node import NodeSettings
from chute_ros.links.upf.simulator.trigger import TRIGGER_PARAMETERS, UpfTrigger
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.dronecan.transfer import TransferKind
from chute_ros.sim.flight import FlightModel
from chute_ros.sim.motion import Motion
from chute_ros.transport.data_types import load_data_types

VEHICLE = 10
CONTROLLER, TRIGGER = 33, 34
LAYOUTS = {"ours": "", "other": str(Path(__file__).parents[3] / "dsdl_other" / "flyfire")}
BOTH_LAYOUTS = pytest.mark.parametrize("layout", list(LAYOUTS))
#: Nothing happens by itself.
BY_REQUEST = dict.fromkeys(p.EXCLUDES.values(), False)
KILL, BLOCK, RELEASE = "TYPE_KILLSWITCH", "TYPE_FLIGHT_BLOCK", "TYPE_FLIGHT_BLOCK_RELEASE"
NODE_STATUS = "uavcan.protocol.NodeStatus"


@cache
def definitions(layout="ours"):
    """The data types; the parser takes its time."""
    return Definitions(load_data_types(LAYOUTS[layout], "test"))


@dataclass(frozen=True)
class Message:
    """A message that the vehicle heard, and when."""

    at: float
    source: int
    values: dict[str, Any]


@dataclass
class Vehicle:
    """A node that says VehicleStatus at 10 Hz, asks, answers and keeps what it hears."""

    definitions: Definitions
    node_id: int = VEHICLE
    #: What it answers to each request of VehicleService; None: nothing.
    results: dict[str, str | None] = field(default_factory=dict)
    #: It says VehicleStatus.
    speaks: bool = True

    def __post_init__(self):
        self.endpoint = Endpoint(self.definitions.types, self.node_id)
        self.messages: dict[str, list[Message]] = {}
        #: (when, TYPE_*) of each request that was heard.
        self.asked: list[tuple[float, str]] = []
        self.answers: dict[tuple[str, int], dict[str, Any]] = {}
        self._status_at = -math.inf
        self._transfer_id = 0

    def receive(self, data, now):
        heard = self.endpoint.receive(data, now)
        # A device that has just restarted begins to count anew.
        wrong = set(self.endpoint.counts) - {"duplicate transfers"}
        assert not wrong, "a device sends nothing but whole transfers"
        if heard is None:
            return
        if heard.kind is TransferKind.RESPONSE:
            self.answers[heard.name, heard.transfer_id] = heard.values
        elif heard.kind is TransferKind.REQUEST:
            self._serve(heard, now)
        else:
            message = Message(now, heard.source, heard.values)
            self.messages.setdefault(heard.name, []).append(message)

    def update(self, now):
        if self.speaks and now >= self._status_at:
            self._status_at = now + 0.1
            self.endpoint.broadcast(names.VEHICLE_STATUS, {})

    def ask(self, server, service, values):
        """Send a request; its transfer id."""
        self._transfer_id = (self._transfer_id + 1) % 32
        self.answers.pop((service, self._transfer_id), None)
        self.endpoint.request(server, service, self._transfer_id, values, 16)
        return self._transfer_id

    def _serve(self, heard, now):
        if heard.name != names.VEHICLE_SERVICE:
            return
        name = self.definitions.type_name(heard.name, heard.values)
        self.asked.append((now, name))
        result = self.results.get(name, "SUCCESS")
        if result is not None:
            self.endpoint.respond(heard, self.definitions.result(heard.name, result))


class Story:
    """A vehicle and a bus of devices; time moves only by run."""

    STEP = 0.01

    def __init__(self, layout="ours", values=None, trigger_values=None, script=None, **settings):
        self.definitions = definitions(layout)
        self.now = 1000.0
        self.began = self.now
        self.log: list[tuple[float, str]] = []
        self.flight: FlightModel | None = None
        self.vehicle = Vehicle(self.definitions)
        node = NodeSettings("upf.controller", CONTROLLER_PARAMETERS | dict(values or {}))
        self.controller = UpfController(self.definitions, ControllerSettings(node, **settings))
        node = NodeSettings("upf.trigger", TRIGGER_PARAMETERS | dict(trigger_values or {}))
        self.trigger = UpfTrigger(self.definitions, node, self._canopy)
        self.bus = UpfBus([self.controller, self.trigger], script)

    # -- time -----------------------------------------------------------------------------------

    def run(self, seconds):
        """Let time pass."""
        for _ in range(max(1, round(seconds / self.STEP))):
            self.now += self.STEP
            if self.flight is not None:
                self.flight.step(self.STEP)
                self.controller.motion = feel(self.flight)
            self.exchange()
        return self

    def exchange(self):
        """Everybody hears what the others have said, until all is said."""
        self.vehicle.update(self.now)
        self.bus.update(self.now)
        said = True
        while said:
            said = False
            for frame in self.vehicle.endpoint.take_output():
                said = True
                self.bus.receive(frame, self.now)
            self.bus.update(self.now)
            for frame in self.bus.take_output():
                said = True
                self.vehicle.receive(frame, self.now)
        self.log += [(self.now, event) for event in self.bus.take_events()]

    def until(self, condition, limit=60.0):
        """Run until condition() holds; how long that took, s."""
        began = self.now
        while not condition():
            assert self.now - began < limit, "it does not happen"
            self.run(self.STEP)
        return self.now - began

    # -- asking ---------------------------------------------------------------------------------

    def call(self, service, values, server=CONTROLLER):
        """Ask; the response, None: there was none at once."""
        transfer_id = self.vehicle.ask(server, service, values)
        self.exchange()
        return self.vehicle.answers.get((service, transfer_id))

    def result(self, service, values, server=CONTROLLER):
        """The name of the result of a flyfire service; None: no response."""
        answer = self.call(service, values, server)
        return None if answer is None else self.definitions.result_name(service, answer)

    def ask(self, name, server=CONTROLLER):
        """Ask the controller for TYPE_name; the name of its result."""
        values = self.definitions.request(names.PARACHUTE_SERVICE, f"TYPE_{name}")
        return self.result(names.PARACHUTE_SERVICE, values, server)

    def get(self, name, server=CONTROLLER):
        """GetSet without a value."""
        answer = self.call(bus_requests.GET_SET, {"name": name.encode()}, server)
        assert answer is not None
        return answer

    def set(self, name, value, server=CONTROLLER):
        """GetSet with a value; the value after it."""
        request = {"name": name.encode(), "value": p.union_of(value)}
        answer = self.call(bus_requests.GET_SET, request, server)
        assert answer is not None
        return p.value_of(answer["value"])

    def opcode(self, opcode):
        """ExecuteOpcode; whether it was done."""
        answer = self.call(bus_requests.EXECUTE_OPCODE, {"opcode": opcode})
        assert answer is not None
        return bool(answer["ok"])

    def restart(self, server=CONTROLLER):
        """RestartNode."""
        answer = self.call(
            bus_requests.RESTART_NODE, {"magic_number": bus_requests.RESTART_MAGIC}, server
        )
        assert answer == {"ok": True}

    # -- what is seen ---------------------------------------------------------------------------

    @property
    def status(self):
        """The newest ParachuteStatus that the vehicle heard."""
        return self.vehicle.messages[names.PARACHUTE_STATUS][-1].values

    @property
    def state(self):
        """The state in it."""
        return self.definitions.state(self.status["state"])

    def states(self):
        """The states so far, one after the other."""
        passed: list[ParachuteState | None] = []
        for message in self.vehicle.messages.get(names.PARACHUTE_STATUS, []):
            state = self.definitions.state(message.values["state"])
            if passed[-1:] != [state]:
                passed.append(state)
        return passed

    def asked(self):
        """What was asked of the vehicle so far."""
        return [name for _, name in self.vehicle.asked]

    def heard(self, name, source=CONTROLLER):
        """Messages of this name and node so far."""
        return [one for one in self.vehicle.messages.get(name, []) if one.source == source]

    def faults(self):
        """What the newest ParachuteStatus tells."""
        return self.definitions.faults(names.PARACHUTE_STATUS, self.status)

    def forget(self):
        """Begin to collect anew."""
        self.vehicle.messages.clear()
        self.vehicle.asked.clear()
        self.log.clear()

    def _canopy(self):
        if self.flight is not None:
            self.flight.release()

    # -- flying ---------------------------------------------------------------------------------

    def at(self, height, vertical_speed=0.0, **more):
        """The controller feels this from now on."""
        self.controller.motion = Motion(height, vertical_speed, **more)
        return self.run(0.1)

    def fall(self, height):
        """It falls; the controller has not noticed yet."""
        self.controller.motion = Motion(height, -3.0, acceleration=0.5)
        return self


def feel(flight):
    """What sensors tell of a flight."""
    return Motion(flight.height, flight.vertical_speed, abs(flight.roll), flight.acceleration)


def ready(layout="ours", values=None, **more):
    """A READY parachute that does nothing by itself, but what values say."""
    story = Story(layout, BY_REQUEST | dict(values or {}), **more).run(1.0)
    assert story.state is ParachuteState.READY
    return story


def armed(layout="ours", values=None, **more):
    """The same, ARMED at 50 m."""
    story = ready(layout, values, **more).at(50.0)
    for name, request in (("TAKEOFF", p.AUTO_TAKEOFF), ("ARM", p.AUTO_ARM)):
        if not story.controller.switch(request):
            assert story.ask(name) == "SUCCESS"
    story.run(0.2)
    assert story.state is ParachuteState.ARMED
    story.forget()
    return story
