"""The flights of each kind, the rare ones as well as the common: by chance alone, one of a hundred
thousand flights has a hung autopilot beside a second source that lies in this way and a cable that
flaps, and most of the others are like each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable
from typing import NamedTuple

from chute_ros.campaign.draw import draw
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.scenario import Scenario
from chute_ros.campaign.sensors import SensorFault


class OfEach(NamedTuple):
    """Of so many seeds so many flights of each kind."""

    seeds: int
    each: int


def kinds(scenario: Scenario) -> tuple[Hashable, ...]:
    """Of which three kinds it is: by what goes wrong besides the failure and who acts; by which
    sensors are wrong, and how; and by the world in which it is flown."""
    wrong = (SensorFault, EstimatorFault)
    lies = [one for one in scenario.faults if isinstance(one, wrong)]
    others = {type(one) for one in scenario.faults if not isinstance(one, wrong)}
    what = (scenario.vehicle, scenario.profile, scenario.failure, scenario.second_sources)
    person = scenario.person.does if scenario.person else ""
    around = (*what, frozenset(one.source != "" for one in lies), frozenset(others), person)
    told = sorted((one.source, one.sensor, one.how) for one in lies)
    return around, (*what, tuple(told)), _world(scenario)


def _world(scenario: Scenario) -> Hashable:
    flown, way, autopilot = scenario.manoeuvre, scenario.descent, scenario.autopilot
    return (
        *(scenario.profile, scenario.failure, scenario.canopy.carries),
        *(flown.kind if flown is not None else "", way.name if way is not None else ""),
        *(scenario.ground > 0.0, scenario.ground < 0.0, autopilot.homing, autopilot.kind),
    )


def rare(seeds: Iterable[int], each: int) -> list[int]:
    """Of the seeds, in their order, those whose flight is one of the first so many of a kind of
    its."""
    flown: Counter[Hashable] = Counter()
    chosen = []
    for seed in seeds:
        all_three = kinds(draw(seed))
        if any(flown[kind] < each for kind in all_three):
            chosen.append(seed)
            flown.update(all_three)
    return chosen
