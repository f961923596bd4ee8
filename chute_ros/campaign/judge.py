"""What a flight is counted as: by the truth, not by any rule."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from chute_ros.campaign.flight import Flown
from chute_ros.campaign.scenario import Failure, Stop, WayFault
from chute_ros.campaign.truth import SOFT
from chute_ros.campaign.vehicle import SensorFault
from chute_ros.model import Action

#: What the chain may take where all goes well: to see the fall (the slowest rule that sees it),
#: the kill's `kill_to_deploy_delay`, and the release, s.
ENOUGH_TIME = 2.0
#: A way that loses more than this for a while is no way meanwhile.
_MOST_LOSS = 0.6


class Count(enum.Enum):
    """Under which a flight is counted."""

    RIGHT = "as it must be"
    MISSED = "missed: it should have been released and was not"
    LATE = "late: released too late for a soft landing"
    FALSE = "false: released although it flew well"
    DOUBLED = "doubled: ordered again once it was out"
    OUT_OF_ORDER = "out of order: the deploy before the kill"
    UNEXPLAINED = "unexplained: a kill or deploy without its reasons"
    GROUNDED = "grounded: it was never released for flight"
    NO_TIME = "no time: too low when it failed"
    NOT_TOLD = "not told: what happened did not reach the supervisor, or its orders the vehicle"


#: What must not happen.
WRONG = (
    Count.MISSED,
    Count.LATE,
    Count.FALSE,
    Count.DOUBLED,
    Count.OUT_OF_ORDER,
    Count.UNEXPLAINED,
    Count.GROUNDED,
)


@dataclass(frozen=True)
class Judged:
    """count, and in words why."""

    count: Count
    why: str = ""


def judge(flown: Flown) -> Judged:
    """The gravest that is true of it."""
    if flown.grounded:
        return Judged(Count.GROUNDED, flown.grounded)
    wrong = _never(flown)
    if wrong is not None:
        return wrong
    truth = flown.truth
    if not truth.falls:
        return Judged(Count.RIGHT)
    saved = flown.released <= truth.latest or flown.landing_speed <= SOFT
    if saved:
        return Judged(Count.RIGHT)
    if truth.leeway < ENOUGH_TIME:
        return Judged(Count.NO_TIME, f"{truth.leeway:.2f} s were left (need {ENOUGH_TIME:g} s)")
    if blind := blinded(flown):
        return Judged(Count.NOT_TOLD, blind)
    if math.isnan(flown.released):
        return Judged(Count.MISSED, f"{truth.leeway:.2f} s were left")
    return Judged(Count.LATE, f"{flown.released - truth.latest:.2f} s after the last moment")


def _never(flown: Flown) -> Judged | None:
    """What must never happen, whatever reached whom."""
    fired = [(at, one) for at, one in flown.acted if one.action in (Action.KILL, Action.DEPLOY)]
    early = flown.truth.at if flown.truth.falls else math.inf
    if flown.released < early:
        return Judged(Count.FALSE, f"at {flown.released:.2f} s: {_reasons(flown)}")
    if fired and fired[0][1].action is Action.DEPLOY:
        return Judged(Count.OUT_OF_ORDER, f"deploy at {fired[0][0]:.2f} s, no kill before")
    if flown.ordered_again:
        return Judged(Count.DOUBLED, f"{flown.ordered_again} orders after it was known to be out")
    for _, one in fired:
        if not one.rule or not one.reasons:
            return Judged(Count.UNEXPLAINED, f"decision {one.epoch}.{one.id}")
    return None


def _reasons(flown: Flown) -> str:
    for _, one in flown.decided:
        if one.action is Action.DEPLOY:
            return f"{one.rule}: {'; '.join(one.reasons)}"
    return "nobody ordered it"


def blinded(flown: Flown) -> str:
    """Which faults left no time in a row that is enough; empty: there was."""
    truth, scenario = flown.truth, flown.scenario
    if scenario.failure is Failure.POWER:
        return "the autopilot had no power, and nothing else tells of the vehicle"
    up = truth.at - scenario.failure_at
    spells: list[tuple[float, float, str]] = []
    sensors = [one for one in scenario.faults if isinstance(one, SensorFault)]
    for fault in scenario.faults:
        if isinstance(fault, Stop):
            spells.append((up + fault.at, up + fault.at + fault.lasts, f"{fault.who} stopped"))
        elif isinstance(fault, WayFault) and fault.spell.loss > _MOST_LOSS:
            what = "flapped" if fault.spell.flaps else "was cut"
            begin, end = up + fault.spell.begin, up + fault.spell.end
            spells.append((begin, end, f"the way {fault.way} {what}"))
    if len(sensors) > 1:
        spells += [
            (up + one.begin, up + one.end, f"sensor {one.kind} was wrong") for one in sensors
        ]
    free, best = truth.at, 0.0
    for begin, end, _ in sorted(spells):
        best = max(best, min(begin, truth.latest) - free)
        free = max(free, end)
    best = max(best, truth.latest - free)
    if best >= ENOUGH_TIME:
        return ""
    over = [what for begin, end, what in spells if begin < truth.latest and end > truth.at]
    return "; ".join(sorted(over))
