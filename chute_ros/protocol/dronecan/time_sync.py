"""The master clock of the bus: GlobalTimeSync, by one node alone.

Each message tells when the one before it was sent. Of several masters the one with the lowest node
id goes on, the others are silent until it is. Source: uavcan.protocol.GlobalTimeSync and DroneCAN
specification, "Time synchronization".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

MESSAGE = "uavcan.protocol.GlobalTimeSync"
INTERVAL = 1.0  # s, at most 1.1 by MAX_BROADCASTING_PERIOD_MS
#: RECOMMENDED_BROADCASTER_TIMEOUT_MS, s.
MASTER_TIMEOUT = 2.2


class TimeMaster:
    """Decides when to send which GlobalTimeSync. utc_offset: UTC minus monotonic time, s; taken
    once, so that the time of the bus never jumps with the wall clock."""

    def __init__(self, node_id: int, utc_offset: float) -> None:
        self._node_id = node_id
        self._utc_offset = utc_offset
        #: The other master heard last, and when (monotonic s).
        self.other = 0
        self.other_heard = -math.inf
        self._sent_at = math.nan
        self._due = -math.inf

    def heard(self, source: int, now: float) -> None:
        """A GlobalTimeSync of another node."""
        if source == 0:
            return
        lower = self.other == 0 or source <= self.other
        if lower or now - self.other_heard >= MASTER_TIMEOUT:
            self.other, self.other_heard = source, now

    def is_master(self, now: float) -> bool:
        """No node with a lower id is the master."""
        return not (0 < self.other < self._node_id and now - self.other_heard < MASTER_TIMEOUT)

    def contested(self, now: float) -> bool:
        """A node with a higher id is a master as well, and should not be."""
        return self.other > self._node_id and now - self.other_heard < MASTER_TIMEOUT

    def update(self, now: float) -> Mapping[str, Any] | None:
        """The message to send now; None: none."""
        if now < self._due:
            return None
        self._due = now + INTERVAL
        if not self.is_master(now):
            # Whoever follows must not take our old time for that of the next message.
            self._sent_at = math.nan
            return None
        before, self._sent_at = self._sent_at, now
        stamp = 0 if math.isnan(before) else round((before + self._utc_offset) * 1e6)
        return {"previous_transmission_timestamp_usec": stamp}

    def next_deadline(self) -> float:
        """When update has something to do."""
        return self._due
