"""What a profile may not ask for: a limit that no measurement reaches, or that each is beyond."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from chute_ros.model import FIRES
from chute_ros.supervisor.conditions.base import Condition
from chute_ros.supervisor.conditions.measurement import (
    ALWAYS,
    NEVER,
    MeasurementCondition,
    range_of,
)
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    CLIMB_RATE,
    FELT_DROP,
    FELT_FALL,
    FORCE_ERROR,
    HEIGHT,
    SPEED_ERROR,
    STANDARD_LIMITS,
    TILT,
    VERTICAL_ACCELERATION,
    VERTICAL_SPEED,
    Limits,
)
from chute_ros.supervisor.rules import Rule

#: No vehicle has a height below which nothing is released, or that is low, of more than this, m.
HIGHEST_MINIMUM = 1000.0
#: No vehicle stands that moves faster, m/s.
FASTEST_STANDING = 20.0
#: What ends a flight waits no longer than this, s; an alarm and a flight block may.
LONGEST_HOLD, LONGEST_WARNING = 60.0, 600.0
#: A counter that leaks less keeps what was counted for the whole flight: s each s.
LEAST_LEAK = 0.01
#: Samples: 50 of them come in 10 s at the 5 Hz that are needed.
MOST_SAMPLES = 50
#: A measurement's limits may be so many times as far as the standard ones. A rocket's speed may
#: jump by twelve times as much.
WIDEST = 20.0
#: An older measurement tells nothing of a vehicle that falls, s; and most that come are older than
#: this as they are looked at.
YOUNGEST, OLDEST = 0.1, 10.0
#: Longer is as good as for ever, which is 0, s.
LONGEST_STUCK = 600.0
_ROUNDING = 1e-9
#: What is measured of a vehicle that hovers upright, or stands on a roof.
_HOVERS = {
    HEIGHT: 30.0,
    VERTICAL_SPEED: 0.0,
    CLIMB_RATE: 0.0,
    VERTICAL_ACCELERATION: 0.0,
    FELT_DROP: 0.0,
    FELT_FALL: 0.0,
    SPEED_ERROR: 0.0,
    FORCE_ERROR: 0.0,
    TILT: 3.0,
    "attitude_error": 0.0,
    "sink_beyond_target": 0.0,
    ACCELERATION: 9.81,
}


def bounds(name: str, key: str) -> tuple[float, float]:
    """The lowest and the highest that a profile may set this of a measurement's limits to."""
    standard = STANDARD_LIMITS[name]
    if key in ("minimum", "maximum"):
        far = WIDEST * max(abs(standard.minimum), abs(standard.maximum))
        return -far, far
    if key == "max_age":
        return YOUNGEST, OLDEST
    if key == "stuck_after":
        return 0.0, LONGEST_STUCK
    usual = float(getattr(standard, key))
    return usual / WIDEST, WIDEST * usual


def rule_problem(rule: Rule, limits: Mapping[str, Limits]) -> str:
    """Why its conditions together make no sense, in words; empty: they do."""
    least = most = 0.0
    for known, unknown in _sums(rule.conditions, limits):
        least, most = least + min(known), most + max(*known, unknown)
    needed = rule.needed - _ROUNDING
    if most < needed:
        return f"{NEVER}: {most:g} at most of needed {rule.needed:g} can be true at once"
    if least >= needed:
        return f"{ALWAYS}: its limits leave no value out"
    measured = [
        (one, _HOVERS[one.measurement])
        for one in rule.conditions
        if isinstance(one, MeasurementCondition) and one.measurement in _HOVERS
    ]
    hovers = sum(one.weight for one, value in measured if one.holds_at(value))
    if rule.action in FIRES and hovers >= needed:
        told = ", ".join(f"{one.measurement} {value:g}" for one, value in measured)
        return f"ends a flight in which nothing is wrong: it holds in a hover ({told})"
    return ""


def _sums(
    conditions: Sequence[Condition], limits: Mapping[str, Limits]
) -> Iterator[tuple[list[float], float]]:
    """For each measurement, and each condition on something else: what the weights of those that
    are true add up to, for every value that makes a difference, and where it is not known."""
    of: dict[str, list[MeasurementCondition]] = {}
    for one in conditions:
        if isinstance(one, MeasurementCondition):
            of.setdefault(one.measurement, []).append(one)
        else:
            yield [0.0, one.weight], 0.0
    for name, those in of.items():
        edges = {edge for c in those for edge in (c.above, c.below) if not math.isnan(edge)}
        known = range_of(name, limits)
        if known is not None:
            edges = {e for e in edges if known.minimum <= e <= known.maximum}
            edges |= {known.minimum, known.maximum}
        inner = sorted(edges)
        between = [(low + high) / 2 for low, high in pairwise(inner)]
        values = [*inner, *between] if known else [*inner, *between, -math.inf, math.inf]
        unknown = sum(one.weight for one in those if one.if_unknown)
        yield [sum(c.weight for c in those if c.holds_at(value)) for value in values], unknown
