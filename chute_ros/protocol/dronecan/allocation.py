"""Node ids for nodes that have none: a centralized allocator.

A node asks without a node id, in three parts of its unique id (6 + 6 + 4 bytes); each part is
echoed, and the last one answered with the node id. The table of unique id to node id must be kept
before the answer leaves: after a crash between the two the same id could be given to two nodes.
Source: DroneCAN specification, "Dynamic node ID allocation", centralized allocator;
uavcan.protocol.dynamic_node_id.Allocation.
"""

from __future__ import annotations

import math
from collections import deque
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
#: A request that no other allocator has answered within this time (s) is ours to answer. A node
#: asks each 0.6 to 1 s (MIN_REQUEST_PERIOD_MS), so that two or three requests wait.
FIRST_PATIENCE = 2.0
#: The same once another allocator was heard, s.
PATIENCE = 10.0
#: Node ids that may be given out; 126 and 127 belong to tools (specification).
LOWEST, HIGHEST = 1, 125
#: Of units that were never seen before so many are given an id within NEW_WITHIN (s); a bus with
#: more new devices waits a minute.
MOST_NEW = 10
NEW_WITHIN = 60.0
#: A unit that was given an id and does not use it for so long (s) loses it.
UNUSED_FOR = 600.0
#: A unit that used its id so lately (s) keeps it, though no other is left.
USED_WITHIN = 3600.0

Table = Mapping[bytes, int]


@dataclass(frozen=True)
class KeepTable:
    """The table has changed: keep it, then say so to Allocator.kept with this number.

    Its order is what a table that is kept tells of age: units that were never heard with their
    id come first, then those that were, the newest last.
    """

    number: int
    table: Table


class Allocator:
    """Gives out node ids. table: as kept last, in its order. never: ids that are not given out,
    whoever asks. yields: to another allocator; requests wait until it is known that there is none.

    Strangers must not use up all ids: only MOST_NEW units a minute get their first one, and an id
    that is given out and not used goes back to the others, as does the one that was used longest
    ago where none is left. ParameterError for a table that nobody can have kept.
    """

    def __init__(self, table: Table, never: Collection[int], yields: bool = False) -> None:
        _check(table)
        self.table: dict[bytes, int] = dict(table)
        #: Another allocator was heard, as its node id, at this monotonic time (s).
        self.other = 0
        self.other_heard = -math.inf
        #: Why the newest request was not served; empty: it was.
        self.refusal = ""
        self.yields = yields
        #: A request waits since then for another allocator's answer, monotonic s; infinity: none.
        self._waits_since = math.inf
        self._on_duty = not yields
        self._never = frozenset(never)
        self._query = b""
        self._query_at = -math.inf
        #: Unique ids whose entry may not be safe -> the first KeepTable that holds it.
        self._unkept: dict[bytes, int] = {}
        #: When units that were not heard with their id yet were given it, monotonic s.
        self._unused: dict[bytes, float] = {}
        #: When units were last heard with the id that they have from here.
        self._used_at: dict[bytes, float] = {}
        self._new: deque[float] = deque(maxlen=MOST_NEW)
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
            self._waits_since = math.inf
            if self.yields:
                self._on_duty, self.refusal = False, ""
            return
        if not self._is_ours(bool(values["first_part_of_unique_id"]), now):
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
            self.refusal = "not every node has identified itself yet"
            return
        self._allocate(unique_id, int(values["node_id"]), in_use, now)

    def update(self, in_use: Mapping[int, bytes], now: float) -> None:
        """Look at the clock, often: who uses its id keeps it; one that is not used goes back."""
        before = list(self._unused)
        for node_id, unique_id in in_use.items():
            if self.table.get(unique_id) == node_id:
                if unique_id not in self._used_at:
                    self.table[unique_id] = self.table.pop(unique_id)
                self._used_at[unique_id] = now
                self._unused.pop(unique_id, None)
        for unique_id, given in list(self._unused.items()):
            if now - given >= UNUSED_FOR and self.table[unique_id] not in in_use:
                self._forget(unique_id)
        if before != list(self._unused):
            self._hand_out_table()

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

    @property
    def left_to(self) -> int:
        """The node that gives out the ids instead of us; 0: nobody does that we know of."""
        return self.other if self.yields and not self._on_duty else 0

    def _is_ours(self, first: bool, now: float) -> bool:
        """This part of a request is ours to answer."""
        if not self.yields:
            if self.another_is_there(now):
                self.refusal = f"node {self.other} allocates as well"
                return False
            return True
        if not self._on_duty and first:
            self._waits_since = min(self._waits_since, now)
            self._on_duty = now - self._waits_since >= (PATIENCE if self.other else FIRST_PATIENCE)
            if self._on_duty:
                self.other = 0
            else:
                self.refusal = "waiting for another allocator to answer"
        return self._on_duty

    def _allocate(
        self, unique_id: bytes, wanted: int, in_use: Mapping[int, bytes], now: float
    ) -> None:
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
        if known is None:
            if len(self._new) == MOST_NEW and now - self._new[0] < NEW_WITHIN:
                self.refusal = f"more than {MOST_NEW} new units within {NEW_WITHIN:g} s"
                return
            self._new.append(now)
        free = self._free(wanted, in_use) or self._take_back(unique_id, in_use, now)
        if free is None:
            self.refusal = "no node id is free"
            return
        if known is not None:
            self._forget(unique_id)
        # At the front, as nobody has used it yet.
        self.table = {unique_id: free, **self.table}
        self._unused[unique_id] = now
        self._hand_out_table()
        self._unkept[unique_id] = self._last_number

    def _take_back(self, asks: bytes, in_use: Mapping[int, bytes], now: float) -> int | None:
        """The id of the unit that never used it, or used it longest ago; None: all use theirs."""
        for unique_id, node_id in self.table.items():
            lately = now - self._used_at.get(unique_id, -math.inf) < USED_WITHIN
            taken = node_id in in_use or node_id in self._never
            if unique_id != asks and not lately and not taken:
                self._forget(unique_id)
                return node_id
        return None

    def _forget(self, unique_id: bytes) -> None:
        del self.table[unique_id]
        for about in (self._unused, self._used_at, self._unkept):
            about.pop(unique_id, None)

    def _hand_out_table(self) -> None:
        self._last_number += 1
        self._keep.append(KeepTable(self._last_number, dict(self.table)))

    def _give(self, unique_id: bytes) -> None:
        self._answer(unique_id, self.table[unique_id])

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
