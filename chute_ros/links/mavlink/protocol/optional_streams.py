"""Messages that make the picture better, and without which the rules still work.

They are asked for one after the other once the needed ones had their time, a few times each, and
then left alone until the autopilot is heard anew: not every autopilot has them. Where the line is
too slow for the needed ones they are given up again, the least useful first.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping

from chute_ros.links.mavlink.protocol.stream_watch import ASK_AGAIN, Ask, StreamRate

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
    ) -> tuple[Ask, ...]:
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
                return (Ask(message_id, interval * SELDOMER),)
        return ()

    def give_up(self, wanted: Mapping[int, str], now: float) -> tuple[Ask, ...]:
        """The line is too slow: the next one goes back to the rate that the autopilot chooses."""
        if now - self._gave_up_at < GIVE_UP_EACH:
            return ()
        for message_id in reversed(list(wanted)):
            if message_id in self._asked and message_id not in self.given_up:
                self.given_up.add(message_id)
                self._gave_up_at = now
                return (Ask(message_id, 0.0),)
        return ()

    def _may_ask(self, message_id: int, now: float) -> bool:
        waited = now - self._asked.get(message_id, -math.inf) >= WAIT
        return message_id not in self.given_up and self._tries[message_id] < TRIES and waited

    @staticmethod
    def _comes(stream: StreamRate | None, interval: float, now: float) -> bool:
        if stream is None or now - stream.newest > _SILENCE:
            return False
        return stream.average >= 1.0 / (_TOO_SELDOM * interval)
