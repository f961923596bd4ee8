"""Round-trip time of the line to an autopilot.

A line that is full still carries its messages nearly as often as asked for, but seconds late: an
autopilot keeps what waits in a buffer. The age of what comes cannot be told by the autopilot's
clock, which need not go as ours does; the time until it answers can.

Source: MAVLink, time synchronisation protocol (TIMESYNC): who gets one with tc1 0 sends it back
with his own time in tc1 and ts1 as it was.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

from chute_ros.links.mavlink.protocol.stream_watch import LINE_CURE
from chute_ros.protocol.mavlink.dialect import dialect

#: It is asked so often, s.
EACH = 1.0
#: One that needs longer, s, is late: as late as a node may look at what comes.
LIMIT = 0.5
#: What was measured longer ago, s, says nothing of now; so many questions may be on their way.
_OLD, _MOST = 10.0, 32
_NS = 1e9


class RoundTrip:
    """Of one autopilot. All times are monotonic s; they are sent as ns."""

    def __init__(self) -> None:
        self._asked: deque[int] = deque(maxlen=_MOST)
        #: The newest two measured, s, and when the newest was.
        self._taken: deque[float] = deque(maxlen=2)
        self._asked_at = self._answered_at = -math.inf

    def question(self, now: float) -> Any | None:
        """The TIMESYNC to send now, or None."""
        if now - self._asked_at < EACH:
            return None
        self._asked_at = now
        self._asked.append(round(now * _NS))
        return dialect.MAVLink_timesync_message(0, self._asked[-1])

    def heard(self, message: Any, now: float) -> bool:
        """A TIMESYNC of the autopilot. Returns whether it answers one of ours: others do not
        count."""
        if message.tc1 == 0 or message.ts1 not in self._asked:
            return False
        while self._asked.popleft() != message.ts1:
            pass
        self._taken.append(now - message.ts1 / _NS)
        self._answered_at = now
        return True

    def seconds(self, now: float) -> float:
        """The shorter one of the newest two (one answer may have lost its way), s; NaN: it does
        not answer."""
        if len(self._taken) < 2 or now - self._answered_at > _OLD:
            return math.nan
        return min(self._taken)

    def late(self, now: float) -> bool:
        """What comes is too old to judge a flight by."""
        return self.seconds(now) > LIMIT

    def faults(self, now: float) -> list[str]:
        """That it is late, and what to do about it; empty: it is not."""
        if not self.late(now):
            return []
        took = f"answers after {self.seconds(now):.1f} s (TIMESYNC; limit {LIMIT:g} s)"
        return [f"{took}; its messages arrive late: {LINE_CURE}"]
