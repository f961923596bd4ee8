"""Classes of compared flights: how many went wrong with each guard, where a peer is better."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from typing import NamedTuple

from chute_ros.campaign.comparison import Compared
from chute_ros.campaign.guards import OURS
from chute_ros.campaign.judge import Count

#: A vehicle that should have been saved and was not.
MISSED = (Count.MISSED, Count.LATE)
#: A median of fewer delays than these says nothing; nor does a difference of less, s: a step.
_FEWEST, _STEP = 5, 0.02
#: So many seeds are named.
_SEEDS = 5


class Better(NamedTuple):
    """The peer's number and ours. delay: medians, s; None: too few flights."""

    missed: tuple[int, int]
    false: tuple[int, int]
    delay: tuple[float, float] | None
    seeds: tuple[int, ...]

    @property
    def earlier(self) -> bool:
        """The peer releases earlier."""
        return self.delay is not None and self.delay[0] < self.delay[1] - _STEP


def by_class(
    lines: Sequence[Compared], key: Callable[[Compared], tuple[str, str]]
) -> list[tuple[tuple[str, str], list[Compared]]]:
    """Return the flights by their class, in the order of the alphabet."""
    classes: dict[tuple[str, str], list[Compared]] = {}
    for one in lines:
        classes.setdefault(key(one), []).append(one)
    return sorted(classes.items())


def missed_and_false(lines: Sequence[Compared], guard: str) -> tuple[int, int]:
    """Return how many this guard missed, or released late, and how many it ended falsely."""
    of = [one.bare for one in lines if one.guard == guard]
    return sum(one in MISSED for one in of), of.count(Count.FALSE)


def paired_delays(lines: Sequence[Compared], guard: str) -> list[tuple[float, float]]:
    """Return the delays of this guard and of ours, s, of the flights in which both released."""
    return [delays for _, delays in _paired(lines, guard)]


def better(lines: Sequence[Compared], guard: str) -> Better | None:
    """Return where this peer is better in these flights; None: nowhere."""
    (missed, false), (ours_missed, ours_false) = (
        missed_and_false(lines, one) for one in (guard, OURS.name)
    )
    pairs, delay = _paired(lines, guard), None
    if len(pairs) >= _FEWEST:
        theirs, ours = zip(*(delays for _, delays in pairs), strict=True)
        delay = (statistics.median(theirs), statistics.median(ours))
    seeds = _saved_by_it_alone(lines, guard)
    if not seeds:
        pairs.sort(key=lambda one: one[1][0] - one[1][1])
        seeds = [seed for seed, (theirs_at, ours_at) in pairs if theirs_at < ours_at - _STEP]
    found = Better((missed, ours_missed), (false, ours_false), delay, tuple(seeds[:_SEEDS]))
    is_better = missed < ours_missed or false < ours_false or found.earlier
    return found if is_better else None


def excused_and_saved(lines: Sequence[Compared], guard: str) -> list[int]:
    """Return the seeds of flights that a peer ends well and that the judge excuses us for."""
    excused = (Count.NO_TIME, Count.NOT_TOLD)
    ours = {one.seed for one in lines if one.guard == OURS.name and one.count in excused}
    return [seed for seed in _saved_by_it_alone(lines, guard) if seed in ours]


def _paired(lines: Sequence[Compared], guard: str) -> list[tuple[int, tuple[float, float]]]:
    ours = {one.seed: one.delay for one in lines if one.guard == OURS.name}
    return [
        (one.seed, (one.delay, ours[one.seed]))
        for one in lines
        if one.guard == guard and not math.isnan(one.delay) and not math.isnan(ours[one.seed])
    ]


def _saved_by_it_alone(lines: Sequence[Compared], guard: str) -> list[int]:
    """Seeds of flights that end well with this peer and not with us."""
    ours = {one.seed: one.bare for one in lines if one.guard == OURS.name}
    wrong = (*MISSED, Count.FALSE)
    return [
        one.seed
        for one in lines
        if one.guard == guard and one.bare is Count.CORRECT and ours[one.seed] in wrong
    ]
