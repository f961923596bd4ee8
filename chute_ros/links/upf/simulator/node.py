"""What every simulated UPF device does as a DroneCAN node: status, parameters, services, node id.

Pure like the protocols: it is run by the same loop and knows neither the bus nor the clock.
Source: Flyfire UPF UAVCAN protocol V1.0, "node discovery", "standard UAVCAN protocols" and
"parameters"; DroneCAN specification, "Dynamic node ID allocation".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.simulator.clock import BusClock
from chute_ros.links.upf.simulator.dna import NodeIdClient
from chute_ros.links.upf.simulator.memory import ParameterMemory
from chute_ros.protocol.dronecan import time_sync
from chute_ros.protocol.dronecan.allocation import MESSAGE as ALLOCATION
from chute_ros.protocol.dronecan.calls import CallLimits, ServiceCalls
from chute_ros.protocol.dronecan.endpoint import Endpoint, ReceivedTransfer
from chute_ros.protocol.dronecan.transfer import TransferKind
from chute_ros.sim.acting import Actor

NODE_STATUS = "uavcan.protocol.NodeStatus"
_CALLS = CallLimits(0.3, 3)


@dataclass(frozen=True)
class NodeSettings:
    """How a simulated node starts. values: its parameters as delivered."""

    name: str
    values: Mapping[str, p.Value] = field(default_factory=dict)
    health: int = 0

    @property
    def unique_id(self) -> bytes:
        """Sixteen bytes of its own."""
        return sha256(self.name.encode()).digest()[:16]


class UpfNode(Actor):
    """One node. The subclass fills messages, services, broadcasts and actions."""

    def __init__(self, definitions: Definitions, settings: NodeSettings) -> None:
        super().__init__(settings.name)
        self.definitions = definitions
        self.settings = settings
        self.now = 0.0
        self.booted_at = math.nan
        #: Reads, but obeys and answers no request.
        self.mute = False
        #: Sends nothing at all.
        self.silent = False
        #: Answers FAILED to what would release the canopy.
        self.refuses = False
        self.health = settings.health
        #: NodeStatus.mode is MODE_INITIALIZATION.
        self.initializing = False
        self.memory = ParameterMemory(settings.values)
        #: Message type -> what it does with (source, values).
        self.messages: dict[str, Callable[[int, Mapping[str, Any]], None]] = {}
        #: Service type -> what it answers to a request.
        self.services: dict[str, Callable[[ReceivedTransfer], dict[str, Any] | None]] = {
            bus_requests.GET_NODE_INFO: self._get_node_info,
            bus_requests.GET_SET: self._get_set,
            bus_requests.EXECUTE_OPCODE: self._execute_opcode,
            bus_requests.TRANSPORT_STATS: self._transport_stats,
            bus_requests.RESTART_NODE: self._restart_node,
        }
        #: What is broadcast: message type -> (interval in s, what makes it).
        self.broadcasts: dict[str, tuple[Callable[[], float], Callable[[], dict[str, Any]]]] = {
            NODE_STATUS: (lambda: self._interval(p.NODE_STATUS_INTERVAL), self._node_status)
        }
        self.actions = {
            "mute": lambda _: setattr(self, "mute", True),
            "unmute": lambda _: setattr(self, "mute", False),
            "silent": lambda _: setattr(self, "silent", True),
            "speak": lambda _: setattr(self, "silent", False),
            "reboot": lambda _: self.reboot(),
            "refuse": lambda _: setattr(self, "refuses", True),
            "accept": lambda _: setattr(self, "refuses", False),
            "repack": lambda _: self.repack(),
        }
        self.calls = ServiceCalls(_CALLS)
        self.endpoint = Endpoint(definitions.types, 0)
        self.clock = BusClock()
        self._dna = NodeIdClient(settings.unique_id)
        self._due: dict[str, float] = {}
        #: The answer to a restart, which is sent before it.
        self._last_words: list[bytes] = []

    @property
    def node_id(self) -> int:
        """0: it has none yet."""
        return self.endpoint.node_id

    @property
    def values(self) -> dict[str, p.Value]:
        """The parameters in use."""
        return self.memory.values

    @property
    def saved(self) -> dict[str, p.Value]:
        """The parameters that a restart brings back."""
        return self.memory.saved

    # -- as the bus wants it --------------------------------------------------------------------

    def receive(self, data: bytes, now: float) -> None:
        """Bytes of a frame came."""
        self.start(now)
        self.now = now
        heard = self.endpoint.receive(data, now)
        if heard is None:
            return
        if heard.kind is TransferKind.RESPONSE:
            transfer_id = heard.transfer_id
            self.calls.response(heard.source, heard.name, transfer_id, heard.values, now)
        elif heard.kind is TransferKind.REQUEST:
            self._serve(heard)
        elif heard.name == ALLOCATION:
            self._allocation(heard.source, heard.values)
        elif heard.name == time_sync.MESSAGE:
            stamp = heard.values["previous_transmission_timestamp_usec"]
            self.clock.heard(heard.source, heard.transfer_id, stamp, now)
        elif heard.name in self.messages:
            self.messages[heard.name](heard.source, heard.values)

    def start(self, now: float) -> None:
        """Boot, unless it runs."""
        if math.isnan(self.booted_at):
            self.now = now
            self.reboot()

    def update(self, now: float) -> None:
        """Look at the clock."""
        self.start(now)
        self.now = now
        self.calls.update(now)
        if self.node_id:
            self._run(now)
            return
        self._dna.update(now)
        for values in self._dna.take_requests():
            self.endpoint.broadcast(ALLOCATION, values)

    def next_deadline(self) -> float:
        """When update has something to do."""
        if math.isnan(self.booted_at):
            return 0.0
        if not self.node_id:
            return self._dna.next_deadline()
        due = [self._due.get(name, -math.inf) for name in self.broadcasts]
        return min([*due, self.calls.next_deadline(), self.next_step()])

    def take_output(self) -> list[bytes]:
        """Frames to send; each is handed out once. None while it is silent."""
        frames = [*self._last_words, *self.endpoint.take_output()]
        self._last_words.clear()
        return [] if self.silent else frames

    # -- for the subclass -----------------------------------------------------------------------

    def step(self, now: float) -> None:
        """Move the device's own world on to now."""

    def next_step(self) -> float:
        """When step has something to do."""
        return math.inf

    def answered(self) -> None:
        """Look at what came of our own calls."""
        self.calls.take_finished()

    def reboot(self) -> None:
        """Start anew with what was saved."""
        self.booted_at = self.now
        if self.silent:
            self.take_output()
        self.mute = self.silent = False
        self.health = self.settings.health
        self.memory.restart()
        self.calls = ServiceCalls(_CALLS)
        node_id = int(self.values[p.STATIC_NODE_ID])
        self.endpoint = Endpoint(self.definitions.types, node_id)
        self.clock = BusClock()
        self._due = {}
        self._dna = NodeIdClient(self.settings.unique_id)
        if node_id == 0:
            self._dna.start(self.now)
        self.say(f"started as node {node_id}" if node_id else "started without a node id")

    def repack(self) -> None:
        """Start anew with the canopy packed."""
        self.refuses = False
        self.reboot()

    def broadcast(self, name: str, values: Mapping[str, Any], priority: int = 16) -> None:
        """Send a message, of which the types in use may lack some fields; only with a node id."""
        if self.node_id:
            self.endpoint.broadcast(name, self.definitions.present(name, values), priority)

    def send_soon(self, name: str) -> None:
        """This broadcast is news."""
        self._due[name] = self.now

    def switch(self, name: str) -> bool:
        """A parameter that switches something."""
        return bool(self.values[name])

    def _run(self, now: float) -> None:
        """All that a node with an id does by itself."""
        self.step(now)
        for name, (interval, make) in self.broadcasts.items():
            due = self._due.get(name, -math.inf)
            if now >= due:
                following = due + interval()
                self._due[name] = following if following > now else now + interval()
                self.broadcast(name, make())
        self.answered()
        for send in self.calls.take_output():
            call = send.command
            self.endpoint.request(
                call.server, call.service, send.transfer_id, call.values, call.priority
            )

    # -- services -------------------------------------------------------------------------------

    def _serve(self, request: ReceivedTransfer) -> None:
        if self.mute or not self.node_id:
            return
        handler = self.services.get(request.name)
        answer = None if handler is None else handler(request)
        if answer is not None:
            self.endpoint.respond(request, answer)
            if request.name == bus_requests.RESTART_NODE and answer["ok"]:
                self._last_words += self.endpoint.take_output()
                self.reboot()

    def _allocation(self, source: int, values: Mapping[str, Any]) -> None:
        self._dna.heard(source, values, self.now)
        if self._dna.node_id and not self.node_id:
            self.endpoint.node_id = self._dna.node_id
            self.say(f"was given node id {self.node_id}")

    def _interval(self, name: str) -> float:
        return float(self.values[name]) / 1000.0

    def _node_status(self) -> dict[str, Any]:
        uptime = int(self.now - self.booted_at)
        return {"uptime_sec": uptime, "health": self.health, "mode": int(self.initializing)}

    def _get_node_info(self, request: ReceivedTransfer) -> dict[str, Any]:
        return {
            "status": self._node_status(),
            "software_version": {"major": 3, "minor": 0},
            "hardware_version": {"major": 3, "unique_id": self.settings.unique_id},
            "name": self.settings.name.encode(),
        }

    def _transport_stats(self, request: ReceivedTransfer) -> dict[str, Any]:
        return {
            "transfers_tx": self.endpoint.sent_count,
            "transfers_rx": self.endpoint.received_count,
            "transfer_errors": sum(self.endpoint.counts.values()),
        }

    def _restart_node(self, request: ReceivedTransfer) -> dict[str, Any]:
        return {"ok": request.values["magic_number"] == bus_requests.RESTART_MAGIC}

    def _get_set(self, request: ReceivedTransfer) -> dict[str, Any]:
        name = self.memory.name_of(request.values)
        wanted = p.value_of(request.values["value"])
        if name and wanted is not None and self.memory.set(name, wanted):
            self.say(f"{name} = {p.words(self.values[name])}")
            self.parameter_changed(name)
        return self.memory.answer(name)

    def _execute_opcode(self, request: ReceivedTransfer) -> dict[str, Any]:
        before = dict(self.values)
        done = self.memory.execute(request.values["opcode"])
        for name, value in self.values.items():
            if value != before[name]:
                self.parameter_changed(name)
        return {"ok": done}

    def parameter_changed(self, name: str) -> None:
        """A parameter has a new value."""
        if name == p.NODE_STATUS_INTERVAL:
            self.send_soon(NODE_STATUS)
