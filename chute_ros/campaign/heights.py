"""The flights of a described vehicle, counted: the height that each failure needs, and how long it
takes from the failure to the canopy."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from chute_ros.campaign.cases import Case, cases, flight_of
from chute_ros.campaign.confidence import CONFIDENCE, share_at_least, upper_bound
from chute_ros.campaign.described import DescribedVehicle, OwnShipped
from chute_ros.campaign.needed_height import Fall, Needed, ObservedFlight, needed_height
from chute_ros.campaign.pool import flown_here

#: Of all failures of a kind: the share that the height is asked for.
WANTED = 0.99

#: Of this process; each reads them once.
own_shipped = functools.cache(OwnShipped)


@dataclass(frozen=True)
class Campaign:
    """What is flown: so many seeds of each failure; faults: at most so many more things go wrong.

    folder: of the shipped profiles."""

    vehicle: DescribedVehicle
    folder: Path
    seed: int
    flights: int
    faults: int = 0

    @property
    def cases(self) -> list[Case]:
        """All without faults; then, if any are wanted, all with them."""
        more = cases(self.vehicle, self.faults) if self.faults else []
        return [*cases(self.vehicle), *more]

    @property
    def number(self) -> int:
        """Of all seeds that are flown."""
        return len(self.cases) * self.flights


@dataclass(frozen=True)
class CaseFlights:
    """All flights of a case, in the order of their seeds."""

    case: Case
    every: tuple[Needed, ...]

    @property
    def needed(self) -> list[float]:
        """Heights, m, of those whose failure happened: rising."""
        return sorted(one.height for one in self.every if one.counts)

    @property
    def share(self) -> float:
        """Of all such failures: WANTED, or what so few flights can bound."""
        number = len(self.needed)
        return min(WANTED, (1.0 - CONFIDENCE) ** (1.0 / number)) if number else 0.0

    @property
    def bound(self) -> float:
        """The height, m, that is enough for this share; infinity: no height is."""
        # What one flight less or more can bound is no question of the last bit.
        value = upper_bound(self.needed, self.share - 1e-12)
        return math.nan if value is None else value

    @property
    def usual_saved(self) -> tuple[int, float]:
        """How many were saved at a height that the vehicle is flown at; the least share of all."""
        saved = sum(one.usual_saved for one in self.every if one.counts)
        return saved, share_at_least(saved, len(self.needed)) if self.needed else 0.0

    @property
    def carried(self) -> list[Fall]:
        """From a height that it is flown at: those whose canopy carried."""
        falls = [one.usual for one in self.every if one.counts]
        return [one for one in falls if not math.isnan(one.carried.after)]

    @property
    def lowest(self) -> list[Fall]:
        """Each from the least height from which it was saved."""
        return [one.lowest for one in self.every if one.counts and one.lowest is not None]


def find(campaign: Campaign, jobs: int, at: Callable[[int], None]) -> list[CaseFlights]:
    """Fly all, in so many processes. at: told how many seeds have been flown. CampaignError: a
    process ended by itself, or a flight never took off."""
    shared = own_shipped(campaign.folder, campaign.vehicle.profile)
    flown = flown_here(partial(fly, campaign), shared, range(campaign.number), jobs)
    with closing(flown):
        return [
            CaseFlights(one, _taken(flown, campaign, at, n))
            for n, one in enumerate(campaign.cases)
        ]


def _taken(
    flown: Generator[Needed, None, None],
    campaign: Campaign,
    at: Callable[[int], None],
    before: int,
) -> tuple[Needed, ...]:
    every = []
    for number in range(campaign.flights):
        every.append(next(flown))
        at(before * campaign.flights + number + 1)
    return tuple(every)


def fly(campaign: Campaign, numbers: Sequence[int]) -> list[Needed]:
    """numbers: of seeds of all cases, one case after the other."""
    every = campaign.cases
    return [_needed(campaign, every[n // campaign.flights], n % campaign.flights) for n in numbers]


def _needed(campaign: Campaign, case: Case, number: int) -> Needed:
    vehicle, seed = campaign.vehicle, campaign.seed + number
    shipped = own_shipped(campaign.folder, vehicle.profile)

    def fly_from(height: float) -> Fall:
        scenario = flight_of(vehicle, case, seed, height)
        return ObservedFlight(scenario, shipped, vehicle.soft_landing).fall()

    return needed_height(fly_from, vehicle.soft_landing, seed)
