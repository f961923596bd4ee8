"""The one gate before a deploy: who wants it, in which state, and every reason against it.

What must hold whatever the profile says: silence alone never deploys (that of a vehicle whose
motors we have stopped high up is not alone: AutopilotFact.KILLED_ALOFT); nothing deploys on the
ground or disarmed, unless a person forces it; below the minimum height only what the profile
allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from chute_ros.supervisor import flight, readings
from chute_ros.supervisor.conditions.base import Finding
from chute_ros.supervisor.config import TRIGGER, Rung, SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import BelowMinimum, Rule
from chute_ros.supervisor.state import State

#: For so long after a kill in flight what tells of a vehicle that stands may be one that falls, s.
_FALLS_AT_MOST = 60.0
#: In place of a rule's name: a person ordered it.
OPERATOR = "operator"
#: Where a person may deploy without force.
_IN_FLIGHT = (Stage.IN_FLIGHT, Stage.KILLING, Stage.DEPLOYING, Stage.FAULT)
#: Why what falls after such a kill gets no deploy.
_ALONE = "a person asked for the kill alone; safety/deploy releases"


def against_person(config: SupervisorConfig, state: State, force: bool, now: float) -> str:
    """Why a person's deploy is refused; empty: it is not."""
    if state.stage is Stage.DEPLOYED:
        if not force:
            return "a parachute is out already; force releases the next of the ladder"
        if all(out_already(state, rung) for rung in config.ladder):
            return "every parachute of the ladder is out already"
        return ""
    if state.stage in _IN_FLIGHT or force:
        return ""
    unknown = ""
    if flight.in_air(config, state, now) is None:
        unknown = " (nothing fresh says whether it is in the air)"
    return f"the vehicle is {state.stage.name}, not in flight{unknown}; force deploys all the same"


def against_rule(
    config: SupervisorConfig, state: State, rule: Rule, findings: Sequence[Finding], now: float
) -> str:
    """Why the deploy of a rule is denied; empty: it is not."""
    told = [
        finding
        for condition, finding in zip(rule.conditions, findings, strict=True)
        if finding.holds and not condition.is_silence
    ]
    wrong = against_any_rule(config, state, now)
    if not wrong and not told:
        return "only silence speaks for it, and silence alone never deploys"
    return wrong


def against_any_rule(config: SupervisorConfig, state: State, now: float) -> str:
    """Why no rule may deploy now; empty: one may."""
    in_flight = state.stage is Stage.IN_FLIGHT or (
        state.stage is Stage.KILLING and state.killing.killed_in_flight
    )
    # Under a canopy that does not carry, or after orders that nobody confirmed, the next one may
    # be released.
    ordered = state.stage in (Stage.DEPLOYED, Stage.FAULT) and state.flight.airborne
    if not in_flight and not ordered:
        return f"the vehicle is {state.stage.name}, not in flight"
    if _killed_alone(state):
        return _ALONE
    killed = _killed(state, now)
    if flight.down_undisputed(config, state, now) and not killed:
        return "the vehicle says that it stands, and nothing contradicts it"
    if flight.disarmed(config, state, now) and not killed:
        return "the motors are disarmed, and nothing says that it falls"
    if killed and flight.in_air(config, state, now) is False:
        return "the vehicle has come down"
    return ""


def out_already(state: State, rung: Rung) -> bool:
    """The parachutes that this step of the ladder can release all say that they are released, or
    its node has reported that it is; but one with a drogue out has its parachute left."""
    devices = state.evidence(rung.link).devices
    meant = [s for name, s in devices.items() if rung.device in ("", TRIGGER, name)]
    if any(status.before_parachute for status in meant):
        return False
    step = ((rung.link,), rung.device)
    confirmed = [deploy.decision for deploy in state.deploying.deploys if deploy.confirmed]
    if any((decision.targets, decision.device) == step for decision in confirmed):
        return True
    return bool(meant) and all(status.deployed for status in meant)


def too_low(config: SupervisorConfig, state: State, now: float) -> str:
    """That the vehicle is below the minimum height, in words; empty: it is not, or nobody knows
    (a height that cannot be used is absent, not zero)."""
    profile = config.profile
    if profile.below_minimum is BelowMinimum.DEPLOY:
        return ""
    minimum = profile.minimum_height
    height = readings.measured(config, state, "height", now)
    known = state.measured("height")
    if known.has_jumped(now) and known.value < known.before_jump:
        height = math.nan  # it has jumped down: that it is low may be as wrong as before
    by_pressure = readings.pressure_height(config, state, now)
    # Far below the take-off it says nothing of the ground beneath: unknown, as no height is.
    low = -minimum <= height < minimum
    low = low and not flight.above_its_ground(state, height) >= minimum
    if not math.isnan(by_pressure) and (low or not height >= minimum):
        # The barometer says it where the estimator does not, and denies it where it does.
        height, low = by_pressure, -minimum <= by_pressure < minimum
    if low:
        return f"height {height:.1f} m is below the minimum {minimum:g} m"
    if profile.minimum_height > 0.0 and not state.flight.was_high:
        return f"it was never seen at the minimum height, {profile.minimum_height:g} m"
    return ""


def _killed_alone(state: State) -> bool:
    """A person asked for the kill under way alone. One that came to nothing has stopped no motors,
    and what falls later does not fall by it; what fell before falls on as they wanted."""
    kill, ordered = state.killing.kill, bool(state.deploying.deploys)
    # A parachute that came out by itself since then asks for no other one.
    by_itself = state.stage is Stage.DEPLOYED and state.killing.killed_in_flight and not ordered
    if state.stage is not Stage.KILLING and not by_itself:
        return False
    in_vain = kill is not None and kill.given_up and not kill.confirmed
    falls_on = any(rule.denied == _ALONE for rule in state.rules.values())
    return state.killing.kill_only and (falls_on or not in_vain)


def _killed(state: State, now: float) -> bool:
    """Our own kill was decided in flight, and not long ago: motors that are off since then are
    its effect."""
    kill = state.killing
    in_flight = kill.killed_in_flight and not kill.killed_standing
    return in_flight and state.stage is Stage.KILLING and now < kill.killed_at + _FALLS_AT_MOST
