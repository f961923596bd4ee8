"""Which messages an autopilot is to be asked for: those that do not come, or come too seldom.

A request, its answer or both may be lost, and an autopilot that starts anew sends what it likes,
just when the supervisor needs its measurements most: then it is asked often for a while. What is
asked for in vain again and again, or comes and goes, must not fill a slow link: requests are spent
from a store that fills slowly.

Source: MAVLink, MAV_CMD_SET_MESSAGE_INTERVAL.
"""

from __future__ import annotations

import math

from chute_ros.protocol.mavlink.dialect import dialect

#: Parts of the vehicle's picture, and the message that is asked for to have them.
ASKED_FOR: dict[str, int] = {
    "landed_state": dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    "height": dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    "tilt": dialect.MAVLINK_MSG_ID_ATTITUDE,
    "acceleration": dialect.MAVLINK_MSG_ID_SCALED_IMU,
    "battery_voltage": dialect.MAVLINK_MSG_ID_SYS_STATUS,
}
#: A message is asked for again after this at least, s.
ASK_AGAIN = 0.5
#: So many requests for it are in the store at most, and another one is after so long, s.
STORE, STORE_FILLS = 10, 5.0
#: What is not heard for so many of its intervals does not come. One that comes at less than half
#: its rate, on average, comes too seldom: rules need half of it.
_MISSING_AFTER, _TOO_SELDOM = 5.0, 2.2
#: Where the intervals are long nobody waits for five: after so many of them, or this long, s.
_MISSING_SOON, _MISSING_AT_LAST = 1.5, 2.5
#: What the newest gap counts in the average.
_WEIGHT = 0.2


class _Store:
    """Requests for one message that may still be made."""

    def __init__(self) -> None:
        self._left, self._at, self._asked = float(STORE), -math.inf, -math.inf

    def take(self, now: float) -> bool:
        """Take one, if there is one and the last was not just taken."""
        self._left = min(float(STORE), self._left + (now - self._at) / STORE_FILLS)
        self._at = now
        if self._left < 1.0 or now - self._asked < ASK_AGAIN:
            return False
        self._left, self._asked = self._left - 1.0, now
        return True


class StreamWatch:
    """Follows how often the parts in ASKED_FOR come."""

    def __init__(self) -> None:
        self._heard: dict[str, float] = {}
        self._gaps: dict[str, float] = {}
        self._stores = {part: _Store() for part in ASKED_FOR}

    def begin(self) -> None:
        """The autopilot is heard, or heard again, or started anew: nothing has come of it yet."""
        self._heard.clear()
        self._gaps.clear()

    def heard(self, part: str, now: float) -> None:
        """A part of the picture came, by whatever message."""
        before = self._heard.get(part)
        self._heard[part] = now
        if before is not None:
            gap = now - before
            average = self._gaps.get(part, gap)
            self._gaps[part] = average + _WEIGHT * (gap - average)

    def due(self, interval: float, now: float) -> tuple[int, ...]:
        """The messages to ask for now, so that each comes each interval (s)."""
        return tuple(
            message
            for part, message in ASKED_FOR.items()
            if self._lacks(part, interval, now) and self._stores[part].take(now)
        )

    def _lacks(self, part: str, interval: float, now: float) -> bool:
        soon = max(_MISSING_SOON * interval, _MISSING_AT_LAST)
        missing = now - self._heard.get(part, -math.inf) >= min(_MISSING_AFTER * interval, soon)
        return missing or self._gaps.get(part, 0.0) > _TOO_SELDOM * interval
