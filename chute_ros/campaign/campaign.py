"""Many flights on all cores, counted; the same for the same seed."""

from __future__ import annotations

import functools
import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from chute_ros.campaign.flight import Flight, Flown, load_profiles
from chute_ros.campaign.judge import WRONG, Count, Judged, judge
from chute_ros.campaign.scenario import draw

#: Flights that one process flies before it tells of them.
_BATCH = 20


@dataclass(frozen=True)
class Line:
    """One flight in a few numbers. NaN: it was not."""

    seed: int
    profile: str
    failure: str
    count: Count
    why: str
    #: From the failure to the kill and to the release, s, and the height lost meanwhile, m.
    kill_delay: float
    release_delay: float
    height_lost: float


@dataclass
class Tally:
    """All flights so far."""

    flights: int = 0
    counts: Counter[Count] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    wrong: list[Line] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    took: float = 0.0

    def add(self, line: Line) -> None:
        """One more."""
        self.flights += 1
        self.counts[line.count] += 1
        if line.count is Count.NOT_TOLD:
            self.reasons[line.why] += 1
        if line.count in WRONG:
            self.wrong.append(line)
        if line.release_delay == line.release_delay:
            self.lines.append(line)


#: Of this process; each reads them once.
_read = functools.cache(load_profiles)


def fly_here(folder: Path, seed: int) -> tuple[Flight, Flown, Judged]:
    """One flight, with all that lived in it."""
    scenario = draw(seed)
    flight = Flight(scenario, _read(folder)[scenario.profile])
    flown = flight.run()
    return flight, flown, judge(flown)


def _line(folder: Path, seed: int) -> Line:
    _, flown, judged = fly_here(folder, seed)
    at = flown.truth.at
    return Line(
        seed,
        flown.scenario.profile,
        flown.scenario.failure.value,
        judged.count,
        judged.why,
        flown.killed - at,
        flown.released - at,
        flown.truth.height - flown.release_height,
    )


def run(
    folder: Path, flights: int, seed: int, jobs: int, progress: Callable[[Tally], None]
) -> Tally:
    """Flights with the seeds from seed on. folder: of the profiles."""
    tally, begun = Tally(), time.monotonic()
    for line in _all(folder, range(seed, seed + flights), jobs):
        tally.add(line)
        tally.took = time.monotonic() - begun
        progress(tally)
    return tally


def _all(folder: Path, seeds: range, jobs: int) -> Iterator[Line]:
    one = functools.partial(_line, folder)
    if jobs == 1:
        yield from map(one, seeds)
        return
    with multiprocessing.Pool(jobs) as pool:
        yield from pool.imap_unordered(one, seeds, _BATCH)
