"""Which messages an autopilot is to be asked for: those that do not come, or come too seldom.

A request, its answer or both may be lost, and an autopilot that starts anew sends what it likes,
just when the supervisor needs its measurements most: then it is asked often for a while. What is
asked for in vain again and again must not fill a slow link: such requests are spent from a store
that fills slowly. A stream that comes, but too seldom for the rules (a ground station sets another
rate again and again), is asked for as long as that is so, within a share of what the line carries.

Messages that make the picture better, and without which the rules still work, are asked for one
after the other once the needed ones had their time, a few times each, and then left alone until
the autopilot is heard anew: not every autopilot has them. Where the line is too slow for the
needed ones they are given up again, the least useful first.

Source: MAVLink, MAV_CMD_SET_MESSAGE_INTERVAL.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.stream_rate import TOLERANCE, StreamRate

#: Parts of the vehicle's picture, and the message that is asked for to have them.
ASKED_FOR: dict[str, int] = {
    "landed_state": dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    "height": dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    "tilt": dialect.MAVLINK_MSG_ID_ATTITUDE,
    "acceleration": dialect.MAVLINK_MSG_ID_SCALED_IMU,
    "battery_voltage": dialect.MAVLINK_MSG_ID_SYS_STATUS,
}
#: What changes slowly is asked for at no shorter interval than this, s.
_SHORTEST = {"battery_voltage": 1.0}
#: What the rules of flight measure with, by name.
_JUDGED = {"height": "GLOBAL_POSITION_INT", "tilt": "ATTITUDE", "acceleration": "SCALED_IMU"}
#: A message is asked for again after this at least, s.
ASK_AGAIN = 0.5
#: So many requests for it are in the store at most, and another one is after so long, s.
STORE, STORE_FILLS = 10, 5.0
#: What is asked for because it comes too seldom takes this share of what is received. A request
#: takes so many bytes, and so many requests may be saved up.
_LINE_SHARE, _REQUEST_BYTES, _SAVED = 0.02, 45.0, 10
#: What is not heard for so many of its intervals does not come.
_MISSING_AFTER = 5.0
#: Where the intervals are long nobody waits for five: after so many of them, or this long, s.
_MISSING_SOON, _MISSING_AT_LAST = 1.5, 2.5

#: So much seldomer than the needed ones.
SELDOMER = 2.0
#: The needed ones alone are asked for at first, s.
AFTER = 1.0
#: So often one is asked for in vain, so long after each other, s.
TRIES, WAIT = 3, 3.0
#: One after the other is given up, so long after each other, s: rates need a while to recover.
GIVE_UP_EACH = 4.0
#: One at less than half of its rate, or silent for so long, s, does not come as asked.
_TOO_SELDOM, _SILENCE = 2.2, 2.5

#: What a person can do about a line that is full.
LINE_CURE = (
    "the line to the autopilot is overloaded: raise its baud rate, or switch off streams "
    "that other programs request on it"
)
_STREAM_CURE = (
    "another program sets its rate, or the line is full: end the ground station or "
    "program that requests it, or remove its stream rates in the autopilot's settings"
)
_NEVER_CURE = (
    "the rules are blind without it: switch its stream on in the autopilot's settings, or fly "
    "without (needed_message_rate 0)"
)
#: A message that the autopilot is asked for, and that does not come for so long, never does, s.
NEVER_AFTER = 8.0


@dataclass(frozen=True)
class IntervalRequest:
    """Ask for a message each interval, s; 0: at the rate that the autopilot chooses."""

    message_id: int
    interval: float


class _Store:
    """Requests for one message that may still be made."""

    def __init__(self) -> None:
        self._left, self._at = float(STORE), -math.inf

    def take(self, now: float) -> bool:
        """Take one, if there is one."""
        self._left = min(float(STORE), self._left + (now - self._at) / STORE_FILLS)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class StreamWatch:
    """Follows how often the parts in ASKED_FOR come.

    needed: the rate that the rules need, Hz; 0: half of what is asked for is enough, and nothing
    is said of slow streams."""

    def __init__(self, needed: float) -> None:
        self._needed = needed
        self.begin()
        self.fill_stores()
        self._saved = 0.0

    def fill_stores(self) -> None:
        """As if nothing had been asked for yet: another interval is to be asked for."""
        self._stores = {part: _Store() for part in ASKED_FOR}
        self._asked = dict.fromkeys(ASKED_FOR, -math.inf)

    def begin(self) -> None:
        """The autopilot is heard, or heard again, or started anew: nothing has come of it yet."""
        self._rates = {part: StreamRate(self._needed) for part in ASKED_FOR}
        self._begun = math.nan

    def received(self, size: int) -> None:
        """The line carried so many bytes."""
        self._saved = min(_SAVED * _REQUEST_BYTES, self._saved + _LINE_SHARE * size)

    def heard(self, part: str, now: float) -> None:
        """A part of the picture came, by whatever message."""
        if part in ASKED_FOR:
            self._rates[part].heard(now)

    def due(self, interval: float, now: float) -> tuple[IntervalRequest, ...]:
        """What to ask for now, so that each message comes each interval (s), or seldomer if that
        is enough."""
        asks = []
        for part, message in ASKED_FOR.items():
            each = max(interval, _SHORTEST.get(part, 0.0))
            if self._lacks(part, each, now) and self._take(part, now):
                asks.append(IntervalRequest(message, each))
        return tuple(asks)

    def slow(self, now: float) -> dict[str, float]:
        """Messages that the rules need and that come too seldom for a while, with their rates."""
        return {
            name: self._rates[part].rate(now)
            for part, name in _JUDGED.items()
            if self._rates[part].too_slow(now)
        }

    def missing(self, now: float) -> list[str]:
        """Messages that the rules need and that have never come, once they had their time."""
        if math.isnan(self._begun):
            self._begun = now
        if not self._needed or now - self._begun < NEVER_AFTER:
            return []
        return [name for part, name in _JUDGED.items() if self._rates[part].newest == -math.inf]

    def line_is_slow(self, now: float) -> bool:
        """All that the rules need comes too seldom, not one stream that somebody slowed down."""
        return len(self.slow(now)) == len(_JUDGED)

    def faults(self, now: float) -> list[str]:
        """What is too slow, and what to do about it."""
        cure = LINE_CURE if self.line_is_slow(now) else _STREAM_CURE
        missing = [f"{name} has never come: {_NEVER_CURE}" for name in self.missing(now)]
        return missing + [
            f"{name} comes at {rate:.1f} Hz (need {self._needed:g} Hz): {cure}"
            for name, rate in self.slow(now).items()
        ]

    def _lacks(self, part: str, interval: float, now: float) -> bool:
        rate = self._rates[part]
        soon = max(_MISSING_SOON * interval, _MISSING_AT_LAST)
        if now - rate.newest >= min(_MISSING_AFTER * interval, soon):
            return True
        enough = 0.5 / interval
        if part in _JUDGED and self._needed:
            enough = min(self._needed, 1.0 / interval)
        return rate.average < enough / TOLERANCE

    def _take(self, part: str, now: float) -> bool:
        if now - self._asked[part] < ASK_AGAIN:
            return False
        comes = self._rates[part].newest > self._asked[part]
        if not self._stores[part].take(now):
            if not comes or self._saved < _REQUEST_BYTES:
                return False
            self._saved -= _REQUEST_BYTES
        self._asked[part] = now
        return True


class OptionalStreams:
    """Follows what was asked for. wanted in each call: message id -> name, most useful first."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """The autopilot is heard anew."""
        self._begun = math.nan
        self._asked_at = self._gave_up_at = -math.inf
        self._asked: dict[int, float] = {}
        self._tries: defaultdict[int, int] = defaultdict(int)
        self.given_up: set[int] = set()

    def due(
        self,
        wanted: Mapping[int, str],
        rates: Mapping[str, StreamRate],
        interval: float,
        now: float,
    ) -> tuple[IntervalRequest, ...]:
        """What to ask for now; interval: of the needed ones, s."""
        if math.isnan(self._begun):
            self._begun = now
        if now - max(self._begun + AFTER - ASK_AGAIN, self._asked_at) < ASK_AGAIN:
            return ()
        for message_id, name in wanted.items():
            if self._comes(rates.get(name), interval * SELDOMER, now):
                self._tries[message_id] = 0
            elif self._may_ask(message_id, now):
                self._tries[message_id] += 1
                self._asked[message_id] = self._asked_at = now
                return (IntervalRequest(message_id, interval * SELDOMER),)
        return ()

    def give_up(self, wanted: Mapping[int, str], now: float) -> tuple[IntervalRequest, ...]:
        """The line is too slow: the next one goes back to the rate that the autopilot chooses."""
        if now - self._gave_up_at < GIVE_UP_EACH:
            return ()
        for message_id in reversed(list(wanted)):
            if message_id in self._asked and message_id not in self.given_up:
                self.given_up.add(message_id)
                self._gave_up_at = now
                return (IntervalRequest(message_id, 0.0),)
        return ()

    def _may_ask(self, message_id: int, now: float) -> bool:
        waited = now - self._asked.get(message_id, -math.inf) >= WAIT
        return message_id not in self.given_up and self._tries[message_id] < TRIES and waited

    @staticmethod
    def _comes(stream: StreamRate | None, interval: float, now: float) -> bool:
        if stream is None or now - stream.newest > _SILENCE:
            return False
        return stream.average >= 1.0 / (_TOO_SELDOM * interval)
