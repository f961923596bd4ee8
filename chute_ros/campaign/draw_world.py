"""What the world adds to a drawn flight of an aircraft: its body, the ground, what its autopilot
does besides flying, what it is told to fly, and an estimator that is wrong with itself."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.manoeuvre import Manoeuvre
from chute_ros.campaign.scenario import (
    MOST_FAULTS,
    Autopilot,
    Canopy,
    Failure,
    HomeMove,
    Scenario,
    sensors_of,
)
from chute_ros.campaign.sensors import SensorFault
from chute_ros.sim.autopilot_kinds import ARDUCOPTER, ARDUPLANE, GENERIC, PX4
from chute_ros.sim.flight import Descent
from chute_ros.sim.home import Homing

#: Ends of an aeroplane's controlled flight: m/s down, s, degrees, m/s^2.
ENDS = {
    "flat spin": (10.0, 1.0, 20.0, 10.5),
    "upright spin": (12.0, 1.5, 65.0, 13.0),
    "steep spin": (18.0, 1.5, 75.0, 15.0),
    "deep stall": (9.0, 1.2, 15.0, 9.8),
    "spiral dive": (17.0, 2.7, 72.0, 22.0),
    "dive": (14.0, 2.0, 40.0, 9.0),
}
#: Name of the descent of a multirotor with less thrust than it needs.
PARTIAL_THRUST = "partial thrust"
#: Of so many flights each of these is one, and of so many of those in which nothing fails it flies
#: a manoeuvre, half of them with one sensor wrong in it.
_GROUNDS, _DRIFTS, _HOME_MOVES, _ESTIMATORS, _CANOPIES = 0.2, 0.1, 0.1, 0.15, 0.06
_MANOEUVRES, _WRONG_SENSOR, _STANDS = 0.6, 0.5, 0.05
#: Of those that fail so many do it in a manoeuvre.
_FAILS_IN_ONE = 0.1
#: A manoeuvre ends so high, and a hill leaves so much room, m.
_ROOM = 15.0
#: An aeroplane flies so fast, m/s.
_CRUISE = 20.0
#: Heights are looked at for a second, of which the flight has settled for 0.3 s.
SETTLED = 0.7
#: Who flies it, where home does this and the vehicle is of this kind.
_ARDUPILOTS = {
    (Homing.ZEROED, "fixed_wing"): ARDUPLANE,
    (Homing.STAYS, "multirotor"): ARDUCOPTER,
}


def in_the_world(chance: random.Random, drawn: Scenario) -> Scenario:
    """The same flight, there."""
    drawn = replace(drawn, autopilot=_autopilot(chance, drawn.profile))
    if drawn.failure is Failure.NOTHING and chance.random() < _STANDS:
        return _on_the_ground(chance, drawn)
    drawn = with_body(chance, drawn)
    drawn = _over_ground(chance, drawn)
    if chance.random() < _HOME_MOVES:
        by = round(chance.choice((-1.0, 1.0)) * chance.uniform(5.0, 60.0), 1)
        drawn = replace(drawn, faults=(*drawn.faults, HomeMove(_around(chance, drawn), by)))
    if chance.random() < _ESTIMATORS:
        drawn = _with_estimator(chance, drawn)
    elif chance.random() < _manoeuvres(drawn.failure):
        drawn = _with_manoeuvre(chance, drawn)
    if chance.random() < _CANOPIES:
        tangles = Canopy(speed=round(chance.uniform(18.0, 24.0), 1))
        late = Canopy(opens=round(chance.uniform(2.0, 4.0), 1))
        drawn = replace(drawn, canopy=chance.choice((tangles, late)))
    return drawn


def _on_the_ground(chance: random.Random, drawn: Scenario) -> Scenario:
    """Its estimator runs away while it stands, armed, and takes it for one in flight."""
    begin, lasts = chance.uniform(0.5, 2.0), chance.uniform(4.0, 9.0)
    how = chance.choice(("leans", "diverges"))
    strength = chance.uniform(0.2, 0.6) if how == "leans" else chance.uniform(2.0, 6.0)
    end = round(begin + lasts, 3)
    fault = EstimatorFault(how, round(begin, 3), end, round(strength, 2))
    stands = replace(drawn, height=0.0, gusts=0.0, person=None, aps=False)
    return _with_one_wrong(stands, fault)


def _autopilot(chance: random.Random, profile: str) -> Autopilot:
    often = {
        Homing.STAYS: 4,
        Homing.FOLLOWS: 3,
        Homing.ZEROED: 3 if profile == "fixed_wing" else 1,
    }
    homing = chance.choices(list(often), list(often.values()))[0]
    drifts = round(chance.uniform(-0.5, 0.5), 2) if chance.random() < _DRIFTS else 0.0
    kind = _ARDUPILOTS.get((homing, profile), GENERIC)
    if homing is Homing.FOLLOWS and chance.random() < 0.6:
        kind = PX4
    return Autopilot(homing, drifts, kind.name, chance.choice((1, 2)))


def with_body(chance: random.Random, drawn: Scenario) -> Scenario:
    """An aeroplane has one of its own; one that breaks tumbles like anything else."""
    failure = drawn.failure
    if failure is Failure.SINK:
        lean, settles = chance.uniform(0.05, 0.4), chance.uniform(1.0, 2.5)
        sinks = Descent(
            PARTIAL_THRUST,
            round(chance.uniform(7.0, 12.0), 1),
            round(settles, 2),
            round(lean, 2),
        )
        return replace(drawn, descent=sinks)
    if drawn.profile != "fixed_wing" or failure is Failure.MOTOR:
        return drawn
    unheld = end_of_control(chance, "spiral dive")
    held = unheld
    if failure is Failure.STALL:
        held = unheld = end_of_control(chance, chance.choice(list(ENDS)))
    elif failure is Failure.GLIDE:
        held = Descent("glide", round(chance.uniform(1.5, 4.0), 1), 1.5, 0.1)
    return replace(drawn, descent=held, unheld=unheld)


def end_of_control(chance: random.Random, name: str) -> Descent:
    """One of ENDS, each number up to a tenth more or less."""
    sink, settles, tilt, force = (one * chance.uniform(0.9, 1.1) for one in ENDS[name])
    tilt = round(math.radians(tilt), 2)
    return Descent(name, round(sink, 1), round(settles, 2), tilt, round(force, 1))


def _over_ground(chance: random.Random, drawn: Scenario) -> Scenario:
    if chance.random() >= _GROUNDS:
        return drawn
    kind = chance.choice(("roof", "valley", "hill"))
    if kind == "roof":
        height = round(chance.uniform(4.0, 20.0), 1)
        return replace(drawn, height=height, ground=-round(chance.uniform(30.0, 120.0), 1))
    if kind == "valley":
        return replace(drawn, ground=-round(chance.uniform(10.0, 100.0), 1))
    room = drawn.height - _ROOM
    return replace(drawn, ground=round(chance.uniform(0.0, room), 1)) if room > 0.0 else drawn


def _around(chance: random.Random, drawn: Scenario) -> float:
    return round(max(SETTLED, drawn.failure_at + chance.uniform(-2.0, 2.0)), 3)


def _with_estimator(chance: random.Random, drawn: Scenario) -> Scenario:
    """One cause moves all that it tells."""
    begin = _around(chance, drawn)
    if drawn.failure in (Failure.NOTHING, Failure.HANG, Failure.GLIDE):
        how = chance.choice(("diverges", "leans"))
    else:
        how = chance.choice(("diverges", "hovers"))
    if how == "leans":
        strength = chance.uniform(0.2, 1.0)
    else:
        strength = chance.choice((-1.0, 1.0, 1.0)) * chance.uniform(1.5, 6.0)
    lasts = chance.uniform(2.0, 7.0)
    strength = 0.0 if how == "hovers" else round(strength, 2)
    fault = EstimatorFault(how, begin, round(begin + lasts, 3), strength)
    return _with_one_wrong(drawn, fault)


def _manoeuvres(failure: Failure) -> float:
    """How many of them fly one. A glide that begins in one would not do what it was told."""
    if failure is Failure.GLIDE:
        return 0.0
    return _MANOEUVRES if failure is Failure.NOTHING else _FAILS_IN_ONE


def _with_manoeuvre(chance: random.Random, drawn: Scenario) -> Scenario:
    begin = round(chance.uniform(0.5, 2.0), 2)
    kind = chance.choice(("flip", "throw", "dive", "descent", "descent"))
    room = drawn.height - drawn.ground - _ROOM
    if kind == "flip":
        one = Manoeuvre(kind, round(chance.uniform(300.0, 720.0)), begin)
        needs = 15.0
    elif kind == "throw":
        one = Manoeuvre(kind, round(chance.uniform(0.4, 1.3), 2), begin)
        needs = 20.0
    elif kind == "dive":
        lasts, sink = round(chance.uniform(0.8, 2.0), 2), round(chance.uniform(3.0, 9.0), 1)
        tilt = round(chance.uniform(45.0, 85.0))
        one, needs = Manoeuvre(kind, tilt, begin, lasts, sink), sink * (lasts + 1.0)
    else:
        sink, lasts = round(chance.uniform(1.5, 13.0), 1), round(chance.uniform(3.0, 8.0), 1)
        one, needs = Manoeuvre(kind, sink, begin, lasts), sink * (lasts + 1.0)
        if drawn.profile == "fixed_wing":
            # Down the way that it flies, which is so much faster.
            one = replace(one, lean=round(math.degrees(math.asin(sink / _CRUISE)), 1))
    higher = round(max(0.0, needs - room), 1)
    # The parachute of a UPF that may release itself has limits of its own for what is flown.
    drawn = replace(drawn, manoeuvre=one, height=drawn.height + higher, aps=False)
    if drawn.failure is not Failure.NOTHING:
        return replace(drawn, failure_at=round(begin + chance.uniform(0.2, 3.0), 3))
    return perhaps_one_wrong(chance, drawn, begin, begin + 3.0)


def perhaps_one_wrong(
    chance: random.Random, drawn: Scenario, begin: float, latest: float
) -> Scenario:
    """With any sensor of its autopilot wrong, from about begin to latest on, s, or none."""
    if chance.random() >= _WRONG_SENSOR:
        return drawn
    sensors = sensors_of(drawn.vehicle)
    sensor = chance.choice(list(sensors))
    wrong = max(SETTLED, begin + chance.uniform(-0.5, latest - begin))
    end = round(wrong + chance.uniform(0.5, 4.0), 3)
    fault = SensorFault(sensor, chance.choice(sensors[sensor]), round(wrong, 3), end)
    return _with_one_wrong(drawn, fault)


def _with_one_wrong(drawn: Scenario, fault: SensorFault | EstimatorFault) -> Scenario:
    """Of all that tells of the vehicle this is wrong, and nothing else."""
    others = [one for one in drawn.faults if not isinstance(one, SensorFault)]
    return replace(drawn, faults=(*others[: MOST_FAULTS - 1], fault))
