"""Which messages an autopilot is to be asked for: those that do not come, or come too seldom.

A request, its answer or both may be lost, and an autopilot that starts anew sends what it likes,
just when the supervisor needs its measurements most: then it is asked often for a while.

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
#: Asked again after this (s), and after the longer one once it was asked often for so long.
ASK_AGAIN, ASK_OFTEN_FOR, ASK_SELDOM = 0.5, 5.0, 5.0
#: What is not heard for so many of its intervals does not come. One that comes at less than half
#: its rate, on average, comes too seldom: rules need half of it.
_MISSING_AFTER, _TOO_SELDOM = 5.0, 2.2
#: What the newest gap counts in the average.
_WEIGHT = 0.2


class StreamWatch:
    """Follows how often the parts in ASKED_FOR come."""

    def __init__(self) -> None:
        self._began = -math.inf
        self._asked: dict[str, float] = {}
        self._heard: dict[str, float] = {}
        self._gaps: dict[str, float] = {}

    def begin(self, now: float) -> None:
        """The autopilot is heard, or heard again, or started anew: all is to be asked for."""
        self._began = now
        for times in (self._asked, self._heard, self._gaps):
            times.clear()

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
        again = ASK_AGAIN if now < self._began + ASK_OFTEN_FOR else ASK_SELDOM
        wanted = [
            part
            for part in ASKED_FOR
            if now - self._asked.get(part, -math.inf) >= again and self._lacks(part, interval, now)
        ]
        self._asked.update(dict.fromkeys(wanted, now))
        return tuple(ASKED_FOR[part] for part in wanted)

    def _lacks(self, part: str, interval: float, now: float) -> bool:
        missing = now - self._heard.get(part, -math.inf) >= _MISSING_AFTER * interval
        return missing or self._gaps.get(part, 0.0) > _TOO_SELDOM * interval
