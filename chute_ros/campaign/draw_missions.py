"""What a drawn flight of an aircraft has besides its flight: landings, a flight before it, a deck
that moves, wings that take over from rotors, an autopilot that restarts again and again."""

from __future__ import annotations

import random
from dataclasses import replace

from chute_ros.campaign.draw_world import perhaps_one_wrong
from chute_ros.campaign.manoeuvre import Manoeuvre, landing
from chute_ros.campaign.scenario import MOST_FAULTS, Failure, Scenario, Stop

#: Of so many flights each is one; of those that stand, of those whose autopilot restarts, and of
#: those in which nothing fails and nothing else is flown.
_DECKS, _SECOND_FLIGHTS = 0.05, 0.03
_DECKS_OF_STANDING, _RESTARTS_AGAIN, _LANDINGS, _TRANSITIONS = 0.4, 0.3, 0.4, 0.4


def on_a_mission(drawn: Scenario) -> Scenario:
    """The same flight, or one with some of that."""
    # By a chance of its own: all other flights stay as they are.
    chance = random.Random(f"{drawn.seed} mission")
    if chance.random() < (_DECKS_OF_STANDING if drawn.stands else _DECKS):
        drawn = replace(drawn, deck=round(chance.uniform(0.3, 1.5), 2))
    elif not drawn.stands and chance.random() < _SECOND_FLIGHTS:
        drawn = replace(drawn, flights=2)
    if drawn.failure is Failure.REBOOT and chance.random() < _RESTARTS_AGAIN:
        return _restarting(chance, drawn)
    flies = drawn.failure is Failure.NOTHING and not drawn.stands and drawn.manoeuvre is None
    if not flies:
        return drawn
    if drawn.profile == "fixed_wing" and chance.random() < _TRANSITIONS:
        return _flying(chance, drawn, _transition(chance))
    if drawn.ground >= 0.0 and chance.random() < _LANDINGS:
        above = round(chance.uniform(12.0, 25.0), 1)
        drawn = replace(drawn, height=round(drawn.ground + above, 1))
        return _flying(chance, drawn, _landing(chance, above))
    return drawn


def _restarting(chance: random.Random, drawn: Scenario) -> Scenario:
    """One cause: it starts, tells a little, and restarts."""
    at, again = drawn.failure_at, []
    for _ in range(chance.randint(1, 4)):
        at = round(at + chance.uniform(0.8, 3.0), 3)
        again.append(Stop("autopilot", at, round(chance.uniform(0.3, 1.0), 3), dies=True))
    return replace(drawn, faults=(*drawn.faults[: MOST_FAULTS - 1], *again))


def _transition(chance: random.Random) -> Manoeuvre:
    way = chance.choice((1.0, -1.0))
    tilt, sink = round(way * chance.uniform(10.0, 45.0)), round(way * chance.uniform(0.5, 6.0), 1)
    begin, lasts = round(chance.uniform(0.5, 2.0), 2), round(chance.uniform(2.0, 6.0), 2)
    return Manoeuvre("transition", tilt, begin, lasts, sink)


def _landing(chance: random.Random, above: float) -> Manoeuvre:
    sink, begin = round(chance.uniform(1.5, 4.0), 1), round(chance.uniform(0.5, 2.0), 2)
    touches = round(min(sink, chance.choice((0.5, 1.0, 2.0, 4.0)) * chance.uniform(0.7, 1.0)), 2)
    slope = chance.choice((0.0, round(chance.uniform(-25.0, 25.0))))
    return landing(above, sink, touches, begin, slope)


def _flying(chance: random.Random, drawn: Scenario, flown: Manoeuvre) -> Scenario:
    """With one sensor wrong in it, or none; and nobody acts as if something had failed."""
    drawn = replace(drawn, manoeuvre=flown, person=None, aps=False)
    return perhaps_one_wrong(chance, drawn, flown.begin, flown.over_by)
