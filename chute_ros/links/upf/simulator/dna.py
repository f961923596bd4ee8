"""A node that asks for its node id: the allocatee of dynamic node id allocation (DNA).

Source: uavcan.protocol.dynamic_node_id.Allocation, rules A to E, which are named below.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from random import Random
from typing import Any

#: Request period and follow-up delay, drawn anew each time, s (MIN_REQUEST_PERIOD_MS and others).
REQUEST_PERIOD = (0.6, 1.0)
FOLLOWUP_DELAY = (0.0, 0.4)
#: Bytes of the unique id in one request, MAX_LENGTH_OF_UNIQUE_ID_IN_REQUEST.
MOST_BYTES = 6


class NodeIdClient:
    """Asks until it is given an id. Random as the rules want it, the same for the same unit."""

    def __init__(self, unique_id: bytes) -> None:
        #: What was given; 0: nothing yet.
        self.node_id = 0
        self._unique_id = unique_id
        self._random = Random(unique_id)
        self._request_at = math.inf
        self._followup_at = math.inf
        self._followup_from = 0
        self._requests: list[dict[str, Any]] = []

    def start(self, now: float) -> None:
        """Begin to ask (rule A)."""
        self.node_id = 0
        self._requests.clear()
        self._followup_at = math.inf
        self._restart_request_timer(now)

    def heard(self, source: int, values: Mapping[str, Any], now: float) -> None:
        """An Allocation message came; source 0: of somebody who asks as well."""
        if self._request_at == math.inf:
            return
        # Rule C, and the end of a follow-up that waits (rule D).
        self._restart_request_timer(now)
        self._followup_at = math.inf
        said = bytes(values["unique_id"])
        if source == 0 or not said or not self._unique_id.startswith(said):
            return
        if len(said) < len(self._unique_id):
            self._followup_from = len(said)
            self._followup_at = now + self._random.uniform(*FOLLOWUP_DELAY)
        elif values["node_id"]:
            # Rule E.
            self.node_id = int(values["node_id"])
            self._request_at = math.inf

    def update(self, now: float) -> None:
        """Look at the clock."""
        if now >= self._followup_at:
            self._followup_at = math.inf
            self._ask(self._followup_from)
        elif now >= self._request_at:
            # Rule B.
            self._restart_request_timer(now)
            self._ask(0)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return min(self._request_at, self._followup_at)

    def take_requests(self) -> list[dict[str, Any]]:
        """Allocation messages to send without a node id; each is handed out once."""
        requests, self._requests = self._requests, []
        return requests

    def _restart_request_timer(self, now: float) -> None:
        self._request_at = now + self._random.uniform(*REQUEST_PERIOD)

    def _ask(self, known: int) -> None:
        """Send the part of the unique id that follows the known bytes."""
        part = self._unique_id[known : known + MOST_BYTES]
        self._requests.append({"first_part_of_unique_id": known == 0, "unique_id": part})
