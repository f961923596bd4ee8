"""Node ids for nodes that have none: a centralized allocator.

A node asks without a node id, in three parts of its unique id (6 + 6 + 4 bytes); each part is
echoed, and the last one answered with the node id. The table of unique id to node id must be kept
before the answer leaves: after a crash between the two the same id could be given to two nodes.
Source: DroneCAN specification, "Dynamic node ID allocation", centralized allocator;
uavcan.protocol.dynamic_node_id.Allocation.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from chute_ros.errors import ParameterError

MESSAGE = "uavcan.protocol.dynamic_node_id.Allocation"
UNIQUE_ID_LENGTH = 16
#: How many bytes each of the three requests carries (specification: at most 6).
_PARTS = (6, 6, 4)
#: A request whose next part does not come within this time starts anew (FOLLOWUP_TIMEOUT_MS), s.
FOLLOWUP_TIMEOUT = 0.5
#: While another allocator was heard so lately (s), nothing is given out: a bus has only one.
OTHER_ALLOCATOR_TIMEOUT = 10.0
#: Node ids that may be given out; 126 and 127 belong to tools (specification).
LOWEST, HIGHEST = 1, 125

Table = Mapping[bytes, int]


@dataclass(frozen=True)
class KeepTable:
    """The table has a new entry: keep it, then say so to Allocator.kept with this number."""

    number: int
    table: Table


class Allocator:
    """Gives out node ids. table: as kept last. never: ids that are not given out, whoever asks.

    ParameterError for a table that nobody can have kept.
    """

    def __init__(self, table: Table, never: Collection[int]) -> None:
        _check(table)
        self.table: dict[bytes, int] = dict(table)
        self.given_count = 0
        #: Another allocator was heard, as its node id, at this monotonic time (s).
        self.other = 0
        self.other_heard = -math.inf
        #: Why the newest request was not served; empty: it was.
        self.refusal = ""
        self._never = frozenset(never)
        self._query = b""
        self._query_at = -math.inf
        #: Unique ids whose entry may not be safe -> the first KeepTable that holds it.
        self._unkept: dict[bytes, int] = {}
        self._last_number = 0
        self._answers: list[dict[str, Any]] = []
        self._keep: list[KeepTable] = []

    def heard(
        self,
        source: int,
        values: Mapping[str, Any],
        in_use: Mapping[int, bytes],
        all_discovered: bool,
        now: float,
    ) -> None:
        """An Allocation message came. in_use: node id -> unique id (empty: not known)."""
        if source != 0:
            self.other, self.other_heard = source, now
            return
        if self.another_is_there(now):
            self.refusal = f"node {self.other} allocates as well"
            return
        if now - self._query_at > FOLLOWUP_TIMEOUT:
            self._query = b""
        part = bytes(values["unique_id"])
        if values["first_part_of_unique_id"]:
            self._query = b""
        stage = {0: 0, 6: 1, 12: 2}.get(len(self._query))
        first = bool(values["first_part_of_unique_id"])
        if stage is None or first != (stage == 0) or len(part) != _PARTS[stage]:
            return  # a part of somebody else's request, or one that was cut short
        self._query += part
        self._query_at = now
        if len(self._query) < UNIQUE_ID_LENGTH:
            self._answer(self._query, 0)
            return
        unique_id, self._query = self._query, b""
        if not all_discovered:
            self.refusal = "not every node has said who it is yet"
            return
        self._allocate(unique_id, int(values["node_id"]), in_use)

    def kept(self, number: int) -> None:
        """The table of this KeepTable is safe: the nodes in it may have their ids."""
        for unique_id in [one for one, first in self._unkept.items() if first <= number]:
            del self._unkept[unique_id]
            self._give(unique_id)

    def another_is_there(self, now: float) -> bool:
        """Another allocator was heard of late."""
        return now - self.other_heard < OTHER_ALLOCATOR_TIMEOUT

    def take_answers(self) -> list[dict[str, Any]]:
        """Allocation messages to broadcast; each is handed out once."""
        answers, self._answers = self._answers, []
        return answers

    def take_keep(self) -> list[KeepTable]:
        """Tables to keep; each is handed out once."""
        keep, self._keep = self._keep, []
        return keep

    def _allocate(self, unique_id: bytes, wanted: int, in_use: Mapping[int, bytes]) -> None:
        self.refusal = ""
        known = self.table.get(unique_id)
        mine = known is not None and in_use.get(known, unique_id) == unique_id
        if mine and known not in self._never:
            if unique_id in self._unkept:
                # It was not kept yet, or could not be: once more.
                self._hand_out_table()
            else:
                self._give(unique_id)
            return
        # It has none, or somebody else sits there now, with an id that nobody gave it.
        free = self._free(wanted, in_use)
        if free is None:
            self.refusal = "no node id is free"
            return
        self.table[unique_id] = free
        self._hand_out_table()
        self._unkept[unique_id] = self._last_number

    def _hand_out_table(self) -> None:
        self._last_number += 1
        self._keep.append(KeepTable(self._last_number, dict(self.table)))

    def _give(self, unique_id: bytes) -> None:
        self._answer(unique_id, self.table[unique_id])
        self.given_count += 1

    def _free(self, wanted: int, in_use: Mapping[int, bytes]) -> int | None:
        """The wanted id or the next free one above it, else the highest free one."""
        taken = self._never | set(in_use) | set(self.table.values())
        upwards = range(wanted, HIGHEST + 1) if wanted else range(0)
        candidates = [*upwards, *range(HIGHEST, LOWEST - 1, -1)]
        return next((one for one in candidates if one not in taken), None)

    def _answer(self, unique_id: bytes, node_id: int) -> None:
        self._answers.append(
            {"unique_id": unique_id, "node_id": node_id, "first_part_of_unique_id": False}
        )


def _check(table: Table) -> None:
    for unique_id, node_id in table.items():
        if len(unique_id) != UNIQUE_ID_LENGTH or not LOWEST <= node_id <= HIGHEST:
            raise ParameterError(
                f"table of node ids: {unique_id.hex()} has {node_id}; need {UNIQUE_ID_LENGTH} "
                f"bytes and {LOWEST} to {HIGHEST}"
            )
    if len(set(table.values())) < len(table):
        raise ParameterError("table of node ids: two units have the same node id")
