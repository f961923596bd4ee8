"""Who is on the bus: nodes by their NodeStatus, who they are by GetNodeInfo, who is there twice.

Source: DroneCAN specification, "Application level conventions", node status and node discovery.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from chute_ros.protocol.dronecan.transfer import TRANSFER_IDS

#: Silent for longer is gone (uavcan.protocol.NodeStatus.OFFLINE_TIMEOUT_MS), s.
OFFLINE_TIMEOUT = 3.0
#: Each node is asked who it is after this (s), so many times: of two with one id that were
#: switched on together either may answer. One that never does is taken as it is then.
_ASK_INTERVAL = 1.0
_MOST_QUESTIONS = 5
#: Two starts that lie closer than this (s) are one: NodeStatus counts whole seconds.
_SAME_START = 2.5
#: A sign of two nodes under one id holds for this time (s): no sign disproves it, and of two that
#: are asked who they are, each other answer may be lost. If nobody speaks, it is over at once.
_CONFLICT_HOLDS = 30.0
_MOST_CLOCKS = 4
#: Signs and clocks that lie further apart (s) have nothing to do with each other; nor have unique
#: ids, as a node with two is asked each second.
_MEMORY, _UNIQUE_ID_MEMORY = 60.0, 12.0
#: So many NodeStatus within this time (s) that do not count on: two nodes count, each for itself.
_MOST_MISCOUNTS = 3
_MISCOUNTS_WITHIN = 10.0
#: Between two questions to a node that is known (s): another one may have come in its place.
_ASK_AGAIN = 10.0
#: What looks like a restart or another device may be two nodes under one id: told after this, s.
_TELL_AFTER = 2.5


@dataclass
class _Clock:
    """By its NodeStatus a node started at start, as last heard. Monotonic s."""

    start: float
    heard: float


@dataclass
class NodeEntry:
    """One node. Times are monotonic s."""

    node_id: int
    heard: float
    uptime: int = 0
    restarts: int = 0
    information: Mapping[str, Any] | None = None
    #: How often it was asked; of one that never answered, one more once its time is over.
    questions: int = 0
    asked: float = -math.inf
    conflict_until: float = -math.inf
    #: Heard under this id, the newest last.
    clocks: list[_Clock] = field(default_factory=list)
    unique_ids: dict[bytes, float] = field(default_factory=dict)
    #: Of the newest NodeStatus, and when one did not count on.
    transfer_id: int = -1
    miscounts: list[float] = field(default_factory=list)

    @property
    def unique_id(self) -> bytes:
        """Sixteen bytes; empty: not known."""
        if self.information is None:
            return b""
        return bytes(self.information["hardware_version"]["unique_id"])

    @property
    def name(self) -> str:
        """As the node calls itself; empty: not known."""
        if self.information is None:
            return ""
        return bytes(self.information["name"]).decode("utf-8", "replace")

    @property
    def discovered(self) -> bool:
        """It said who it is, or will not."""
        return self.information is not None or self.questions > _MOST_QUESTIONS

    def alive(self, now: float) -> bool:
        """It was heard of late."""
        return now < self.heard + OFFLINE_TIMEOUT

    def conflict(self, now: float) -> bool:
        """Two nodes use this id, by what was heard of late."""
        return now < self.conflict_until

    def conflict_shows(self, now: float) -> None:
        """A sign that two nodes use this id."""
        self.conflict_until = now + _CONFLICT_HOLDS


class NodeMonitor:
    """Follows all nodes. The owner asks those in to_ask for their GetNodeInfo."""

    def __init__(self) -> None:
        self._nodes: dict[int, NodeEntry] = {}
        self._restarted: list[int] = []
        #: The newest unique id of each node id, of nodes that are gone as well.
        self._owners: dict[int, bytes] = {}
        #: What is told unless it turns out to be a conflict: when each happened.
        self._restarts_to_tell: dict[int, float] = {}
        self._replaced_to_tell: dict[int, tuple[float, bytes]] = {}
        self._replaced: list[int] = []

    def status(
        self, node_id: int, values: Mapping[str, Any], now: float, transfer_id: int = -1
    ) -> None:
        """A NodeStatus of node_id (not 0) came. transfer_id: 0 to 31, -1: not known."""
        entry = self._nodes.get(node_id)
        if entry is None or not entry.alive(now):
            entry = self._nodes[node_id] = NodeEntry(node_id, now)
        entry.heard = now
        miscounts = (entry.transfer_id - transfer_id) % TRANSFER_IDS < TRANSFER_IDS // 2
        if miscounts and -1 not in (entry.transfer_id, transfer_id):
            self._does_not_count_on(entry, values["uptime_sec"], now)
        entry.uptime, entry.transfer_id = values["uptime_sec"], transfer_id
        self._watch_start(entry, now)

    def information(self, node_id: int, values: Mapping[str, Any], now: float) -> None:
        """A response to our GetNodeInfo came."""
        entry = self._nodes.get(node_id)
        if entry is None:
            return
        entry.information, unique_id = values, bytes(values["hardware_version"]["unique_id"])
        entry.unique_ids[unique_id] = now
        entry.unique_ids = {
            one: at for one, at in entry.unique_ids.items() if now - at < _UNIQUE_ID_MEMORY
        }
        if len(entry.unique_ids) > 1:
            entry.conflict_shows(now)
        before = self._owners.get(node_id, unique_id)
        self._owners[node_id] = unique_id
        if before != unique_id:
            self._replaced_to_tell.setdefault(node_id, (now, before))

    def to_ask(self, now: float) -> list[int]:
        """Nodes to ask for GetNodeInfo now; each is told once an interval."""
        due = []
        for entry in self._alive(now):
            if now < entry.asked + self._ask_interval(entry):
                continue
            entry.asked = now
            entry.questions += 1
            if entry.information is not None or not entry.discovered:
                due.append(entry.node_id)
        return due

    @staticmethod
    def _ask_interval(entry: NodeEntry) -> float:
        """Infinity: it is not asked any more."""
        if entry.questions <= _MOST_QUESTIONS:
            return _ASK_INTERVAL
        if entry.information is None:
            return math.inf
        return _ASK_INTERVAL if len(entry.unique_ids) > 1 else _ASK_AGAIN

    def next_deadline(self) -> float:
        """When to_ask or forget_gone has something to do; infinity: never."""
        questions = [entry.asked + self._ask_interval(entry) for entry in self._nodes.values()]
        ends = [e.heard + OFFLINE_TIMEOUT for e in self._nodes.values()]
        return min([*questions, *ends], default=math.inf)

    def forget_gone(self, now: float) -> None:
        """Forget the nodes that are gone: whoever comes under this id again may be another."""
        alive = {entry.node_id for entry in self._alive(now)}
        for node_id in set(self._nodes) - alive:
            del self._nodes[node_id]

    def get(self, node_id: int) -> NodeEntry | None:
        """What is known of one node."""
        return self._nodes.get(node_id)

    def all(self) -> list[NodeEntry]:
        """Every node that is there."""
        return [self._nodes[node_id] for node_id in sorted(self._nodes)]

    def all_discovered(self, now: float) -> bool:
        """Every node has said who it is, or will not: the condition for an allocation."""
        return all(entry.discovered for entry in self._alive(now))

    def conflicts(self, now: float) -> list[int]:
        """Node ids that two nodes use."""
        return [entry.node_id for entry in self.all() if entry.conflict(now)]

    def take_restarted(self) -> list[int]:
        """Nodes that started anew; each restart is handed out once."""
        restarted, self._restarted = self._restarted, []
        return restarted

    def take_replaced(self) -> list[int]:
        """Node ids that belong to another device than before; each is handed out once."""
        replaced, self._replaced = self._replaced, []
        return replaced

    def take_news(self, now: float) -> list[str]:
        """What happened to nodes that are no conflict, in words; each is handed out once."""
        news = []
        for node_id, at in list(self._restarts_to_tell.items()):
            if now - at >= _TELL_AFTER:
                del self._restarts_to_tell[node_id]
                if node_id not in self.conflicts(now):
                    news.append(f"node {node_id} restarted")
        for node_id, (at, before) in list(self._replaced_to_tell.items()):
            if now - at >= _TELL_AFTER and node_id in self._replaced_to_tell:
                del self._replaced_to_tell[node_id]
                if node_id not in self.conflicts(now):
                    news.append(self._told_replaced(node_id, before))
        return news

    def _told_replaced(self, node_id: int, before: bytes) -> str:
        unique_id = self._owners[node_id]
        self._replaced.append(node_id)
        for other, (_, others) in self._replaced_to_tell.items():
            if (others, self._owners[other]) == (unique_id, before):
                del self._replaced_to_tell[other]
                self._replaced.append(other)
                return (
                    f"nodes {node_id} and {other} have swapped their node ids: check which device "
                    "is which (controller_node_id, trigger_node_id)"
                )
        return (
            f"node {node_id} is another device than before: unique id {unique_id.hex()}, "
            f"it was {before.hex()}"
        )

    def _alive(self, now: float) -> list[NodeEntry]:
        return [e for e in self._nodes.values() if e.alive(now)]

    @staticmethod
    def _does_not_count_on(entry: NodeEntry, uptime: int, now: float) -> None:
        if uptime < entry.uptime:
            return  # it started anew, or its clock says already that there are two
        entry.miscounts = [*(at for at in entry.miscounts if now - at < _MISCOUNTS_WITHIN), now]
        if len(entry.miscounts) >= _MOST_MISCOUNTS:
            entry.conflict_shows(now)

    def _watch_start(self, entry: NodeEntry, now: float) -> None:
        start = now - entry.uptime
        newest = entry.clocks[-1] if entry.clocks else None
        clocks = [clock for clock in entry.clocks if now - clock.heard < _MEMORY]
        # Uptimes are whole seconds: the newest clock first, as another may lie near.
        same = [one for one in reversed(clocks) if abs(start - one.start) < _SAME_START]
        if newest is not None and abs(start - newest.start) < _SAME_START:
            same = [newest]
        if newest is None or not same:
            clock = _Clock(start, now)
            if newest is not None and start > newest.start:
                self._has_restarted(entry, now)
        else:
            clock = same[0]
            if clock is not newest:
                # The clock before the last one is heard again: two nodes take turns.
                entry.conflict_shows(now)
        clock.start, clock.heard = start, now
        entry.clocks = [*(one for one in clocks if one is not clock), clock][-_MOST_CLOCKS:]

    def _has_restarted(self, entry: NodeEntry, now: float) -> None:
        entry.restarts += 1
        entry.information, entry.questions, entry.asked = None, 0, -math.inf
        entry.unique_ids.clear()
        self._restarted.append(entry.node_id)
        self._restarts_to_tell.setdefault(entry.node_id, now)
