"""Many flights on all cores, counted; the same for the same seed."""

from __future__ import annotations

import functools
import gc
import math
import signal
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import TypeVar

from chute_ros.campaign.draw import draw
from chute_ros.campaign.flight import Flown, fly
from chute_ros.campaign.judge import WRONG, Count, Judged, judge
from chute_ros.campaign.scenario import Failure, Scenario
from chute_ros.campaign.shipped import Shipped

LineT = TypeVar("LineT")

#: Flights that one process flies before it tells of them.
_BATCH = 10
#: Batches for each process that are given out before the oldest is told of.
_AHEAD = 4


@dataclass(frozen=True)
class Line:
    """One flight in a few numbers. NaN: it was not."""

    seed: int
    vehicle: str
    profile: str
    failure: str
    count: Count
    why: str
    #: From the failure to the release, s, and the height lost meanwhile, m.
    release_delay: float
    height_lost: float
    #: Faults that were drawn, by kind.
    faults: tuple[str, ...] = ()
    #: Who tells of an aircraft besides its autopilot; empty: nobody.
    second: str = ""


@dataclass
class Tally:
    """All flights so far."""

    flights: int = 0
    counts: Counter[Count] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    #: (vehicle, profile, count) -> flights.
    by_vehicle: Counter[tuple[str, str, Count]] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    #: Of aircraft whose autopilot lost its power: (who tells besides it, count) -> flights.
    powerless: Counter[tuple[str, Count]] = field(default_factory=Counter)
    wrong: list[Line] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    #: s, of all that flew at the same time.
    took: float = 0.0

    @property
    def a_minute(self) -> float:
        """Flights."""
        return self.flights / self.took * 60.0

    def add(self, line: Line) -> None:
        """One more."""
        self.flights += 1
        self.counts[line.count] += 1
        self.by_vehicle[line.vehicle, line.profile, line.count] += 1
        self.faults.update(line.faults)
        if line.failure == Failure.POWER.value:
            self.powerless[line.second, line.count] += 1
        if line.count is Count.NOT_TOLD:
            self.reasons[line.why] += 1
        if line.count in WRONG:
            self.wrong.append(line)
        if not math.isnan(line.release_delay):
            self.lines.append(line)


#: Of this process; each reads them once.
_shipped = functools.cache(Shipped)


def fly_here(folder: Path, scenario: Scenario) -> tuple[Flown, Judged]:
    """One flight, and what it is counted as."""
    flown = fly(scenario, _shipped(folder))
    return flown, judge(flown)


def _line(folder: Path, seed: int) -> Line:
    scenario = draw(seed)
    faults = tuple(type(one).__name__ for one in scenario.faults)
    who = (seed, scenario.vehicle, scenario.profile, scenario.failure.value)
    drawn = (faults, ", ".join(sorted(scenario.second_sources)))
    try:
        flown, judged = fly_here(folder, scenario)
    except Exception as error:  # noqa: BLE001 - whatever it is, it must not have happened
        why = f"{type(error).__name__}: {error}"
        return Line(*who, Count.BROKEN, why, math.nan, math.nan, *drawn)
    at = flown.truth.at
    return Line(
        *who,
        judged.count,
        judged.why,
        flown.released - at,
        flown.truth.height - flown.release_height,
        *drawn,
    )


def run(
    folder: Path,
    seeds: Sequence[int],
    jobs: int,
    progress: Callable[[Tally], None],
    tally: Tally,
) -> Tally:
    """Flights with these seeds, in their order, added to tally, which has the first of them
    already. folder: of the profiles.

    Ended by Ctrl-C it returns those until then: hours of flights are not lost. BrokenProcessPool:
    one of its processes ended by itself; tally has those until then."""
    begun = time.monotonic() - tally.took
    try:
        for line in flown_by(_batch, folder, seeds[tally.flights :], jobs):
            tally.add(line)
            tally.took = time.monotonic() - begun
            progress(tally)
    except KeyboardInterrupt:
        pass
    return tally


def _batch(folder: Path, seeds: Sequence[int]) -> list[Line]:
    return [_line(folder, seed) for seed in seeds]


def flown_by(
    batch: Callable[[Path, Sequence[int]], list[LineT]],
    folder: Path,
    seeds: Sequence[int],
    jobs: int,
) -> Iterator[LineT]:
    """What batch returns of the flights with these seeds, in their order, from so many processes.
    folder: of the profiles. BrokenProcessPool: one of them ended by itself."""
    if jobs == 1:
        for seed in seeds:
            yield from batch(folder, [seed])
        return
    # Read before the processes part, so that they share it.
    shipped = _shipped(folder)
    shipped.read_all()
    # No collection of garbage looks through it again (4 % of a flight); PyPy's works otherwise.
    if hasattr(gc, "freeze"):
        gc.freeze()
    # Ctrl-C reaches every process of a terminal: ours ends them.
    ignores = (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(jobs, get_context("fork"), signal.signal, ignores)
    ordered: deque[Future[list[LineT]]] = deque()
    try:
        for first in range(0, len(seeds), _BATCH):
            ordered.append(pool.submit(batch, folder, seeds[first : first + _BATCH]))
            if len(ordered) > _AHEAD * jobs:
                yield from ordered.popleft().result()
        for future in ordered:
            yield from future.result()
    finally:
        # Nobody waits for what they fly now.
        for process in active_children():
            process.kill()
        # Not left to the end of Python, which then may wake a thread that has just ended (EBADF).
        pool.shutdown(cancel_futures=True)
