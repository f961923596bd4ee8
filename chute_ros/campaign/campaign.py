"""Many flights, counted; the same for the same seeds."""

from __future__ import annotations

import contextlib
import functools
import math
import time
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from chute_ros.campaign.draw import draw
from chute_ros.campaign.flight import Flown, fly
from chute_ros.campaign.judge import WRONG, Count, JudgedFlight, judge
from chute_ros.campaign.scenario import Failure, Scenario
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.tapes import TapeFile


@dataclass(frozen=True)
class FlightSummary:
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
    wrong: list[FlightSummary] = field(default_factory=list)
    lines: list[FlightSummary] = field(default_factory=list)
    #: s, of all that flew at the same time.
    took: float = 0.0

    @property
    def a_minute(self) -> float:
        """Flights."""
        return self.flights / self.took * 60.0

    def add(self, line: FlightSummary) -> None:
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
shipped = functools.cache(Shipped)


def drawn(folder: Path, seed: int, tapes: TapeFile | None = None) -> Scenario:
    """The flight of a seed; tapes: some fly one of these."""
    scenario, given = draw(seed), shipped(folder, tapes).tapes
    return scenario if given is None else given.drawn(scenario)


def fly_here(
    folder: Path, scenario: Scenario, tapes: TapeFile | None = None
) -> tuple[Flown, JudgedFlight]:
    """One flight, and what it is counted as."""
    flown = fly(scenario, shipped(folder, tapes))
    return flown, judge(flown)


def fly_bundle(
    folder: Path, seeds: Sequence[int], tapes: TapeFile | None = None
) -> list[FlightSummary]:
    """One flight for each seed, in this process. folder: of the profiles; tapes: bodies that some
    of them fly."""
    return [_line(folder, seed, tapes) for seed in seeds]


def _line(folder: Path, seed: int, tapes: TapeFile | None) -> FlightSummary:
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
        return FlightSummary(*who, Count.BROKEN, why, math.nan, math.nan, *more)
    at = flown.truth.at
    return FlightSummary(
        *who,
        judged.count,
        judged.why,
        flown.released - at,
        flown.truth.height - flown.release_height,
        *more,
    )


def run(
    flown: Generator[FlightSummary, None, None], progress: Callable[[Tally], None], tally: Tally
) -> Tally:
    """Flights in the order of their seeds, added to tally as they come.

    Ended by Ctrl-C it returns those until then: hours of flights are not lost. CampaignError: what
    flies them ended by itself; tally has those until then."""
    begun = time.monotonic() - tally.took
    with contextlib.suppress(KeyboardInterrupt), contextlib.closing(flown):
        for line in flown:
            tally.add(line)
            tally.took = time.monotonic() - begun
            progress(tally)
    return tally
