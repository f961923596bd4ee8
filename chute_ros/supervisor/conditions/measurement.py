"""A measurement above or below a limit, as a condition."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

from chute_ros.supervisor import readings
from chute_ros.supervisor.conditions.base import JUST_AFTER, Condition, Finding
from chute_ros.supervisor.contradictions import DIVE
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    CLIMB_RATE,
    DERIVED,
    FELT_DROP,
    FELT_FALL,
    STANDARD_LIMITS,
    TILT,
    VERTICAL_ACCELERATION,
    VERTICAL_SPEED,
    Limits,
)
from chute_ros.supervisor.yaml_lines import ProfileLines, Where

if TYPE_CHECKING:
    from chute_ros.supervisor.config import SupervisorConfig
    from chute_ros.supervisor.state import State

#: Measurement -> the one of which it is said that it is denied; those that claim it by being low.
_CLAIMS = {
    VERTICAL_SPEED: VERTICAL_SPEED,
    CLIMB_RATE: VERTICAL_SPEED,
    VERTICAL_ACCELERATION: VERTICAL_SPEED,
    "sink_beyond_target": VERTICAL_SPEED,
    ACCELERATION: ACCELERATION,
    FELT_DROP: ACCELERATION,
    FELT_FALL: ACCELERATION,
    TILT: TILT,
    "attitude_error": TILT,
}
_CLAIMED_BELOW = (
    VERTICAL_SPEED,
    CLIMB_RATE,
    VERTICAL_ACCELERATION,
    ACCELERATION,
    FELT_DROP,
    FELT_FALL,
)
#: What can be wrong with a limit.
NEVER, ALWAYS = "can never hold", "always holds"


def known_by(name: str) -> tuple[str, ...]:
    """The measurements that tell this one: the vertical speed is told by the heights as well."""
    besides = DERIVED[CLIMB_RATE] if name == VERTICAL_SPEED else ()
    return (*DERIVED.get(name, (name,)), *besides)


def range_of(name: str, limits: Mapping[str, Limits]) -> Limits | None:
    """What a measurement, or CLIMB_RATE, may be; None: it has no limits."""
    return limits.get(VERTICAL_SPEED if name == CLIMB_RATE else name)


@dataclass(frozen=True)
class MeasurementCondition(Condition):
    """A usable measurement, or one of DERIVED, is above or below a limit (NaN: not asked for)."""

    measurement: str
    above: float = math.nan
    below: float = math.nan
    weight: float = 1.0
    #: Where nothing usable tells, it is taken to hold: a second sign that may be missing.
    if_unknown: bool = False
    #: Once the rule's counter is full, it goes on to hold until it is beyond this (or LINGERS
    #: have passed); NaN: it does not.
    until: float = math.nan
    #: Of a wing that leans as it was commanded it is a dive, and does not hold.
    unless_dived: bool = False
    key: ClassVar = "measurement"
    options: ClassVar = MappingProxyType(
        {
            option: f"{option} belongs to a measurement"
            for option in ("above", "below", "until", "if_unknown", "unless_dived")
        }
    )
    borrowed: ClassVar = ("is",)
    rests_on_the_vehicle: ClassVar = True

    @cached_property
    def limits(self) -> str:
        """What is asked for, in words; made once, as it is told at every update."""
        above = [f"above {self.above:g}"] if not math.isnan(self.above) else []
        below = [f"below {self.below:g}"] if not math.isnan(self.below) else []
        until = f", then until {self.until:g}" if not math.isnan(self.until) else ""
        return " and ".join(above + below) + until

    @cached_property
    def measured(self) -> tuple[str, ...]:
        """Those that it is derived from, or itself."""
        return DERIVED.get(self.measurement, (self.measurement,))

    @cached_property
    def _known_by(self) -> tuple[str, ...]:
        return known_by(self.measurement)

    @property
    def is_silence(self) -> bool:
        """Where it is unknown it may be."""
        return self.if_unknown

    @property
    def goes_on(self) -> bool:
        """Until its last limit."""
        return not math.isnan(self.until)

    def holds_at(self, value: float) -> bool:
        """A limit that is not asked for is NaN, and nothing is beyond it."""
        return not (value <= self.above or value >= self.below)

    def lingers(self, value: float) -> bool:
        """Where it has held for long enough, it is not over yet by this value."""
        if math.isnan(self.until):
            return False
        return not (value <= self.until if math.isnan(self.below) else value >= self.until)

    def problem(self, limits: Mapping[str, Limits]) -> str:
        """Why its limits make no sense, in words; empty: they do."""
        known = range_of(self.measurement, limits)
        if known is None:
            return ""
        told = f"{self.measurement} is {known.minimum:g} to {known.maximum:g}"
        if self.above >= known.maximum or self.below <= known.minimum:
            return f"{NEVER}: {told}"
        if self.above < known.minimum or self.below > known.maximum:
            return f"{ALWAYS}: {told}"
        if not (math.isnan(self.until) or known.minimum <= self.until <= known.maximum):
            return f"has an until that is never reached: {told}"
        return ""

    @classmethod
    def parse(
        cls, lines: ProfileLines, what: str, where: Where, entries: dict[str, Where], weight: float
    ) -> MeasurementCondition:
        """Its name and its limits."""
        known = (*STANDARD_LIMITS, *DERIVED)
        name = lines.choice(entries["measurement"], f"measurement in {what}", known)
        if "is" in entries:
            lines.wrong(entries["is"].line, "`is` belongs to a link: use above or below")
        if "above" not in entries and "below" not in entries:
            lines.wrong(where.line, f"{name} in {what} has no limit: add above or below")
        limits: dict[str, float] = {
            key: lines.number(entries[key], f"{key} of {name} in {what}")
            for key in ("above", "below")
            if key in entries
        }
        if len(limits) == 2 and not limits["above"] < limits["below"]:
            lines.wrong(
                where.line, f"{name} in {what} can never be: above must be less than below"
            )
        said = {
            key: lines.truth(entries[key], f"{key} of {name} in {what}")
            for key in ("if_unknown", "unless_dived")
            if key in entries
        }
        if "until" in entries:
            limits["until"] = _until(lines, f"until of {name} in {what}", entries["until"], limits)
        condition = cls(
            name,
            weight=weight,
            if_unknown=said.get("if_unknown", False),
            unless_dived=said.get("unless_dived", False),
            **limits,
        )
        if problem := condition.problem(lines.limits):
            lines.wrong(where.line, f"{name} in {what} {problem}")
        return condition

    def find(self, config: SupervisorConfig, state: State, now: float) -> Finding:
        """What is measured, unless others deny it, against the limits."""
        name, known = self.measurement, state.measured(self.measurement)
        value, why = readings.reading(config, state, name, now)
        if why:

            def tell() -> str:
                taken = ", taken to be so" if self.if_unknown else ""
                return f"{name} cannot be used: {why} (asked for: {self.limits}){taken}"

            if self.if_unknown:
                return Finding(True, tell, presumed=True)
            return Finding(None, tell, known.count)
        doubt = readings.doubt(state, name, value, now)
        samples = readings.samples(config, state, name, value, now)
        holds = self.holds_at(value)
        denied = self._denied(config, state, now) if holds else ""
        if holds and self.unless_dived:
            denied = denied or state.heard.commanded.get(DIVE, "")

        def told() -> str:
            weaker = f"; in doubt: {doubt}" if doubt else ""
            return f"{name} {value:.2f} ({self.limits}{weaker})"

        if denied:
            return Finding(False, lambda: f"{told()} denied: {denied}", samples)
        lingers = not holds and self.lingers(value)
        return Finding(holds, told, samples, bool(doubt), lingers=lingers)

    def _denied(self, config: SupervisorConfig, state: State, now: float) -> str:
        """Why what this claims of a fall is not so, by other origins; empty: none denies it."""
        name = self.measurement
        if not (state.heard.denied or state.heard.commanded) or name not in _CLAIMS:
            return ""
        below = not math.isnan(self.below)
        claims_a_fall = below if name in _CLAIMED_BELOW else not math.isnan(self.above)
        by_barometer = name == CLIMB_RATE and not math.isnan(
            readings.pressure_rate(config, state, now)
        )
        if not claims_a_fall:
            return ""
        claim = _CLAIMS[name]
        denied = "" if by_barometer else state.heard.denied.get(claim, "")
        return denied or state.heard.commanded.get(name if name == CLIMB_RATE else claim, "")

    def deadlines(
        self, config: SupervisorConfig, state: State, holds: bool | None, doubts: bool, now: float
    ) -> Iterable[float]:
        """When it is too old to hold, and, where that lets it hold, known or doubted no more."""
        limits = config.profile.limits
        turning = self._known_by if self.if_unknown else self.measured if doubts else ()
        if not (turning or holds):
            return ()  # most are so, each time that the supervisor asks when to wake
        told = [state.measured(name).turns_at(limits[name], now) + JUST_AFTER for name in turning]
        for name in self.measured if holds else ():
            told.append(state.measured(name).measured_at + limits[name].max_age + JUST_AFTER)
        return told


def _until(lines: ProfileLines, what: str, where: Where, limits: dict[str, float]) -> float:
    """The limit that ends what another limit began: on its other side."""
    until = lines.number(where, what)
    if len(limits) == 2:
        lines.wrong(where.line, f"{what} belongs to one limit: remove above, below or it")
    elif not limits.get("above", math.inf) > until > limits.get("below", -math.inf):
        text = "less than above" if "above" in limits else "more than below"
        lines.wrong(where.line, f"{what} is {until:g}: need {text}")
    return until
