"""The flights of each kind, the rare ones as well as the common: by chance alone, one of a hundred
thousand flights has a hung autopilot beside a second source that lies in this way and a cable that
flaps, and most of the others are like each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable
from typing import NamedTuple

from chute_ros.campaign.scenario import Scenario, draw
from chute_ros.campaign.sensors import SensorFault


class OfEach(NamedTuple):
    """Of so many seeds so many flights of each kind."""

    seeds: int
    each: int


def kinds(scenario: Scenario) -> tuple[Hashable, Hashable]:
    """Of which two kinds it is: by what goes wrong besides the failure and who acts, and by which
    sensors are wrong, and how."""
    lies = [one for one in scenario.faults if isinstance(one, SensorFault)]
    others = {type(one) for one in scenario.faults if not isinstance(one, SensorFault)}
    what = (scenario.vehicle, scenario.profile, scenario.failure, scenario.second_sources)
    person = scenario.person.does if scenario.person else ""
    around = (*what, frozenset(one.source != "" for one in lies), frozenset(others), person)
    told = sorted((one.source, one.sensor, one.how) for one in lies)
    return around, (*what, tuple(told))


def rare(seeds: Iterable[int], each: int) -> list[int]:
    """Of the seeds, in their order, those whose flight is one of the first so many of a kind of
    its."""
    flown: Counter[Hashable] = Counter()
    chosen = []
    for seed in seeds:
        both = kinds(draw(seed))
        if any(flown[kind] < each for kind in both):
            chosen.append(seed)
            flown.update(both)
    return chosen
