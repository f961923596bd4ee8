"""Did enough reach the supervisor, and its orders the vehicle?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.scenario import (
    Failure,
    Scenario,
    Stalls,
    Stop,
    WayFault,
    may_count,
    outlives,
)
from chute_ros.campaign.sensors import SensorFault
from chute_ros.campaign.truth import SOFT
from chute_ros.protocol.vehicle_merge import FRESH, IMU, VEHICLE_STATE
from chute_ros.sim.flight import GRAVITY

#: What the chain may take where all goes well: to see the fall (the slowest rule that sees it),
#: the kill's `kill_to_deploy_delay`, and the release, s. A rocket must fall for 3 s first, so that
#: a drogue that comes late by itself is waited for.
_ENOUGH_TIME, _ENOUGH_FOR_ROCKET = 2.0, 6.5
#: A way that loses more than this for a while is no way meanwhile; so are stalls as long as that.
_MOST_LOSS, _MOST_STALL = 0.6, 0.3
#: A flight computer of which no line comes whole for longer than this tells nothing, s.
_LONGEST_GAP = 1.0
#: A standby has taken over from a supervisor that stopped or whose ways are cut by then, s:
#: `lease_timeout` (twice, by rank) after the last claim, or after the links have become LOST.
_TAKEN_OVER, _TAKEN_OVER_DEAF = 1.5, 2.5
#: What a sensor told counts for so long, s.
_LASTS = 1.0
#: What a sensor says may be one more lie for so long after it lied, s.
_DISTRUSTED = 10.0
#: Sensor -> the measurements of the reasons that it tells.
_TOLD_BY = {
    "height": ("height", "climb_rate"),
    "speed": ("vertical_speed",),
    "tilt": ("tilt_deg",),
    "force": ("acceleration",),
    "pressure": ("pressure", "climb_rate"),
    "estimator": (
        *("height", "climb_rate", "vertical_speed", "tilt_deg"),
        *("attitude_error", "sink_beyond_target"),
    ),
}
#: One of these that is wrong is a fault of one origin.
_Lie = SensorFault | EstimatorFault
#: A descent is told by its attitude or its force as well, if they differ by so much from those of
#: one that flies: rad, m/s^2.
_TELLING_TILT, _TELLING_FORCE = 0.9, 4.0
_NO_POWER = {
    Failure.POWER: "the autopilot had no power, and nothing else tells of the vehicle",
    Failure.COMPUTER_POWER: "the flight computer had no power, and nothing else fires the drogue",
    Failure.COMPUTER_SILENT: "the flight computer told nothing",
}


@dataclass(frozen=True)
class Need:
    """Something had to happen between these times, virtual s."""

    begin: float
    end: float


@dataclass(frozen=True)
class Seen:
    """What decides besides the scenario, virtual s. told: when lines of a rocket's flight computer
    came whole; light_until: when less than half of its weight last carried an aircraft in its
    fall; unclear: from when until when it fell past where it took off, high above the ground."""

    told: Sequence[float] = ()
    light_until: float = math.nan
    unclear: tuple[float, float] = (math.nan, math.nan)


@dataclass(frozen=True)
class _Hidden:
    """In this time nothing could be known or done, for this cause."""

    begin: float
    end: float
    cause: str


def enough_time(scenario: Scenario) -> float:
    """How long the chain may take, s."""
    if scenario.is_rocket:
        return _ENOUGH_FOR_ROCKET
    # Until it is old, the last word of an autopilot without power denies the sinking, unless
    # another source that knows it is preferred.
    sinking = next(one for one in scenario.vehicle_sources if one != IMU)
    waits = outlives(scenario) and sinking == VEHICLE_STATE
    return _ENOUGH_TIME + (FRESH if waits else 0.0) + _until_it_sinks(scenario)


def _turns_like_one_that_flies(scenario: Scenario) -> bool:
    """An IMU alone feels the bank and the force of a spiral, which is flown on purpose as well."""
    dives = scenario.descent is not None and scenario.descent.sink > SOFT
    return outlives(scenario) and scenario.second_sources == (IMU,) and dives


def _until_it_sinks(scenario: Scenario) -> float:
    """How long it comes down no faster than softly, as what is flown may, s."""
    way = scenario.descent or scenario.unheld
    if way is None or way.sink <= SOFT or scenario.tape is not None:
        return 0.0
    return -way.settles * math.log(1.0 - SOFT / way.sink)


def blinded(
    scenario: Scenario,
    up: float,
    need: Need,
    seen: Seen = Seen(),
) -> str:
    """Which faults left no time in a row that is enough; empty: there was. All in virtual s."""
    failed_at = up + scenario.failure_at
    silent = scenario.failure in _NO_POWER and not outlives(scenario)
    if silent and failed_at < need.end:
        return _NO_POWER[scenario.failure]
    if _turns_like_one_that_flies(scenario) and failed_at < need.end:
        return f"all that was left was an {IMU}, and an aeroplane dived as it turns in flight"
    drawn = [replace(one, begin=up + one.begin, end=up + one.end) for one in _all_hidden(scenario)]
    if scenario.is_rocket:
        drawn += _gaps(seen.told, need)
    drawn += _as_in_flight(scenario, up, seen.light_until)
    drawn += _one_against_one(scenario, up)
    if not math.isnan(seen.unclear[0]):
        drawn.append(_Hidden(*seen.unclear, "it fell past the height at which it took off"))
    hidden = [one for one in drawn if one.begin < min(one.end, need.end)]
    free, best = need.begin, 0.0
    for one in sorted(hidden, key=lambda one: one.begin):
        best = max(best, one.begin - free)
        free = max(free, one.end)
    best = max(best, need.end - free)
    if best >= enough_time(scenario):
        return ""
    return "; ".join(sorted({one.cause for one in hidden if one.end > need.begin}))


def misled(scenario: Scenario, up: float, at: float, reasons: str) -> str:
    """Which sensors told together, until then (virtual s), what was not so and was a reason;
    empty: one at most. What rests on two signs is as wrong as they are."""
    lied = [
        one
        for one in scenario.faults
        if isinstance(one, _Lie)
        and one.how != "gone"
        and may_count(scenario, one)
        and up + one.begin <= at <= up + one.end + _LASTS
        and any(name in reasons for name in _TOLD_BY.get(one.sensor, ()))
    ]
    pairs = itertools.permutations(lied, 2)
    names = {_name(one) for one, other in pairs if _together(one, other)}
    return f"sensors {', '.join(sorted(names))} were wrong at once" if names else ""


def _together(one: _Lie, other: _Lie) -> tuple[float, float] | None:
    """From when until when what both of them tell is wrong, s; None: it never is, or they are one.
    What a sensor told last still counts for a while."""
    begin, end = max(one.begin, other.begin), min(one.end, other.end) + _LASTS
    return (begin, end) if one.sensor != other.sensor and begin < end else None


def _name(one: _Lie) -> str:
    return f"{one.source} {one.sensor}".strip()


def _all_hidden(scenario: Scenario) -> list[_Hidden]:
    hidden = []
    sensors = [
        one
        for one in scenario.faults
        if isinstance(one, _Lie)
        and may_count(scenario, one)
        and (one.source or not outlives(scenario))
    ]
    for fault in scenario.faults:
        if isinstance(fault, Stop):
            end = fault.at + fault.lasts
            if scenario.standby and fault.who == "supervisor":
                end = min(end, fault.at + _TAKEN_OVER)
            hidden.append(_Hidden(fault.at, end, f"{fault.who} stopped"))
        elif isinstance(fault, Stalls) and fault.longest > _MOST_STALL:
            hidden.append(_Hidden(fault.begin, fault.end, f"{fault.who} stalled"))
        elif isinstance(fault, WayFault) and fault.spell.loss > _MOST_LOSS:
            hidden.append(_cut(fault, scenario.standby))
    for one, other in itertools.combinations(sensors, 2):
        if wrong := _together(one, other):
            both = ", ".join(sorted((_name(one), _name(other))))
            hidden.append(_Hidden(*wrong, f"sensors {both} were wrong"))
    return [one for one in hidden if not _is_idle(one.cause, scenario)]


def _gaps(told: Sequence[float], need: Need) -> list[_Hidden]:
    """Where no line came whole, virtual s."""
    times = [one for one in told if need.begin < one < need.end]
    return [
        _Hidden(before, after, "no line of the flight computer came whole")
        for before, after in itertools.pairwise((need.begin, *times, need.end))
        if after - before > _LONGEST_GAP
    ]


def _as_in_flight(scenario: Scenario, up: float, light_until: float) -> list[_Hidden]:
    """Where an IMU is all that is left, its attitude lies or has lied, and drag carries what falls
    as wings and rotors carry what flies: just so it would tell of one that flies well, whose
    autopilot hangs and whose attitude alone is wrong - and that must not be ended. Virtual s."""
    if not outlives(scenario) or scenario.second_sources != (IMU,):
        return []
    return [
        _Hidden(
            up + one.begin if math.isnan(light_until) else max(up + one.begin, light_until),
            up + one.end + (_LASTS if one.how == "gone" else _DISTRUSTED),
            f"all that was left was an {IMU}, whose tilt was wrong, and drag carried the vehicle",
        )
        for one in scenario.faults
        if isinstance(one, SensorFault) and (one.source, one.sensor) == (IMU, "tilt")
    ]


def _one_against_one(scenario: Scenario, up: float) -> list[_Hidden]:
    """Where a descent is told by the estimator and by the pressure alone, as its attitude and its
    force are those of one that flies, and one of the two tells what is not so. Virtual s."""
    way = scenario.descent if scenario.failure in (Failure.SINK, Failure.STALL) else None
    sinks_level = way is not None and (
        way.tilt <= _TELLING_TILT and abs(way.force - GRAVITY) <= _TELLING_FORCE
    )
    if not (sinks_level if scenario.tape is None else scenario.tape.level):
        return []
    return [
        _Hidden(
            up + one.begin,
            up + one.end + _LASTS,
            "the estimator and the pressure told otherwise, and nothing else tells a level sink",
        )
        for one in scenario.faults
        if isinstance(one, EstimatorFault)
        or (isinstance(one, SensorFault) and one.sensor == "pressure" and one.how != "gone")
    ]


def _cut(fault: WayFault, standby: bool) -> _Hidden:
    spell, end = fault.spell, fault.spell.end
    if standby and not spell.flaps and fault.way.endswith("the supervisor"):
        deaf = fault.way.startswith("to")
        end = min(end, spell.begin + (_TAKEN_OVER_DEAF if deaf else _TAKEN_OVER))
    what = "flapped" if spell.flaps else "was cut"
    return _Hidden(spell.begin, end, f"the way {fault.way} {what}")


def _is_idle(cause: str, scenario: Scenario) -> bool:
    """What stands by may be away, as long as the one that leads is not; a second source may, as
    long as there is another; an autopilot without power is away anyhow."""
    if outlives(scenario) and cause.startswith("the way autopilot "):
        return True
    if any(cause.startswith((f"{one} ", f"the way {one} ")) for one in scenario.second_sources):
        return not outlives(scenario) or len(scenario.second_sources) > 1
    names = [
        one.way if isinstance(one, WayFault) else one.who
        for one in scenario.faults
        if isinstance(one, (Stop, Stalls, WayFault))
    ]
    return "standby" in cause and not any(name.endswith("supervisor") for name in names)
