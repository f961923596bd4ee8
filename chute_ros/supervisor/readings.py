"""Measurements as they can be used now, and the rates that heights tell in their place."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from statistics import fmean, median
from typing import TYPE_CHECKING

from chute_ros.supervisor.contradictions import (
    NO_DROP,
    NOT_TOLD,
    Drop,
    Rise,
    felt_drop,
    felt_fall,
    force_error,
    speed_error,
)
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    CLIMB_RATE,
    DERIVED,
    FELT_DROP,
    FELT_FALL,
    FORCE_ERROR,
    HEIGHT,
    PRESSURE_ALTITUDE,
    SINK_BEYOND_TARGET,
    SPEED_ERROR,
    VERTICAL_ACCELERATION,
    VERTICAL_SPEED,
)

if TYPE_CHECKING:  # both hold rules, whose conditions are found here
    from chute_ros.supervisor.config import SupervisorConfig
    from chute_ros.supervisor.state import State

#: A climb rate needs heights this far apart at least, s.
_CLIMB_OVER = 0.4
#: Measurement -> the part of vehicle/state that tells it, where that has another name.
PARTS = {"tilt_deg": "attitude"}
#: A barometer that rises by so much faster than in the rest of the second, m/s, steps up: its
#: noise is some decimetres in a tenth of a second.
_STEP_UP = 10.0
#: A height that is the same to the last bit so shortly after, s, is no other sample: barometers
#: that are read more often than they measure (at 4 Hz and more).
_TOLD_AGAIN, _FEW = 0.3, 3
#: A speed that is the same to the last bit for so long stands, s: ten samples of one that lives.
_STANDS = 1.0
#: What a barometer told longer ago says nothing of a fall, s.
_DROP_WITHIN = 12.0
#: What an accelerometer tells of the last seconds.
_FELT = {FELT_DROP: felt_drop, FELT_FALL: felt_fall}
#: What sets an estimator against others.
_ERRORS = (SPEED_ERROR, FORCE_ERROR)
_HEIGHT_LOST = "the autopilot restarted in flight, and its height with it"


def reading(config: SupervisorConfig, state: State, name: str, now: float) -> tuple[float, str]:
    """A measurement and "", or NaN and why it cannot be used."""
    if name == CLIMB_RATE:
        rate = pressure_rate(config, state, now)
        return (rate, "") if not math.isnan(rate) else _estimated_rate(config, state, now)
    if name == HEIGHT and height_lost(state):
        return math.nan, _HEIGHT_LOST
    if name == VERTICAL_ACCELERATION:
        return _vertical_acceleration(config, state, now)
    if name in _FELT:
        why = unusable(config, state, ACCELERATION, now)
        felt = math.nan if why else _FELT[name](state.heard.motion)
        return felt, why or ("too little was reported lately" if math.isnan(felt) else "")
    if name in _ERRORS:
        return _error(config, state, name, now)
    known = state.measured(name)
    if name == SINK_BEYOND_TARGET:
        beyond = _sink_beyond_target(config, state, now)
        if beyond > known.value or (not math.isnan(beyond) and _speed_is_weak(config, state, now)):
            return beyond, ""
    why = state.heard.unfit.get(name) or known.unusable(config.profile.limits[name], now)
    if not why:
        return known.value, ""
    if name == VERTICAL_SPEED:
        rate = climb_rate(config, state, now)
        return rate, why if math.isnan(rate) else ""
    return math.nan, why


def measured(config: SupervisorConfig, state: State, name: str, now: float) -> float:
    """A measurement, or NaN where it cannot be used."""
    return reading(config, state, name, now)[0]


def doubt(state: State, name: str, value: float, now: float) -> str:
    """Why a measurement that can be used is a weaker sign than another; empty: it is not. value:
    what was read of it, which may be what the heights tell in its place."""
    if value != state.measured(name).value:
        return ""
    if PARTS.get(name, name) in state.heard.disputed:
        return "another source reported otherwise"
    return state.measured(name).doubt(name, now)


def _speed_is_weak(config: SupervisorConfig, state: State, now: float) -> bool:
    """It is in doubt, cannot be used, or does not change, as none of a vehicle that sinks does."""
    speed = state.measured(VERTICAL_SPEED)
    limits = config.profile.limits[VERTICAL_SPEED]
    stands = speed.measured_at - speed.same_since >= _STANDS
    return stands or bool(speed.doubt(VERTICAL_SPEED, now) or speed.unusable(limits, now))


def _sink_beyond_target(config: SupervisorConfig, state: State, now: float) -> float:
    """By the heights of the estimator and of the barometer, whichever sinks less, m/s: one wrong
    speed hides no sink that both tell. NaN: one of them, or the command, is not known."""
    last, limits = state.heard.commanded_speed, config.profile.limits[SINK_BEYOND_TARGET]
    if not now - last.measured_at <= limits.max_age:
        return math.nan
    rates = climb_rate(config, state, now), pressure_rate(config, state, now)
    return math.nan if math.isnan(sum(rates)) else last.value - max(rates)


def climb_rate(config: SupervisorConfig, state: State, now: float) -> float:
    """Vertical speed from the estimator's heights of the last second, m/s, for sources that tell
    none (a receiver without a fix, a barometer alone). NaN: not known. What they are
    above is the same for all of them, also where the autopilot has started anew."""
    return _rate_of(config, state, HEIGHT, now)[0]


def pressure_rate(config: SupervisorConfig, state: State, now: float) -> float:
    """Vertical speed from the barometer's heights of the last second, m/s; NaN: it tells none, or
    has jumped within that second."""
    if state.measured(PRESSURE_ALTITUDE).doubt(PRESSURE_ALTITUDE, now):
        return math.nan
    return _rate_of(config, state, PRESSURE_ALTITUDE, _newest_word(config, state, now))[0]


def pressure_change(config: SupervisorConfig, state: State, now: float) -> Rise:
    """By how much, and from when to when, the barometer's height changed in the last second."""
    if math.isnan(pressure_rate(config, state, now)):
        return NOT_TOLD
    return _rise(state.heard.pressure_heights)


def pressure_drop(config: SupervisorConfig, state: State, now: float) -> Drop:
    """By how much the barometer tells less than before it was last silent."""
    known = state.measured(PRESSURE_ALTITUDE)
    passed = known.measured_at - state.heard.pressure_before[0]
    told = known.usable(config.profile.limits[PRESSURE_ALTITUDE], now)
    unfit = PRESSURE_ALTITUDE in state.heard.unfit
    if unfit or known.doubt(PRESSURE_ALTITUDE, now) or not passed <= _DROP_WITHIN:
        return NO_DROP
    return Drop(state.heard.pressure_before[1] - told, passed)


def pressure_height(config: SupervisorConfig, state: State, now: float) -> float:
    """Height above the take-off by the barometer, m; NaN: not known, or in doubt."""
    known = state.measured(PRESSURE_ALTITUDE)
    if known.has_jumped(now) or PRESSURE_ALTITUDE in state.heard.unfit:
        return math.nan
    usable = known.usable(
        config.profile.limits[PRESSURE_ALTITUDE], _newest_word(config, state, now)
    )
    return usable - state.flight.ground_pressure_altitude


def _newest_word(config: SupervisorConfig, state: State, now: float) -> float:
    """When the vehicle last told how it moves, monotonic s, as long as that is still believed.
    Where all falls silent, a barometer that was heard a moment before the rest must not get old a
    moment before the rest, and leave an estimator alone that it has just denied."""
    claims = (HEIGHT, VERTICAL_SPEED)
    times = [state.measured(name).measured_at for name in (*claims, PRESSURE_ALTITUDE)]
    newest = max((at for at in times if at <= now), default=now)
    believed = max(config.profile.limits[name].max_age for name in claims)
    return newest if now - newest <= believed else now


def samples(config: SupervisorConfig, state: State, name: str, value: float, now: float) -> int:
    """How many have come so far of what tells a measurement that can be used. value: what was read
    of it, which may be what the heights tell in its place."""
    speed = state.measured(VERTICAL_SPEED)
    if name in (*_FELT, *_ERRORS):
        told = DERIVED[name][0]
    elif name == VERTICAL_ACCELERATION and not speed.unusable(
        config.profile.limits[VERTICAL_SPEED], now
    ):
        told = VERTICAL_SPEED
    elif name == CLIMB_RATE or value != state.measured(name).value:
        by_pressure = not math.isnan(pressure_rate(config, state, now))
        told = PRESSURE_ALTITUDE if by_pressure else HEIGHT
    else:
        told = name
    return state.measured(told).count


def height_lost(state: State) -> bool:
    """What tells it started anew in flight, and counts from wherever it was then."""
    return state.flight.rebooted and not state.heard.vehicle.height_holds


def _estimated_rate(config: SupervisorConfig, state: State, now: float) -> tuple[float, str]:
    if height_lost(state):
        return math.nan, _HEIGHT_LOST
    return _rate_of(config, state, HEIGHT, now)


def _vertical_acceleration(
    config: SupervisorConfig, state: State, now: float
) -> tuple[float, str]:
    """Of the last second of vertical speeds, m/s^2, or NaN and why there is none. Where no speed
    is told, of those that the heights tell."""
    if why := unusable(config, state, VERTICAL_SPEED, now):
        return math.nan, why
    newest = state.heard.motion[-1][0] if state.heard.motion else math.nan
    told = [(one[0], one[1]) for one in state.heard.motion if newest - one[0] <= 1.0]
    told = [one for one in told if not math.isnan(one[1])]
    if not told or told[-1][0] - told[0][0] < _CLIMB_OVER:
        return math.nan, "too few vertical speeds that can be used"
    return _slope(tuple(told)), ""


def _error(config: SupervisorConfig, state: State, name: str, now: float) -> tuple[float, str]:
    for one in DERIVED[name]:
        if why := unusable(config, state, one, now):
            return math.nan, why
    if name == FORCE_ERROR:
        error = force_error(state.heard.motion)
    else:
        speed = measured(config, state, VERTICAL_SPEED, now)
        error = speed_error(state.heard.motion, speed, pressure_change(config, state, now))
        # An estimator whose speed alone is wrong hides no sink: its heights tell it.
        by_heights = abs(pressure_rate(config, state, now) - climb_rate(config, state, now))
        error = error if math.isnan(by_heights) else min(error, by_heights)
    return error, "too little is reported at the same time" if math.isnan(error) else ""


def _rate_of(config: SupervisorConfig, state: State, name: str, now: float) -> tuple[float, str]:
    if why := state.heard.unfit.get(name):
        return math.nan, why
    rate = told_rate(config, state, name, now)
    return rate, "too few heights that can be used" if math.isnan(rate) else ""


def told_rate(config: SupervisorConfig, state: State, name: str, now: float) -> float:
    """Vertical speed from these heights of the last second, m/s, whether they are fit to be used
    or not; NaN: there are too few."""
    heights = state.heard.heights if name == HEIGHT else state.heard.pressure_heights
    height = state.measured(name)
    if height.unusable(config.profile.limits[name], now) or not _enough(
        heights, height.measured_at
    ):
        return math.nan
    return _rate(heights)


def _samples(heights: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Without what is the same to the last bit as one before it of a moment ago: it was told more
    often than measured. Where that leaves too few, all of them."""
    kept = [heights[0]]
    for one in heights[1:]:
        if one[1] != kept[-1][1] or one[0] - kept[-1][0] > _TOLD_AGAIN:
            kept.append(one)
    return tuple(kept) if len(kept) >= _FEW else heights


@lru_cache(maxsize=16)  # as _rate
def _rise(heights: tuple[tuple[float, float], ...]) -> Rise:
    heights = _samples(heights)
    rates, since, until = _rates(heights), heights[0][0], heights[-1][0]
    usual = median(rates)
    # As the propellers stop, a barometer in their wash tells some metres more within a moment.
    risen = [
        (usual if rate - usual > _STEP_UP else rate) * (after[0] - before[0])
        for rate, (before, after) in zip(rates, pairwise(heights), strict=True)
    ]
    return Rise(sum(risen) / (until - since), since, until)


@lru_cache(maxsize=16)  # each picture of the vehicle asks for it several times
def _rate(heights: tuple[tuple[float, float], ...]) -> float:
    """What heights (monotonic s, m) tell of a climb, m/s."""
    heights = _samples(heights)
    # The middle one of the single rates: one step of a height, however high, is no climb; nor is
    # it where there are but two.
    rates = _rates(heights)
    rate = median(rates) if len(rates) > 2 else min(rates, key=abs)
    # The noise of neighbours has a middle one as well; over the whole second it is small, where a
    # step is large. What both of them tell is flown.
    over = _slope(heights)
    return min(rate, over, key=abs) if rate * over > 0.0 else 0.0


def _rates(heights: tuple[tuple[float, float], ...]) -> list[float]:
    """From each to the next, m/s."""
    return [(after[1] - before[1]) / (after[0] - before[0]) for before, after in pairwise(heights)]


def _enough(heights: tuple[tuple[float, float], ...], newest: float) -> bool:
    return bool(heights) and newest - heights[0][0] >= _CLIMB_OVER


def _slope(heights: tuple[tuple[float, float], ...]) -> float:
    """Of the straight line that is nearest to them by least squares, m/s."""
    middle = fmean([at for at, _ in heights])
    weights = [at - middle for at, _ in heights]
    ways = [weight * height for weight, (_, height) in zip(weights, heights, strict=True)]
    return sum(ways) / sum([weight**2 for weight in weights])


def unusable(config: SupervisorConfig, state: State, name: str, now: float) -> str:
    """Why a measurement cannot be used; empty: it can."""
    return reading(config, state, name, now)[1]
