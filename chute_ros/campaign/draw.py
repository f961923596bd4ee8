"""Flights of a campaign, each drawn from its seed."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import TypeVar

from chute_ros.campaign.channel import Spell
from chute_ros.campaign.draw_missions import on_a_mission
from chute_ros.campaign.draw_world import SETTLED, in_the_world
from chute_ros.campaign.scenario import (
    PROFILES,
    ROS_WAYS,
    SECOND_SENSORS,
    STANDBY_WAYS,
    SUPERVISORS,
    ClockJump,
    Failure,
    Fault,
    Person,
    Scenario,
    Stalls,
    Stop,
    WayFault,
    flown_vehicles,
    is_rocket,
    sensors_of,
    stopping_of,
    ways_of,
)
from chute_ros.campaign.sensors import SensorFault
from chute_ros.links.registered import vehicles
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY, VEHICLE_STATE

KindT = TypeVar("KindT")

_LIKELY = {
    "multirotor": {
        Failure.NOTHING: 6,
        Failure.MOTOR: 6,
        Failure.SINK: 2,
        Failure.REBOOT: 3,
        Failure.POWER: 1,
        Failure.HANG: 1,
    },
    "fixed_wing": {
        Failure.NOTHING: 6,
        Failure.MOTOR: 2,
        Failure.STALL: 4,
        Failure.GLIDE: 2,
        Failure.REBOOT: 2,
        Failure.POWER: 1,
        Failure.HANG: 1,
    },
    "rocket": {
        Failure.NOTHING: 4,
        Failure.NO_DROGUE: 5,
        Failure.FAULT: 3,
        Failure.COMPUTER_REBOOT: 3,
        Failure.COMPUTER_POWER: 1,
        Failure.COMPUTER_SILENT: 1,
    },
}
#: So many aircraft have one, of so many of these one goes wrong, and so many fly as high as this,
#: m: from there even the slowest rule is in time.
_WITH_SECOND, _SECOND_FAULT, _WITH_SECOND_HIGH, _HIGH = 0.3, 0.4, 0.3, (120.0, 300.0)
#: Of the people who kill so many want no deploy after it.
_KILL_ONLY = 0.4


def draw(seed: int) -> Scenario:
    """The same for the same seed, on any machine."""
    chance = random.Random(seed)
    vehicle = _vehicle(chance, seed)
    rocket = is_rocket(vehicle)
    profile = "rocket" if rocket else chance.choice(PROFILES[:2])
    failure = _one_of(chance, _LIKELY[profile])
    burn = round(chance.uniform(1.5, 3.0), 2) if rocket else 0.0
    apogee = Scenario(0, vehicle, "", 0.0, 0.0, 0.0, burn, failure, 0.0).apogee_at
    failure_at = round(chance.uniform(0.5, apogee + 2.0 if rocket else 3.0), 3)
    # Most of what goes wrong goes wrong around the failure; that is what hurts.
    around = max(failure_at, apogee + 3.0) if rocket and chance.random() < 0.7 else failure_at
    standby = chance.random() < 0.25
    count = chance.choices((0, 1, 2, 3), (3, 4, 2, 1))[0]
    drawn = Scenario(
        seed,
        vehicle,
        profile,
        round(chance.choice((chance.uniform(12.0, 40.0), chance.uniform(40.0, 120.0))), 1),
        round(chance.choice((0.0, chance.uniform(0.0, 2.0))), 2),
        round(chance.uniform(18.0, 35.0), 1),
        burn,
        failure,
        failure_at,
        tuple(fault_around(chance, vehicle, around, standby) for _ in range(count)),
        standby,
        aps=chance.random() < 0.5,
        arms=rocket or chance.random() < 0.3,
        person=_person(chance, seed, apogee + 1.0),
    )
    if rocket:
        return drawn
    # Drawn last: a flight without one stays as it is.
    return _with_second_source(chance, on_a_mission(in_the_world(chance, drawn)), around)


def _vehicle(chance: random.Random, seed: int) -> str:
    kinds = sorted(flown_vehicles(), key=lambda one: (-one.often, one.name))
    name = _one_of(chance, {one.name: one.often for one in kinds if not one.replaces})
    for kind in kinds:
        # By a chance of its own: all other flights stay as they are.
        flies = random.Random(f"{seed} {kind.name}").random() < 1.0 / kind.often
        if kind.replaces == name and flies:
            return kind.name
    return name


def _one_of(chance: random.Random, likely: dict[KindT, int]) -> KindT:
    return chance.choices(list(likely), list(likely.values()))[0]


def _person(chance: random.Random, seed: int, earliest: float) -> Person | None:
    if chance.random() > 0.12:
        return None
    does = chance.choice(("deploy", "kill"))
    # By a chance of its own: all else of the flight stays as it is.
    if does == "kill" and random.Random(f"{seed} kill only").random() < _KILL_ONLY:
        does = "kill_only"
    return Person(does, round(chance.uniform(0.5, 4.0) + earliest, 3))


def _when(chance: random.Random, around: float) -> tuple[float, float]:
    """The beginning of a fault, and how long it lasts, s."""
    begin = round(around + chance.uniform(-2.0, 2.0), 3)
    return begin, round(chance.choice((chance.uniform(0.1, 1.0), chance.uniform(1.0, 5.0))), 3)


def fault_around(chance: random.Random, vehicle: str, around: float, standby: bool) -> Fault:
    """Anything that goes wrong besides the failure, at most 2 s before or after around, s."""
    begin, lasts = _when(chance, around)
    end = round(begin + lasts, 3)
    supervisors = SUPERVISORS[: 1 + standby]
    kind = chance.choices(("way", "stop", "stalls", "clock", "sensor"), (9, 3, 1, 1, 4))[0]
    if kind == "sensor":
        sensors = sensors_of(vehicle)
        sensor = chance.choice(list(sensors))
        how = chance.choice(sensors[sensor])
        if not is_rocket(vehicle) and sensor in ("height", "speed"):
            # Being carried up, as no vehicle climbs, makes the heights tell nothing until then.
            begin = max(begin, SETTLED)
            end = round(begin + lasts, 3)
        return SensorFault(sensor, how, begin, end)
    if kind == "stalls":
        return Stalls(chance.choice(supervisors), begin, end, round(chance.uniform(0.05, 0.6), 3))
    nodes = vehicles()[vehicle].links
    if kind == "clock":
        by = chance.choice((-1.0, 1.0)) * 10.0 ** chance.uniform(-1.0, 5.0)
        return ClockJump(chance.choice((*supervisors, *nodes)), begin, round(by, 3))
    if kind == "stop":
        who = chance.choice((*supervisors, *supervisors, *stopping_of(vehicle)))
        return Stop(who, begin, min(lasts, 3.0), dies=chance.random() < 0.5)
    ways = (*ways_of(vehicle), *ROS_WAYS, *(STANDBY_WAYS if standby else ()))
    return WayFault(chance.choice(ways), _spell(chance, begin, end))


def _with_second_source(chance: random.Random, drawn: Scenario, around: float) -> Scenario:
    """The same, or with an IMU, odometry or both besides its autopilot."""
    if chance.random() >= _WITH_SECOND:
        return drawn
    sources = chance.choice(((IMU,), (ODOMETRY,), (IMU, ODOMETRY)))
    autopilot_first = chance.random() < 0.7
    order = (VEHICLE_STATE, *sources) if autopilot_first else (*sources, VEHICLE_STATE)
    faults = drawn.faults
    if chance.random() < _SECOND_FAULT:
        faults = (*faults, _second_fault(chance, chance.choice(sources), around))
    high = chance.random() < _WITH_SECOND_HIGH and not (drawn.stands or drawn.lands)
    height = round(chance.uniform(*_HIGH), 1) if high else drawn.height
    return replace(drawn, vehicle_sources=order, faults=faults, height=height)


def _second_fault(chance: random.Random, source: str, around: float) -> Fault:
    begin, lasts = _when(chance, around)
    kind = chance.choices(("way", "stop", "sensor"), (2, 1, 3))[0]
    if kind == "way":
        return WayFault(source, _spell(chance, begin, round(begin + lasts, 3)))
    if kind == "stop":
        return Stop(source, begin, min(lasts, 3.0), dies=chance.random() < 0.5)
    sensor = chance.choice(list(SECOND_SENSORS[source]))
    how = chance.choice(SECOND_SENSORS[source][sensor])
    begin = max(begin, SETTLED)
    return SensorFault(sensor, how, begin, round(begin + lasts, 3), source)


def _spell(chance: random.Random, begin: float, end: float) -> Spell:
    strength = round(chance.uniform(0.05, 0.5), 3)
    return chance.choice(
        (
            Spell(begin, end, loss=strength),
            Spell(begin, end, loss=1.0),
            Spell(begin, end, double=strength),
            Spell(begin, end, corrupt=strength),
            Spell(begin, end, delay=strength),
            Spell(begin, end, reorder=strength),
            Spell(begin, end, loss=1.0, flaps=round(chance.uniform(0.1, 1.2), 3)),
        )
    )
