"""Who is on the bus: nodes by their NodeStatus, who they are by GetNodeInfo, who is there twice.

Source: DroneCAN specification, "Application level conventions", node status and node discovery.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

#: Silent for longer is gone (uavcan.protocol.NodeStatus.OFFLINE_TIMEOUT_MS), s.
OFFLINE_TIMEOUT = 3.0
#: A node that does not tell who it is is asked again after this (s), and taken as it is after so
#: many questions.
_ASK_INTERVAL = 1.0
_MOST_QUESTIONS = 5
#: Two starts that lie closer than this (s) are one: NodeStatus counts whole seconds.
_SAME_START = 2.5
#: Two clocks that are both heard within this time (s) are two nodes, not one that restarted.
_CONFLICT_WINDOW = 5.0


@dataclass
class NodeEntry:
    """One node. Times are monotonic s."""

    node_id: int
    heard: float
    health: int = 0
    mode: int = 0
    vendor_status: int = 0
    uptime: int = 0
    restarts: int = 0
    information: Mapping[str, Any] | None = None
    #: How often it was asked; one more once it did not answer the last time.
    questions: int = 0
    asked: float = -math.inf
    conflict_heard: float = -math.inf
    #: When the node started, by each of its newest statuses: (start, heard).
    starts: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=24))

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
        return now - self.conflict_heard < _CONFLICT_WINDOW


class NodeMonitor:
    """Follows all nodes. The owner asks those in to_ask for their GetNodeInfo."""

    def __init__(self) -> None:
        self._nodes: dict[int, NodeEntry] = {}
        self._restarted: list[int] = []

    def status(self, node_id: int, values: Mapping[str, Any], now: float) -> None:
        """A NodeStatus of node_id (not 0) came."""
        entry = self._nodes.get(node_id)
        if entry is None or not entry.alive(now):
            entry = self._nodes[node_id] = NodeEntry(node_id, now)
        entry.heard = now
        entry.health, entry.mode = values["health"], values["mode"]
        entry.vendor_status = values["vendor_specific_status_code"]
        entry.uptime = values["uptime_sec"]
        self._watch_start(entry, now)

    def information(self, node_id: int, values: Mapping[str, Any], now: float) -> None:
        """A response to our GetNodeInfo came."""
        entry = self._nodes.get(node_id)
        if entry is None:
            return
        before = entry.unique_id
        entry.information = values
        if before and before != entry.unique_id:
            entry.conflict_heard = now

    def to_ask(self, now: float) -> list[int]:
        """Nodes to ask for GetNodeInfo now; each is told once an interval."""
        due = []
        for entry in self._alive(now):
            if not entry.discovered and now >= entry.asked + _ASK_INTERVAL:
                entry.asked = now
                entry.questions += 1
                if not entry.discovered:
                    due.append(entry.node_id)
        return due

    def next_deadline(self) -> float:
        """When to_ask or forget_gone has something to do; infinity: never."""
        questions = [e.asked + _ASK_INTERVAL for e in self._nodes.values() if not e.discovered]
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

    def _alive(self, now: float) -> list[NodeEntry]:
        return [e for e in self._nodes.values() if e.alive(now)]

    def _watch_start(self, entry: NodeEntry, now: float) -> None:
        start = now - entry.uptime
        recent = [(one, at) for one, at in entry.starts if now - at < _CONFLICT_WINDOW]
        newest = entry.starts[-1][0] if entry.starts else start
        if abs(start - newest) >= _SAME_START:
            # Uptimes are whole seconds: a start of the clock that has just ended may lie near.
            others = [one for one, _ in recent if abs(one - newest) >= _SAME_START]
            if any(abs(start - one) < _SAME_START for one in others):
                # The clock before the last one is heard again: two nodes take turns.
                entry.conflict_heard = now
            elif start > newest:
                entry.restarts += 1
                entry.information, entry.questions = None, 0
                self._restarted.append(entry.node_id)
        entry.starts.append((start, now))
