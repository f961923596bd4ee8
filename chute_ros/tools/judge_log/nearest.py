"""How near the measurements of a flight came to the limits of the rules."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable

from chute_ros.model import Action
from chute_ros.supervisor import readings
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.rules import Rule
from chute_ros.supervisor.state import State


class Nearest:
    """Of each limit of a rule the value that came nearest to it, or went furthest beyond; of each
    rule how often it was blind: what was not known kept it from being fulfilled."""

    def __init__(self) -> None:
        self._looks: Counter[str] = Counter()
        self._blind: Counter[str] = Counter()
        self._values: dict[tuple[str, int], tuple[float, float, float]] = {}

    def look(self, config: SupervisorConfig, state: State, now: float, at: float) -> None:
        """At the vehicle as it is known now (at s of the log)."""
        for rule in config.profile.rules:
            if rule.action < Action.KILL or state.stage not in rule.states:
                continue
            possible = sum(one.weight for one in rule.conditions)
            for number, one in _limits(rule):
                value = readings.reading(config, state, one.measurement, now)[0]
                if not (math.isfinite(value) or one.if_unknown):
                    possible -= one.weight
                beyond = max(_beyond(value - one.above), _beyond(one.below - value))
                if beyond > self._values.get((rule.name, number), (-math.inf, 0.0, 0.0))[0]:
                    self._values[rule.name, number] = (beyond, value, at)
            self._looks[rule.name] += 1
            self._blind[rule.name] += possible < rule.needed

    def blind(self, rule: Rule) -> float:
        """The share (0 to 1) of the time in which it could not have been fulfilled."""
        looks = self._looks[rule.name]
        return self._blind[rule.name] / looks if looks else 0.0

    def words(self, rule: Rule) -> Iterable[str]:
        """Of each limit of this rule."""
        for number, one in _limits(rule):
            found = self._values.get((rule.name, number))
            if found is None:
                yield f"{one.measurement} never known ({one.limits})"
            else:
                yield f"{one.measurement} {found[1]:.1f} at {found[2]:.1f} s ({one.limits})"


def _limits(rule: Rule) -> Iterable[tuple[int, MeasurementCondition]]:
    for number, one in enumerate(rule.conditions):
        if isinstance(one, MeasurementCondition):
            yield number, one


def _beyond(value: float) -> float:
    return value if math.isfinite(value) else -math.inf
