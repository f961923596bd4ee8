"""The stamps of a log, in the order of its file, as times that go on: neither a damaged stamp nor
a clock that was set moves the rest of a flight."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import TypeVar

T = TypeVar("T")

#: So many of the stamps that follow tell whether one was damaged or the clock was set.
_NEXT = 3
#: Writers that share a log do not keep its order by less than this, s.
_UNORDERED = 0.5
#: A stamp that nothing follows, or that nothing is before, is at most so far from the others, s.
_AT_THE_ENDS = 10.0
#: A message may be so long on its way, s: its stamp is that of whom it reached.
_BUFFERED = 10.0
#: The longest silence of a log that is lived through, s.
LONGEST_SILENCE = 600.0


def steady(
    stamped: Iterable[tuple[float, T]],
    remarks: list[str],
    longest_silence: float = LONGEST_SILENCE,
    boot_time: Iterable[float] = (),
) -> Iterator[tuple[float, T]]:
    """The same with times (s) that never go back.

    A stamp that the next few do not follow is damaged, and takes the time before it. A jump that
    they follow is a clock that was set, if it goes back, or further ahead than longest_silence
    (s): what follows is shifted, as if no time had passed. boot_time: of each, by a clock that
    nobody sets (s; NaN: none): what the stamps jump further ahead, by more than 10 s, is a clock
    that was set as well.
    remarks: gets what a reader must be told of it, once all was taken.
    """
    source = zip(stamped, _or_none(boot_time), strict=False)
    ahead = deque(islice(source, _NEXT + 1))
    # What may rest for as long as it likes does so before its last stamp as well.
    at_the_end = _AT_THE_ENDS if math.isfinite(longest_silence) else math.inf
    damaged = 0
    #: (s from the begin, by how much).
    jumps: list[tuple[float, float]] = []
    begin = raw_base = base = newest = newest_boot = math.nan
    while ahead:
        (raw, item), boot = ahead.popleft()
        following = [(stamp, when) for (stamp, _), when in ahead]
        ahead.extend(islice(source, 1))
        if math.isnan(base):
            if not math.isfinite(raw):
                damaged += 1
                continue
            stamps = [stamp for stamp, _ in following]
            # What was known before the log began may come first.
            raw = stamps[0] if _stands_alone(raw, stamps) else raw
            begin = raw_base = base = newest = raw
        at = base + (raw - raw_base)
        jump = at - newest
        if not -_UNORDERED <= jump <= _UNORDERED:
            last = not following and 0.0 < jump <= at_the_end
            if not (last or _followed(raw, jump, [stamp for stamp, _ in following])):
                damaged += 1
                yield newest, item
                continue
            passed = _passed(newest_boot, [boot, *(when for _, when in following)])
            if jump < 0.0 or jump > longest_silence or jump - passed > _BUFFERED:
                jumps.append((newest - begin, jump))
                raw_base = raw
                base = newest + (passed if 0.0 <= passed <= longest_silence else 0.0)
                at = base
        newest = max(newest, at)
        newest_boot = boot if math.isfinite(boot) else newest_boot
        yield newest, item
    if damaged:
        remarks.append(f"damaged times ({damaged}): each counts as the time before it")
    if jumps:
        moment, jump = jumps[0]
        more = f" (and {len(jumps) - 1} times later)" if jumps[1:] else ""
        remarks.append(
            f"its times jump by {jump:.4g} s, {moment:.0f} s after its begin{more}: "
            "what follows is judged as if no time had passed"
        )


def _followed(raw: float, jump: float, following: list[float]) -> bool:
    """Whether most of the next stamps go on from this one, and not from those before it."""
    if not math.isfinite(raw):
        return False
    # Behind a jump ahead everything that does not go back is later.
    until = math.inf if jump > 0.0 else -jump - _UNORDERED
    on = sum(-_UNORDERED <= one - raw < until for one in following)
    return 2 * on > len(following)


def _stands_alone(first: float, following: list[float]) -> bool:
    """The first stamp is none of this log."""
    if len(following) < 2 or not abs(following[1] - following[0]) <= _UNORDERED:
        return False
    return abs(following[0] - first) > _AT_THE_ENDS


def _passed(before: float, boots: list[float]) -> float:
    """s by the clock that nobody sets; NaN: not known, or it began again."""
    after = next((one for one in boots if math.isfinite(one)), math.nan)
    return after - before if after >= before else math.nan


def _or_none(boot_time: Iterable[float]) -> Iterator[float]:
    yield from boot_time
    while True:
        yield math.nan
