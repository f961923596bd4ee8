"""What a flight is counted as: by the truth, not by any rule."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from chute_ros.campaign.blind import Need, Seen, blinded, enough_time, misled
from chute_ros.campaign.flight import Flown
from chute_ros.campaign.truth import SOFT, SOFT_UNDER_DROGUE
from chute_ros.model import FIRES, Action
from chute_ros.supervisor.gate import OPERATOR

_REFUSED = "the only parachute refused: by the wrong height that it was told, it stood"
#: What a person orders has happened by then, s.
_PERSON_WAITS = 6.0
#: Nearer to the height of its take-off nothing is released, m.
_LOWEST = 10.0
#: A canopy that is out must carry within this, or an alarm and the next parachute follow, s.
_CARRIES_WITHIN = 3.0


class Count(enum.Enum):
    """Under which a flight is counted."""

    CORRECT = "correct"
    MISSED = "missed: it should have been released and was not"
    LATE = "late: released too late for a soft landing"
    FALSE = "false: killed or released although it flew well"
    DOUBLED = "doubled: ordered again once it was out"
    OUT_OF_ORDER = "out of order: the deploy before the kill"
    UNEXPLAINED = "unexplained: a kill or deploy without its reasons"
    GROUNDED = "grounded: it was never released for flight"
    BROKEN = "broken: an exception"
    NO_TIME = "no time: too low when it failed"
    NOT_TOLD = "not told: what happened did not reach the supervisor, or its orders the vehicle"


#: What must not happen.
WRONG = tuple(one for one in Count if one not in (Count.CORRECT, Count.NO_TIME, Count.NOT_TOLD))


@dataclass(frozen=True)
class JudgedFlight:
    """count, and in words why."""

    count: Count
    why: str = ""


def judge(flown: Flown) -> JudgedFlight:
    """The gravest that is true of it."""
    if flown.grounded:
        return JudgedFlight(Count.GROUNDED, flown.grounded)
    return _never(flown) or _owed(flown) or _ordered(flown) or JudgedFlight(Count.CORRECT)


def _never(flown: Flown) -> JudgedFlight | None:
    """What must never happen, whatever reached whom."""
    # Motors that are stopped on the ground hurt nobody.
    fires = (Action.DEPLOY,) if flown.scenario.stands else FIRES
    fired = [one for one in flown.acted if one.decision.action in fires]
    person = flown.scenario.person
    known = min(
        flown.truth.at if flown.truth.falls else math.inf,
        # A parachute that is out, by itself or by its own device, wants the motors stopped.
        flown.released if not math.isnan(flown.released) else math.inf,
        flown.up + person.at if person else math.inf,
    )
    for one in fired:
        if one.at < known:
            reasons = "; ".join(one.decision.reasons)
            if lied := misled(flown.scenario, flown.up, one.at, reasons):
                return JudgedFlight(Count.NOT_TOLD, lied)
            text = f"{one.decision.action.name} {one.at - flown.up:.2f} s after it was up"
            return JudgedFlight(Count.FALSE, f"{text}: {one.decision.rule}: {reasons}")
    opened = flown.opened_by_kill
    if opened < known or (not math.isnan(opened) and abs(flown.release_height) < _LOWEST):
        text = f"a kill alone opened a parachute {opened - flown.up:.2f} s after it was up"
        return JudgedFlight(Count.FALSE, f"{text}, at {flown.release_height:.1f} m")
    if flown.scenario.stands and not math.isnan(flown.released):
        return JudgedFlight(Count.FALSE, "released on the ground")
    decided = [one.action for _, one in flown.decided if one.action >= Action.KILL]
    if decided and decided[0] is Action.DEPLOY:
        return JudgedFlight(Count.OUT_OF_ORDER, "no kill was decided before the deploy")
    by_node: dict[str, Action] = {}
    for one in fired:
        first = by_node.setdefault(one.node, one.decision.action)
        if one.decision.action is Action.KILL and first is Action.DEPLOY:
            text = f"{one.node} was told to deploy before it was told to kill"
            return JudgedFlight(Count.OUT_OF_ORDER, text)
    if flown.ordered_again:
        return JudgedFlight(
            Count.DOUBLED, f"{flown.ordered_again} orders after it was known to be out"
        )
    for one in fired:
        if not one.decision.rule or not one.decision.reasons:
            return JudgedFlight(Count.UNEXPLAINED, one.decision.named)
    return None


def _owed(flown: Flown) -> JudgedFlight | None:
    """A release that should have been and was not in time; of what a person killed, and wanted no
    more, one that followed. None: neither."""
    alone = _killed_alone_at(flown)
    if alone < math.inf:
        return _followed(flown, alone)
    return _fallen(flown) or _not_carried(flown)


def _killed_alone_at(flown: Flown) -> float:
    """When a person's kill that no deploy shall follow was decided, before any deploy; infinity:
    it was not."""
    person = flown.scenario.person
    if person is None or person.does != "kill_only":
        return math.inf
    for at, one in flown.decided:
        if one.action is Action.DEPLOY:
            break
        if one.action is Action.KILL and one.rule == OPERATOR:
            return at
    return math.inf


def _followed(flown: Flown, alone: float) -> JudgedFlight | None:
    """A deploy followed a person's kill that asked for none; None: none did."""
    for at, one in flown.decided:
        if at >= alone and one.action is Action.DEPLOY:
            text = f"DEPLOY {at - alone:.2f} s after a person's kill that asked for nothing more"
            return JudgedFlight(Count.FALSE, f"{text}: {one.rule}: {'; '.join(one.reasons)}")
    return None


def _fallen(flown: Flown) -> JudgedFlight | None:
    """It should have been released; None: it should not, or was in time."""
    truth, scenario = flown.truth, flown.scenario
    soft = SOFT_UNDER_DROGUE if scenario.is_rocket else SOFT
    if (
        not truth.falls
        or truth.lands_softly
        or flown.released <= truth.latest
        or flown.landing_speed <= soft
    ):
        return None
    enough, hidden = enough_time(scenario), scenario.tape.shows_after if scenario.tape else 0.0
    left = truth.leeway - hidden
    if not left >= enough:
        return JudgedFlight(Count.NO_TIME, f"{left:.2f} s were left (need {enough:g} s)")
    need = Need(truth.at + hidden, truth.latest)
    if blind := blinded(scenario, flown.up, need, _seen(flown)):
        return JudgedFlight(Count.NOT_TOLD, blind)
    if flown.refused <= truth.latest:
        return JudgedFlight(Count.NOT_TOLD, _REFUSED)
    if math.isnan(flown.released):
        return JudgedFlight(Count.MISSED, f"{left:.2f} s were left")
    return JudgedFlight(Count.LATE, f"{flown.released - truth.latest:.2f} s after the last moment")


def _not_carried(flown: Flown) -> JudgedFlight | None:
    """What came out does not carry: somebody must be told, and the next parachute must follow."""
    scenario, out = flown.scenario, flown.released
    # Of one that has not come down when its flight ends nobody knows yet.
    if not flown.another.falls or not flown.landing_speed > SOFT:
        return None
    due = flown.another.at + _CARRIES_WITHIN
    if blind := blinded(scenario, flown.up, Need(flown.another.at, due), _seen(flown)):
        return JudgedFlight(Count.NOT_TOLD, blind)
    if flown.landed < due:
        return JudgedFlight(
            Count.NO_TIME, f"{flown.landed - out:.2f} s from its release to the ground"
        )
    followed = [at for at, one in flown.decided if one.action is Action.DEPLOY]
    told = [*followed, *(at for at, _ in flown.alarmed)]
    if not any(flown.another.at <= at <= due for at in told):
        return JudgedFlight(Count.MISSED, "the canopy did not carry, and nobody was alarmed")
    parachutes = scenario.carries.supervised("deploy_links")
    if len(parachutes) < 2 or flown.released_another <= flown.another.latest:
        return None
    if flown.another.leeway < _CARRIES_WITHIN:
        return JudgedFlight(Count.NO_TIME, f"{flown.another.leeway:.2f} s were left for another")
    return JudgedFlight(Count.MISSED, "the canopy did not carry, and no other followed in time")


def _seen(flown: Flown) -> Seen:
    return Seen(flown.told, flown.light_until, flown.unclear)


def _ordered(flown: Flown) -> JudgedFlight | None:
    """A person's order must be carried out; None: there was none, or it was."""
    person, scenario = flown.scenario.person, flown.scenario
    if person is None:
        return None
    due = flown.up + person.at
    latest = min(due + _PERSON_WAITS, math.inf if math.isnan(flown.landed) else flown.landed)
    kills = [one.at for one in flown.acted if one.decision.action is Action.KILL]
    done = flown.released <= latest
    if person.does != "deploy":
        done |= bool(kills) and kills[0] <= latest
    if done or latest - due < enough_time(scenario):
        return None
    if blind := blinded(scenario, flown.up, Need(due, latest), Seen(flown.told)):
        return JudgedFlight(Count.NOT_TOLD, blind)
    if person.does == "deploy" and flown.refused <= latest:
        return JudgedFlight(Count.NOT_TOLD, _REFUSED)
    return JudgedFlight(Count.MISSED, f"a person's {person.does}: {flown.answer or 'no answer'}")
