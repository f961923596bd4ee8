"""The vehicle's node on a DroneCAN bus: its status, the others, node ids, the time.

What comes for it by the standard types is served here; everything else is handed on. Source:
DroneCAN specification, "Application level functions"; uavcan.protocol.*.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from chute_ros.errors import MessageError, ParameterError
from chute_ros.protocol.dronecan import allocation, time_sync
from chute_ros.protocol.dronecan.allocation import UNIQUE_ID_LENGTH, Allocator
from chute_ros.protocol.dronecan.calls import Call, CallFinished, CallLimits, SendCall
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.protocol.dronecan.endpoint import Endpoint, ReceivedTransfer
from chute_ros.protocol.dronecan.node_monitor import NodeMonitor
from chute_ros.protocol.dronecan.scripts import Script, Scripts
from chute_ros.protocol.dronecan.time_sync import TimeMaster
from chute_ros.protocol.dronecan.transfer import HIGHEST_NODE_ID, TransferKind
from chute_ros.protocol.events import EventLog, Severity

NODE_STATUS = "uavcan.protocol.NodeStatus"
GET_NODE_INFO = "uavcan.protocol.GetNodeInfo"
NODE_STATUS_INTERVAL = 0.5  # s, at most 1 by MAX_BROADCASTING_PERIOD_MS
#: No node id is given out before the bus was listened to for this long (s): NodeStatus comes at
#: least once a second.
LISTEN_TIME = 1.2
#: Somebody who sent under our node id so lately (s) is there.
_OWN_ID_WINDOW = 5.0
_SOFTWARE_VERSION = (0, 1)
#: Bytes of a node's name (uavcan.protocol.GetNodeInfo).
MOST_NAME_BYTES = 80
_REFUSED = ("uavcan.protocol.RestartNode", "uavcan.protocol.param.ExecuteOpcode")


@dataclass(frozen=True)
class BusNodeConfig:
    """Who we are on the bus, and which of its offices we hold."""

    node_id: int
    name: str
    unique_id: bytes
    calls: CallLimits = field(default=CallLimits())
    allocator: bool = True
    #: To another allocator, and until it is known that there is none.
    allocator_yields: bool = False
    table: Mapping[bytes, int] = field(default_factory=dict)
    #: Node ids that are never given out, besides our own.
    never: tuple[int, ...] = ()
    time_master: bool = True
    utc_offset: float = 0.0

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= HIGHEST_NODE_ID:
            raise ParameterError(f"node_id is {self.node_id}: need 1 to {HIGHEST_NODE_ID}")
        if not 1 <= len(self.name.encode()) <= MOST_NAME_BYTES:
            raise ParameterError(f"name is {self.name!r}: need 1 to {MOST_NAME_BYTES} bytes")
        if len(self.unique_id) != UNIQUE_ID_LENGTH:
            raise ParameterError(
                f"unique_id has {len(self.unique_id)} bytes: need {UNIQUE_ID_LENGTH}"
            )
        if not math.isfinite(self.utc_offset):
            raise ParameterError(f"utc_offset is {self.utc_offset}: need a number of seconds")


class BusNode(EventLog):
    """One node; the owner feeds frames in and sends what take_output gives. Its events are notices
    and tables to keep (KeepTable)."""

    def __init__(self, types: DataTypes, config: BusNodeConfig) -> None:
        super().__init__()
        self.config = config
        self.endpoint = Endpoint(types, config.node_id)
        self.nodes = NodeMonitor()
        self.scripts = Scripts(config.calls)
        never = (config.node_id, *config.never)
        self.allocator = Allocator(config.table, never, config.allocator_yields)
        self.time = TimeMaster(config.node_id, config.utc_offset)
        self._started = math.nan
        self._status_at = -math.inf
        self._alive_until = -math.inf
        self._troubles: dict[str, str] = {}
        self._ended: list[tuple[object, object]] = []

    @property
    def counts(self) -> Counter[str]:
        """Why something was dropped -> how often."""
        return self.endpoint.counts + self.scripts.calls.counts

    def owner_alive(self, until: float) -> None:
        """We may seem alive until this time: a hung owner must look dead from outside."""
        self._alive_until = until

    def receive(self, data: bytes, now: float) -> ReceivedTransfer | None:
        """Bytes of a frame came; what the owner should know of, or None."""
        heard = self.endpoint.receive(data, now)
        if heard is None:
            return None
        if heard.kind is TransferKind.RESPONSE:
            if heard.name.startswith("uavcan."):
                self.scripts.calls.response(
                    heard.source, heard.name, heard.transfer_id, heard.values, now
                )
                self._drive(now)
                return None
        elif heard.kind is TransferKind.REQUEST:
            if heard.name.startswith("uavcan."):
                self._serve(heard, now)
                return None
        elif heard.name == allocation.MESSAGE:
            self._allocation(heard, now)
        elif heard.name == time_sync.MESSAGE:
            self.time.heard(heard.source, now)
        elif heard.name == NODE_STATUS and heard.source:
            self.nodes.status(heard.source, heard.values, now, heard.transfer_id)
        return heard

    def update(self, now: float) -> None:
        """Look at the clock."""
        if math.isnan(self._started):
            self._started = now
        self.scripts.update(now)
        self.nodes.forget_gone(now)
        if now < self._alive_until:
            self._speak(now)
        else:
            # What was due until then is not said any more.
            self._status_at = max(self._status_at, self._alive_until)
        for node_id in self.nodes.to_ask(now):
            self.scripts.begin(("who is", node_id), _who_is(node_id), now)
        self._drive(now)
        self._look_for_trouble(now)
        for text in self.nodes.take_news(now):
            self.notice(Severity.ERROR, text)

    def next_deadline(self) -> float:
        """When update has something to do."""
        deadlines = [self.scripts.calls.next_deadline(), self.nodes.next_deadline()]
        if self._status_at < self._alive_until:
            deadlines.append(self._status_at)
            if self.config.time_master:
                deadlines.append(self.time.next_deadline())
        return min(deadlines)

    def begin(self, token: object, script: Script, now: float) -> None:
        """Run a bus request; its result comes from take_ended."""
        self.scripts.begin(token, script, now)
        self._drive(now)

    def table_kept(self, number: int) -> None:
        """The allocation table of this KeepTable is safe."""
        self.allocator.kept(number)
        self._answer_allocations()

    def take_ended(self) -> list[tuple[object, object]]:
        """(token, result) of the bus requests that ended; each is handed out once."""
        ended, self._ended = self._ended, []
        return ended

    def take_output(self) -> list[bytes]:
        """Frames to send, oldest first; each is handed out once."""
        return self.endpoint.take_output()

    def troubles(self) -> list[str]:
        """What is wrong on the bus, in words."""
        return list(self._troubles.values())

    def uptime(self, now: float) -> int:
        """Whole seconds since the first update."""
        return 0 if math.isnan(self._started) else int(now - self._started)

    # -- inside ----------------------------------------------------------------------------------

    def _speak(self, now: float) -> None:
        if now >= self._status_at:
            self._status_at = now + NODE_STATUS_INTERVAL
            self.endpoint.broadcast(NODE_STATUS, {"uptime_sec": self.uptime(now)})
            self.allocator.update(self._in_use(), now)
            self._events += self.allocator.take_keep()
        if self.config.time_master:
            stamp = self.time.update(now)
            if stamp is not None:
                self.endpoint.broadcast(time_sync.MESSAGE, stamp, priority=8)

    def _drive(self, now: float) -> None:
        self.scripts.drive(now)
        while sends := self.scripts.take_output():
            for send in sends:
                self._send(send, now)
            self.scripts.drive(now)
        for token, result in self.scripts.take_ended():
            if isinstance(token, tuple) and token[0] == "who is":
                if result is not None:
                    self.nodes.information(token[1], result, now)
            else:
                self._ended.append((token, result))

    def _send(self, send: SendCall, now: float) -> None:
        call = send.command
        try:
            self.endpoint.request(
                call.server, call.service, send.transfer_id, call.values, call.priority
            )
        except MessageError as error:
            self.scripts.calls.unsendable(send, str(error), now)

    def _serve(self, request: ReceivedTransfer, now: float) -> None:
        """The standard services of ours."""
        if request.name == GET_NODE_INFO:
            self.endpoint.respond(request, self._information(now))
        elif request.name == "uavcan.protocol.GetTransportStats":
            stats = {
                "transfers_tx": self.endpoint.sent_count,
                "transfers_rx": self.endpoint.received_count,
                "transfer_errors": sum(self.endpoint.counts.values()),
            }
            self.endpoint.respond(request, stats)
        elif request.name in _REFUSED:
            # Nobody on the bus restarts a safety node; its parameters are those of ROS.
            self.endpoint.respond(request, {"ok": False})
        elif request.name == "uavcan.protocol.param.GetSet":
            self.endpoint.respond(request, {})
        else:
            self.endpoint.counts["requests that this node does not serve"] += 1

    def _information(self, now: float) -> dict[str, object]:
        major, minor = _SOFTWARE_VERSION
        return {
            "status": {"uptime_sec": self.uptime(now)},
            "software_version": {"major": major, "minor": minor},
            "hardware_version": {"unique_id": self.config.unique_id},
            "name": self.config.name.encode(),
        }

    def _allocation(self, heard: ReceivedTransfer, now: float) -> None:
        if not self.config.allocator:
            return
        # Every node has spoken once by then, whatever its id.
        listened = now - self._started >= LISTEN_TIME
        discovered = listened and self.nodes.all_discovered(now)
        before = self.allocator.left_to
        self.allocator.heard(heard.source, heard.values, self._in_use(), discovered, now)
        self._tell_who_allocates(before)
        self._answer_allocations()

    def _in_use(self) -> dict[int, bytes]:
        """Node id -> unique id (empty: not known)."""
        in_use = {entry.node_id: entry.unique_id for entry in self.nodes.all()}
        in_use[self.config.node_id] = self.config.unique_id
        return in_use

    def _tell_who_allocates(self, before: int) -> None:
        """Once each time it changes. before: the node that did."""
        now = self.allocator.left_to
        if now and now != before:
            text = f"node {now} gives out node ids, so this node does not (parameter allocator)"
            self.notice(Severity.INFO, text)
        elif before and not now:
            text = (
                f"node {before} no longer answers requests for a node id: this node gives "
                "them out again"
            )
            self.notice(Severity.WARNING, text)

    def _answer_allocations(self) -> None:
        for answer in self.allocator.take_answers():
            self.endpoint.broadcast(allocation.MESSAGE, answer)
        self._events += self.allocator.take_keep()

    def _look_for_trouble(self, now: float) -> None:
        """Say what is wrong when it begins, and when it is over."""
        now_wrong = self._find_trouble(now)
        for key, text in now_wrong.items():
            if key not in self._troubles:
                self.notice(Severity.ERROR, text)
        for key, text in self._troubles.items():
            if key not in now_wrong:
                self.notice(Severity.INFO, f"resolved: {text}")
        self._troubles = now_wrong

    def _find_trouble(self, now: float) -> dict[str, str]:
        found = {
            f"conflict {node_id}": f"two nodes use node id {node_id}: give one of them another"
            for node_id in self.nodes.conflicts(now)
        }
        endpoint, own = self.endpoint, self.config.node_id
        if now - endpoint.own_id_heard < _OWN_ID_WINDOW:
            found["own id"] = f"another node uses our node id {own}: set node_id to a free one"
        if endpoint.bus_off:
            found["bus-off"] = (
                "the CAN controller is bus-off (wiring, bit rate, resistor?); set a "
                "restart time to recover: ip link set canX type can restart-ms 100"
            )
        rivals = self.config.allocator and not self.config.allocator_yields
        if rivals and self.allocator.another_is_there(now):
            found["allocator"] = (
                f"node {self.allocator.other} gives out node ids as well: switch one of the two "
                "off (parameter allocator, auto leaves it to the other); ours is silent"
            )
        if self.config.time_master and self.time.contested(now):
            found["time"] = (
                f"node {self.time.other} is a time master as well and should yield to us ({own}): "
                "switch one of the two off (parameter time_master)"
            )
        return found


def _who_is(node_id: int) -> Script:
    answer: CallFinished = yield Call(node_id, GET_NODE_INFO, {}, priority=24)
    return answer.values
