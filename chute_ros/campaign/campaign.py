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

from chute_ros.campaign.draw import draw
from chute_ros.campaign.flight import Flown, fly
from chute_ros.campaign.judge import WRONG, Count, Judged, judge
from chute_ros.campaign.scenario import Failure, Scenario
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.tapes import TapeFile

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
    #: Whose physics flew it, and what failed on its tape; empty: the small model.
    body: str = ""


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
    #: Of flights on tapes: (body and its failure, other faults were drawn, count) -> flights.
    by_body: Counter[tuple[str, bool, Count]] = field(default_factory=Counter)
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
        if line.body:
            self.by_body[line.body, bool(line.faults), line.count] += 1
        if line.count is Count.NOT_TOLD:
            self.reasons[line.why] += 1
        if line.count in WRONG:
            self.wrong.append(line)
        if not math.isnan(line.release_delay):
            self.lines.append(line)


#: Of this process; each reads them once.
_shipped = functools.cache(Shipped)


def drawn(folder: Path, seed: int, tapes: TapeFile | None = None) -> Scenario:
    """The flight of a seed; tapes: some fly one of these."""
    scenario, given = draw(seed), _shipped(folder, tapes).tapes
    return scenario if given is None else given.drawn(scenario)


def fly_here(
    folder: Path, scenario: Scenario, tapes: TapeFile | None = None
) -> tuple[Flown, Judged]:
    """One flight, and what it is counted as."""
    flown = fly(scenario, _shipped(folder, tapes))
    return flown, judge(flown)


def _line(folder: Path, seed: int, tapes: TapeFile | None) -> Line:
    scenario = drawn(folder, seed, tapes)
    faults = tuple(type(one).__name__ for one in scenario.faults)
    taped = scenario.tape
    failure = f"{taped.failed} ({taped.name})" if taped else scenario.failure.value
    who = (seed, scenario.vehicle, scenario.profile, failure)
    body = f"{taped.body}: {taped.failed}" if taped else ""
    more = (faults, ", ".join(sorted(scenario.second_sources)), body)
    try:
        flown, judged = fly_here(folder, scenario, tapes)
    except Exception as error:  # noqa: BLE001 - whatever it is, it must not have happened
        why = f"{type(error).__name__}: {error}"
        return Line(*who, Count.BROKEN, why, math.nan, math.nan, *more)
    at = flown.truth.at
    return Line(
        *who,
        judged.count,
        judged.why,
        flown.released - at,
        flown.truth.height - flown.release_height,
        *more,
    )


def run(
    folder: Path,
    seeds: Sequence[int],
    jobs: int,
    progress: Callable[[Tally], None],
    tally: Tally,
    tapes: TapeFile | None = None,
) -> Tally:
    """Flights with these seeds, in their order, added to tally, which has the first of them
    already. folder: of the profiles; tapes: bodies that some of them fly.

    Ended by Ctrl-C it returns those until then: hours of flights are not lost. BrokenProcessPool:
    one of its processes ended by itself; tally has those until then."""
    begun = time.monotonic() - tally.took
    try:
        for line in _all(folder, seeds[tally.flights :], jobs, tapes):
            tally.add(line)
            tally.took = time.monotonic() - begun
            progress(tally)
    except KeyboardInterrupt:
        pass
    return tally


def _batch(folder: Path, seeds: Sequence[int], tapes: TapeFile | None) -> list[Line]:
    return [_line(folder, seed, tapes) for seed in seeds]


def _all(folder: Path, seeds: Sequence[int], jobs: int, tapes: TapeFile | None) -> Iterator[Line]:
    if jobs == 1:
        yield from (_line(folder, seed, tapes) for seed in seeds)
        return
    # Read before the processes part, so that they share it.
    shipped = _shipped(folder, tapes)
    shipped.read_all()
    # No collection of garbage looks through it again (4 % of a flight); PyPy's works otherwise.
    if hasattr(gc, "freeze"):
        gc.freeze()
    # Ctrl-C reaches every process of a terminal: ours ends them.
    ignores = (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(jobs, get_context("fork"), signal.signal, ignores)
    ordered: deque[Future[list[Line]]] = deque()
    try:
        for first in range(0, len(seeds), _BATCH):
            ordered.append(pool.submit(_batch, folder, seeds[first : first + _BATCH], tapes))
            if len(ordered) > _AHEAD * jobs:
                yield from ordered.popleft().result()
        for batch in ordered:
            yield from batch.result()
    finally:
        # Nobody waits for what they fly now.
        for process in active_children():
            process.kill()
        # Not left to the end of Python, which then may wake a thread that has just ended (EBADF).
        pool.shutdown(cancel_futures=True)
