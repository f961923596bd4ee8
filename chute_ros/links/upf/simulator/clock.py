"""The time of the bus as a simulated device keeps it: a slave of GlobalTimeSync.

Source: uavcan.protocol.GlobalTimeSync and DroneCAN specification, "Time synchronization".
"""

from __future__ import annotations

import math

from chute_ros.protocol.dronecan.time_sync import MASTER_TIMEOUT
from chute_ros.protocol.dronecan.transfer import TRANSFER_IDS


class BusClock:
    """Follows the master with the lowest node id."""

    def __init__(self) -> None:
        #: Whom it follows; 0: nobody yet.
        self.master = 0
        #: Time of the bus minus local time, s; NaN: not known.
        self.offset = math.nan
        self._heard_at = -math.inf
        self._transfer_id = -1

    def heard(self, source: int, transfer_id: int, stamp_usec: int, now: float) -> None:
        """A GlobalTimeSync came: it says when the one before it was sent."""
        lost = now - self._heard_at >= MASTER_TIMEOUT
        if source == 0 or (0 < self.master < source and not lost):
            return
        follows = transfer_id == (self._transfer_id + 1) % TRANSFER_IDS
        if source == self.master and follows and not lost and stamp_usec:
            self.offset = stamp_usec / 1e6 - self._heard_at
        self.master, self._transfer_id, self._heard_at = source, transfer_id, now
