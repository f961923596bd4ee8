"""The same flights with each guard, judged by the same judge."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from chute_ros.campaign.draw import draw
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.flight import Flown, fly
from chute_ros.campaign.guards import GUARDS, Guard, ScaledShipped
from chute_ros.campaign.judge import Count, judge
from chute_ros.campaign.scenario import Canopy, HomeMove, Scenario
from chute_ros.campaign.sensors import SensorFault
from chute_ros.campaign.shipped import Shipped

#: By what the limits of every guard are scaled for the curve, and of how many flights one is flown
#: so: each of these takes as long as all peers together.
FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)
CURVE_OF = 8


@dataclass(frozen=True)
class Compared:
    """One flight with one guard. NaN: it was not."""

    seed: int
    guard: str
    factor: float
    profile: str
    failure: str
    #: The gravest kind of its faults.
    fault: str
    #: What is flown on purpose; empty: it hovers.
    manoeuvre: str
    #: As the campaign counts it, and without any excuse.
    count: Count
    bare: Count
    why: str
    #: Only a parachute could land it softly, and the guard had not ended its flight before.
    needed: bool
    #: Of those, from that moment to the release, s, and the height lost meanwhile, m.
    delay: float = math.nan
    lost: float = math.nan


def comparable(scenario: Scenario) -> Scenario | None:
    """Return the flight without what only this product or its parachutes have; None: a rocket,
    which no peer flies."""
    if scenario.is_rocket:
        return None
    return replace(scenario, person=None, arms=False, aps=False, canopy=Canopy())


def bare_count(flown: Flown) -> Count:
    """Return what the flight is where neither faults nor haste excuse anything; NO_TIME: no
    release, however early, would have helped."""
    no_faults = replace(flown.scenario, faults=())
    count = judge(replace(flown, scenario=no_faults, refused=math.nan)).count
    if count not in (Count.NO_TIME, Count.NOT_TOLD) or not flown.truth.leeway >= 0.0:
        return count
    return Count.MISSED if math.isnan(flown.released) else Count.LATE


def fault_of(scenario: Scenario) -> str:
    """Return the kind of its faults, of more than one that which is the hardest to see."""
    faults = scenario.faults
    if any(isinstance(one, EstimatorFault) for one in faults):
        return "estimator"
    if any(isinstance(one, SensorFault) and not one.source for one in faults):
        return "sensor"
    if any(not isinstance(one, (HomeMove, SensorFault)) for one in faults):
        return "ways and processes"
    if any(isinstance(one, HomeMove) for one in faults):
        return "home"
    return "second source" if faults else "none"


def compare(folder: Path, seeds: Sequence[int]) -> list[list[Compared]]:
    """Fly the flight of each seed with each guard; an empty list: it is a rocket's. folder: of the
    profiles."""
    return [_with_each(folder, seed) for seed in seeds]


def _with_each(folder: Path, seed: int) -> list[Compared]:
    scenario = comparable(draw(seed))
    if scenario is None:
        return []
    factors = FACTORS if seed % CURVE_OF == 0 else (1.0,)
    return [_one(folder, scenario, guard, k) for guard in GUARDS for k in factors]


@functools.cache
def shipped(folder: Path, factor: float) -> Shipped:
    """The shipped settings, with this product's hold times scaled; read once in each process."""
    return Shipped(folder) if factor == 1.0 else ScaledShipped(folder, factor)


def _one(folder: Path, scenario: Scenario, guard: Guard, factor: float) -> Compared:
    flight = (
        *(scenario.seed, guard.name, factor, scenario.profile, scenario.failure.value),
        *(fault_of(scenario), scenario.manoeuvre.kind if scenario.manoeuvre else ""),
    )
    try:
        peer = None if guard.peer is None else guard.peer(scenario.profile, factor)
        flown = fly(scenario, shipped(folder, factor if peer is None else 1.0), peer)
    except Exception as error:  # noqa: BLE001 - whatever it is, it must not have happened
        why = f"{type(error).__name__}: {error}"
        return Compared(*flight, Count.BROKEN, Count.BROKEN, why, False)
    judged, bare, truth = judge(flown), bare_count(flown), flown.truth
    # Where a guard ended a flight that went well, what follows is no need.
    helps = truth.falls and truth.leeway >= 0.0 and not truth.lands_softly
    needed = helps and bare is not Count.FALSE
    told = (*flight, judged.count, bare, judged.why, needed)
    if not needed or not flown.released >= truth.at:
        return Compared(*told)
    return Compared(*told, flown.released - truth.at, truth.height - flown.release_height)
