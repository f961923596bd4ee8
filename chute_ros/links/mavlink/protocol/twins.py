"""Two devices that use the same ids: their clocks, time_boot_ms, come by turns.

One clock may run back: the device restarted, and the old clock never comes again. It may seem to:
a message came late, or twice by two ways. Two clocks that both go on, each in step with ours, are
two devices. Which of them said what is told by the clock; what bears none is of nobody known.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import dataclass
from statistics import median

from chute_ros.protocol.boot_clock import REBOOT_JUMP_MS

#: Only so old messages are looked at, s, and so many; and no more often than this, s.
WINDOW, _MOST, _EACH_TIME = 15.0, 1000, 0.5
#: A clock that was not heard for so long, s, is gone: its device restarted or left, and what it
#: said before has arrived.
_GONE = 3.0
#: Messages of one kind may be so much out of order, ms, without a second clock.
_JITTER_MS = 20
#: Both must come so often, and take turns so often.
_EACH, _TURNS = 6, 4
#: A clock is in step with ours if it is never further off, s: lines stall.
_IN_STEP = 1.5
#: Clocks that differ by less, s, are one.
_CLOSEST = 0.1
#: No message is later than this, s. Clocks that differ by less may be one of which a part comes
#: late or twice: then so much of it must come again and again, and not twice.
_LATEST, _SHARE, _COPIES = 5.0, 1.0 / 3.0, 0.25
#: So long after the last sign of it, s, it is over.
OVER_AFTER = 15.0


@dataclass(frozen=True)
class _Sight:
    at: float
    kind: str
    #: Our time less the clock's, s.
    offset: float
    #: It runs behind the newest of its kind.
    behind: bool


class Twins:
    """Follows the clocks behind one pair of ids. All times are monotonic s.

    Clocks that differ by less than the interval of their messages are not told apart."""

    def __init__(self) -> None:
        self._newest: dict[str, tuple[int, float]] = {}
        #: (Kind, boot ms) of the newest messages, oldest first.
        self._seen: dict[tuple[str, int], None] = {}
        self._sights: deque[_Sight] = deque(maxlen=_MOST)
        self._copies: deque[float] = deque(maxlen=_MOST)
        self._found_at = self._judged_at = -math.inf
        #: Offset of the device that is followed, and of the other one.
        self._ours = self._other = math.nan
        self._ours_at = -math.inf

    def found(self, now: float) -> bool:
        """There are two."""
        return now - self._found_at < OVER_AFTER

    def by_turns(self, now: float) -> bool:
        """Two clocks came by turns just now: a restart may only seem to be one. What comes out of
        order is no other clock until a restart could look like it."""
        offsets = [one.offset for one in self._sights if now - one.at <= _GONE]
        least = min(offsets, default=0.0)
        back = [(one - least) * 1000.0 > REBOOT_JUMP_MS for one in offsets]
        return sum(a is not b for a, b in itertools.pairwise(back)) > 1

    def doubt(self, who: str, now: float) -> str:
        """That who, two of them, are there, and what to do about it; empty: they are not."""
        if not self.found(now):
            return ""
        apart = abs(self._ours - self._other)
        return (
            f"{who} (their clocks are {apart:.1f} s apart): give each vehicle a system id of its "
            "own (MAV_SYS_ID on PX4, MAV_SYSID or SYSID_THISMAV on ArduPilot), and each device of "
            "a vehicle its own component id, or keep the other one off this network"
        )

    def ours(self, boot_ms: int, now: float) -> bool:
        """A message with this time is of the one that is followed, as far as can be told."""
        if not self.found(now):
            return True
        offset = now - boot_ms / 1000.0
        return boot_ms > 0 and abs(offset - self._ours) <= abs(offset - self._other)

    def observe(self, kind: str, boot_ms: int, now: float) -> bool:
        """A message of this kind (its name) and time came: ours (see there) of it. True as well
        when it is found out just now that there are two."""
        if boot_ms == 0:
            return self.ours(boot_ms, now)
        if (kind, boot_ms) in self._seen:
            self._copies.append(now)
            return self.ours(boot_ms, now)
        self._seen[kind, boot_ms] = None
        if len(self._seen) > _MOST:
            del self._seen[next(iter(self._seen))]
        newest, newest_at = self._newest.get(kind, (boot_ms, now))
        behind = boot_ms < newest - _JITTER_MS
        if not behind or now - newest_at > _GONE:
            self._newest[kind] = max(newest, boot_ms) if not behind else boot_ms, now
        self._sights.append(_Sight(now, kind, now - boot_ms / 1000.0, behind))
        if behind and now - self._judged_at >= _EACH_TIME:
            self._judged_at = now
            self._judge(now)
        ours = self.ours(boot_ms, now)
        if ours and (abs(self._sights[-1].offset - self._ours) <= _IN_STEP or self._lost(now)):
            self._ours, self._ours_at = self._sights[-1].offset, now
        return ours

    def _lost(self, now: float) -> bool:
        """The one that is followed was not heard for a while, or nobody was followed yet."""
        return now - self._ours_at > _GONE

    def _judge(self, now: float) -> None:
        sights = [one for one in self._sights if now - one.at <= WINDOW]
        # What only one of them sends is never behind, whichever of them it is.
        both = {one.kind for one in sights if one.behind}
        sights = [one for one in sights if one.kind in both]
        # Before the second clock was heard the first one was ahead, whichever of them it is.
        known = list(itertools.dropwhile(lambda one: not one.behind, sights))
        ahead = [one.offset for one in known if not one.behind]
        behind = [one.offset for one in known if one.behind]
        if min(len(ahead), len(behind)) < _EACH:
            return
        pair = median(ahead), median(behind)
        is_first = [abs(one.offset - pair[0]) < abs(one.offset - pair[1]) for one in sights]
        first = list(itertools.compress(sights, is_first))
        second = list(itertools.compress(sights, (not one for one in is_first)))
        if min(len(first), len(second)) < _EACH:
            return
        newer, older = (first, second) if pair[0] < pair[1] else (second, first)
        # Two send at the same time: what the older one says is behind. Where a way was slow for a
        # while, hardly any of it is.
        if sum(one.behind for one in older) < len(older) / 2:
            return
        # A clock that a restart has ended came before the other one, and comes no more.
        together = min(first[-1].at, second[-1].at) - max(first[0].at, second[0].at)
        turns = sum(a is not b for a, b in itertools.pairwise(is_first))
        if together < _GONE or turns < _TURNS:
            return
        apart, spreads = abs(pair[0] - pair[1]), (_spread(first), _spread(second))
        # What comes late of one clock is anywhere in between; two are where they are.
        if max(spreads) > _IN_STEP or apart < max(_CLOSEST, sum(spreads)):
            return
        if apart < _LATEST:
            copies = sum(now - at <= WINDOW for at in self._copies)
            if len(older) < _SHARE * len(newer) or copies > _COPIES * len(older):
                return
        self._found_at = now
        self._ours, self._other = sorted(pair, key=lambda one: abs(one - self._ours))


def _spread(sights: list[_Sight]) -> float:
    """Of the offsets of all but the outermost tenths, s."""
    cut = max(1, len(sights) // 10)
    kept = sorted(one.offset for one in sights)[cut:-cut]
    return kept[-1] - kept[0]
