"""Which thresholds would have kept a flight clean: each rule that ended it, flown again later and
further out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.rules import Rule
from chute_ros.tools.judge_log.findings import fired_words
from chute_ros.tools.judge_log.log_flight import JudgedLog, fly
from chute_ros.tools.progress import Progress

#: How much further out a threshold is tried, one after the other.
FACTORS = (1.1, 1.25, 1.5, 2.0, 3.0)


@dataclass(frozen=True)
class Tried:
    """One threshold of the rule that ended a flight. clean: the least value that was tried with
    which nothing ends it; NaN: none of them, and ended says what does with the furthest one."""

    rule: str
    what: str
    shipped: float
    clean: float
    furthest: float
    ended: str

    @property
    def words(self) -> str:
        """What became of it."""
        if math.isnan(self.clean):
            return f"not clean: with {self.furthest:.3g} {self.ended}"
        return f"clean from {self.clean:.3g}"


def sweep(judged: JudgedLog) -> list[Tried]:
    """Each threshold of the rule that ended this flight; empty: none ended it."""
    if not judged.fired:
        return []
    _, first = judged.fired[0]
    rule = next((one for one in judged.config.profile.rules if one.name == first.rule), None)
    if rule is None:
        return []
    found = []
    thresholds = list(_thresholds(rule))
    progress = Progress(f"sweeping {judged.log.path.name}", len(thresholds))
    for number, (what, shipped, change) in enumerate(thresholds):
        progress.at(number)
        clean, ended = math.nan, ""
        for factor in FACTORS:
            config = _with(judged.config, rule, change(factor))
            # To its end: another rule, or the same one, may end it later.
            ended = fired_words(fly(judged.log, config, judged.log.duration, _silent))
            if not ended:
                clean = shipped * factor
                break
        found.append(Tried(rule.name, what, shipped, clean, shipped * FACTORS[-1], ended))
    return found


def _silent(at: float) -> None:
    """One of many flights."""


_Change = Callable[[float], Rule]


def _thresholds(rule: Rule) -> Iterator[tuple[str, float, _Change]]:
    """What it is called, what it is, and the rule with it so many times further out."""
    if rule.hold > 0.0:
        yield "for (s)", rule.hold, lambda factor: replace(rule, hold=rule.hold * factor)
    for number, one in enumerate(rule.conditions):
        if not isinstance(one, MeasurementCondition):
            continue
        for side in ("above", "below"):
            value = getattr(one, side)
            # A limit of the other sign, further out, would be nearer.
            if math.isfinite(value) and (value > 0.0) == (side == "above"):

                def further(factor: float, number: int = number, side: str = side) -> Rule:
                    return _limited(rule, number, side, factor)

                yield f"{one.measurement} {side}", value, further


def _limited(rule: Rule, number: int, side: str, factor: float) -> Rule:
    conditions = list(rule.conditions)
    one = conditions[number]
    assert isinstance(one, MeasurementCondition)
    moved = getattr(one, side) * factor
    above, below = (moved, one.below) if side == "above" else (one.above, moved)
    conditions[number] = replace(one, above=above, below=below)
    return replace(rule, conditions=tuple(conditions))


def _with(config: SupervisorConfig, rule: Rule, changed: Rule) -> SupervisorConfig:
    rules = tuple(changed if one is rule else one for one in config.profile.rules)
    return replace(config, profile=replace(config.profile, rules=rules))
