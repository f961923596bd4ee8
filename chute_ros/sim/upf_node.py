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

from chute_ros.protocol.dronecan.allocation import FOLLOWUP_TIMEOUT
from chute_ros.protocol.dronecan.allocation import MESSAGE as ALLOCATION
from chute_ros.protocol.dronecan.calls import CallLimits, ServiceCalls
from chute_ros.protocol.dronecan.endpoint import Endpoint, Heard
from chute_ros.protocol.dronecan.transfer import Kind
from chute_ros.protocol.upf import errands
from chute_ros.protocol.upf import parameters as p
from chute_ros.protocol.upf.definitions import Definitions

NODE_STATUS = "uavcan.protocol.NodeStatus"
#: Between two requests for a node id, s (MIN_REQUEST_PERIOD_MS 600 to MAX 1000).
_DNA_PERIOD = 0.7
_PARTS = (6, 6, 4)


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


class UpfNode:
    """One node. The subclass fills messages, services, broadcasts and actions."""

    def __init__(self, definitions: Definitions, settings: NodeSettings) -> None:
        self.definitions = definitions
        self.settings = settings
        self.now = 0.0
        self.booted_at = math.nan
        #: Reads, but answers no request.
        self.mute = False
        #: Sends nothing at all.
        self.silent = False
        self.health = settings.health
        #: Non-volatile memory, and what is in use.
        self.saved: dict[str, p.Value] = dict(settings.values)
        self.values: dict[str, p.Value] = dict(settings.values)
        #: Message type -> what it does with (source, values).
        self.messages: dict[str, Callable[[int, Mapping[str, Any]], None]] = {}
        #: Service type -> what it answers to a request.
        self.services: dict[str, Callable[[Heard], dict[str, Any] | None]] = {
            errands.GET_NODE_INFO: self._get_node_info,
            errands.GET_SET: self._get_set,
            errands.EXECUTE_OPCODE: self._execute_opcode,
            errands.TRANSPORT_STATS: self._transport_stats,
            errands.RESTART_NODE: self._restart_node,
        }
        #: What is broadcast: message type -> (interval in s, what makes it).
        self.broadcasts: dict[str, tuple[Callable[[], float], Callable[[], dict[str, Any]]]] = {
            NODE_STATUS: (lambda: self._interval(p.NODE_STATUS_INTERVAL), self._node_status),
        }
        self.actions: dict[str, Callable[[str], None]] = {
            "mute": lambda _: setattr(self, "mute", True),
            "unmute": lambda _: setattr(self, "mute", False),
            "silent": lambda _: setattr(self, "silent", True),
            "speak": lambda _: setattr(self, "silent", False),
            "reboot": lambda _: self.reboot(),
        }
        #: Action -> what turns its argument from text; KeyError or ValueError if it is none.
        self.arguments: dict[str, Callable[[str], Any]] = {}
        self.calls = ServiceCalls(CallLimits(0.3, 3))
        self.endpoint = Endpoint(definitions.types, 0)
        self._due: dict[str, float] = {}
        self._dna_due = math.inf
        self._dna_confirmed = 0
        self._events: list[str] = []
        #: The answer to a restart, which is sent before it.
        self._last_words: list[bytes] = []

    @property
    def node_id(self) -> int:
        """0: it has none yet."""
        return self.endpoint.node_id

    # -- as the bus wants it --------------------------------------------------------------------

    def receive(self, data: bytes, now: float) -> None:
        """Bytes of a frame came."""
        self.start(now)
        self.now = now
        heard = self.endpoint.receive(data, now)
        if heard is None:
            return
        if heard.kind is Kind.RESPONSE:
            transfer_id = heard.transfer_id
            self.calls.response(heard.source, heard.name, transfer_id, heard.values, now)
        elif heard.kind is Kind.REQUEST:
            self._serve(heard)
        elif heard.name == ALLOCATION:
            self._allocation(heard)
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
        if not self.node_id:
            if now >= self._dna_due:
                self._ask_for_id(0)
        else:
            self.step(now)
            for name, (interval, make) in self.broadcasts.items():
                if now >= self._due.get(name, -math.inf):
                    self._due[name] = now + interval()
                    self.broadcast(name, make())
        for send in self.calls.take_output():
            call = send.command
            self.endpoint.request(
                call.server, call.service, send.transfer_id, call.values, call.priority
            )
        self.answered()

    def next_deadline(self) -> float:
        """When update has something to do."""
        if math.isnan(self.booted_at):
            return 0.0
        if not self.node_id:
            return self._dna_due
        due = [self._due.get(name, -math.inf) for name in self.broadcasts]
        return min([*due, self.calls.next_deadline(), self.next_step()])

    def take_output(self) -> list[bytes]:
        """Frames to send; each is handed out once. None while it is silent."""
        frames = [*self._last_words, *self.endpoint.take_output()]
        self._last_words.clear()
        return [] if self.silent else frames

    def take_events(self) -> list[str]:
        """Lines for whoever watches; each is handed out once."""
        events, self._events = self._events, []
        return events

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
        self.mute = self.silent = False
        self.health = self.settings.health
        self.values = dict(self.saved)
        self.calls = ServiceCalls(CallLimits(0.3, 3))
        node_id = int(self.values[p.STATIC_NODE_ID])
        self.endpoint = Endpoint(self.definitions.types, node_id)
        self._due = {}
        self._dna_due = self.now if node_id == 0 else math.inf
        self._dna_confirmed = 0
        self.say(f"started as node {node_id}" if node_id else "started without a node id")

    def broadcast(self, name: str, values: Mapping[str, Any], priority: int = 16) -> None:
        """Send a message, of which the types in use may lack some fields."""
        self.endpoint.broadcast(name, self.definitions.present(name, values), priority)

    def send_soon(self, name: str) -> None:
        """This broadcast is news."""
        self._due[name] = self.now

    def act(self, action: str) -> None:
        """Do what --at says: "name" or "name=argument"."""
        name, _, argument = action.partition("=")
        self.say(f"action {action}")
        self.actions[name](argument)

    def say(self, text: str) -> None:
        """One line for whoever watches."""
        self._events.append(f"{self.settings.name}: {text}")

    def switch(self, name: str) -> bool:
        """A parameter that switches something."""
        return bool(self.values[name])

    # -- services -------------------------------------------------------------------------------

    def _serve(self, request: Heard) -> None:
        if self.mute or not self.node_id:
            return
        handler = self.services.get(request.name)
        answer = None if handler is None else handler(request)
        if answer is not None:
            self.endpoint.respond(request, answer)
            if request.name == errands.RESTART_NODE and answer["ok"]:
                self._last_words += self.endpoint.take_output()
                self.reboot()

    def _interval(self, name: str) -> float:
        return float(self.values[name]) / 1000.0

    def _uptime(self) -> int:
        return int(self.now - self.booted_at)

    def _node_status(self) -> dict[str, Any]:
        return {"uptime_sec": self._uptime(), "health": self.health}

    def _get_node_info(self, request: Heard) -> dict[str, Any]:
        return {
            "status": self._node_status(),
            "software_version": {"major": 3, "minor": 0},
            "hardware_version": {"major": 3, "unique_id": self.settings.unique_id},
            "name": self.settings.name.encode(),
        }

    def _transport_stats(self, request: Heard) -> dict[str, Any]:
        return {
            "transfers_tx": self.endpoint.sent_count,
            "transfers_rx": self.endpoint.received_count,
            "transfer_errors": sum(self.endpoint.counts.values()),
        }

    def _restart_node(self, request: Heard) -> dict[str, Any]:
        return {"ok": request.values["magic_number"] == errands.RESTART_MAGIC}

    def _get_set(self, request: Heard) -> dict[str, Any]:
        name = bytes(request.values["name"]).decode("utf-8", "replace")
        names = list(self.values)
        if not name and request.values["index"] < len(names):
            name = names[request.values["index"]]
        if name not in self.values:
            return {}
        wanted = p.value_of(request.values["value"])
        if wanted is not None:
            self._set(name, wanted)
        documented = p.BY_NAME[name]
        answer: dict[str, Any] = {
            "name": name.encode(),
            "value": p.union_of(self.values[name]),
            "default_value": p.union_of(self.settings.values[name]),
        }
        if documented.kind is int:
            answer["min_value"] = {"integer_value": documented.minimum}
            answer["max_value"] = {"integer_value": documented.maximum}
        return answer

    def _set(self, name: str, wanted: p.Value) -> None:
        """Take a value if it is of the right kind and in range; keep it, if that is wanted."""
        documented = p.BY_NAME[name]
        if documented.kind is bool:
            if isinstance(wanted, str):
                return
            self.values[name] = bool(wanted)
        elif isinstance(wanted, (int, float)) and not isinstance(wanted, bool):
            number = int(wanted)
            if not documented.minimum <= number <= documented.maximum:
                return
            self.values[name] = number
        else:
            return
        self.say(f"{name} = {p.words(self.values[name])}")
        if self.switch(p.AUTO_SAVE) or name == p.AUTO_SAVE:
            self.saved[name] = self.values[name]
        self.parameter_changed(name)

    def parameter_changed(self, name: str) -> None:
        """A parameter has a new value."""

    def _execute_opcode(self, request: Heard) -> dict[str, Any]:
        opcode = request.values["opcode"]
        if opcode == errands.OPCODE_SAVE:
            self.saved = dict(self.values)
        elif opcode == errands.OPCODE_ERASE:
            # Takes effect at the next start, as the standard type's comment allows.
            self.saved = dict(self.settings.values)
        else:
            return {"ok": False}
        return {"ok": True}

    # -- node id --------------------------------------------------------------------------------

    def _ask_for_id(self, known: int) -> None:
        """Send the part of the unique id that follows the known bytes."""
        part = _PARTS[known // 6]
        unique_id = self.settings.unique_id[known : known + part]
        self._dna_due = self.now + (_DNA_PERIOD if known == 0 else FOLLOWUP_TIMEOUT)
        values = {"first_part_of_unique_id": known == 0, "unique_id": unique_id}
        self.endpoint.broadcast(ALLOCATION, values)

    def _allocation(self, heard: Heard) -> None:
        if self.node_id or heard.source == 0:
            return
        said = bytes(heard.values["unique_id"])
        if not said or not self.settings.unique_id.startswith(said):
            # Somebody else is being served: try again later.
            self._dna_due = self.now + _DNA_PERIOD
        elif len(said) == len(self.settings.unique_id):
            node_id = heard.values["node_id"]
            if node_id:
                self.endpoint.node_id = node_id
                self._dna_due = math.inf
                self.say(f"was given node id {node_id}")
        elif len(said) in (6, 12):
            self._ask_for_id(len(said))
