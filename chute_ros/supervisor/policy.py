"""The rules at work: each counted at every update, the gravest of the fulfilled ones acted on."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType
from typing import NamedTuple

from chute_ros.model import Action
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.base import JUST_AFTER, Finding
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.counter import Look, RuleEvidence
from chute_ros.supervisor.gate import against_any_rule, against_rule, too_low
from chute_ros.supervisor.kinds import kind
from chute_ros.supervisor.orders import order_deploy, order_kill
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.rules import BelowMinimum, Clears, Rule
from chute_ros.supervisor.state import State
from chute_ros.supervisor.turn import Turn

#: Two floats that tell the same time may differ by this, s.
_ROUNDING = 1e-6
_NOTHING, _LATCHED = RuleEvidence(), RuleEvidence(latched=True)


class JudgedRule(NamedTuple):
    """One rule as it stands now."""

    rule: Rule
    evidence: RuleEvidence
    findings: tuple[Finding, ...]

    def reasons(self) -> tuple[str, ...]:
        """Each true condition with its value and limit, and the counter."""
        told = tuple(finding.text for finding in self.findings if finding.holds)
        if self.rule.hold <= 0.0:
            return told
        return (*told, f"counter {self.evidence.level:.2f} s of {self.rule.hold:g} s")


def judge(config: SupervisorConfig, state: State, rule: Rule, now: float) -> JudgedRule:
    """Look at one rule's conditions. Its counter must have been brought up to now before."""
    before = state.rule(rule.name)
    findings = tuple([condition.find(config, state, now) for condition in rule.conditions])
    if len(before.kept) == len(findings):  # otherwise none is kept, or it is another rule's
        findings = tuple(
            one._replace(holds=True) if left > 0.0 and one.lingers else one
            for one, left in zip(findings, before.kept, strict=True)
        )
    # Beside a sign in doubt, what is only taken to be so is no whole one either.
    weak = any(one.doubted and one.holds for one in findings)
    found = [
        Look(
            one.holds,
            one.samples,
            one.doubted or (weak and one.presumed),
            bool(one.holds) and one.lingers,
        )
        for one in findings
    ]
    evidence = before.seeing(rule, found)
    return JudgedRule(rule, evidence, findings)


def rule_deadlines(config: SupervisorConfig, state: State, now: float) -> Sequence[float]:
    """When a rule's counter is full or empty, or time alone has changed what it rests on."""
    deadlines = []
    for rule in config.profile.rules:
        if state.stage in rule.states:
            evidence, doubts = state.rule(rule.name), rule.doubted != 1.0
            deadlines.append(evidence.deadline(rule, now) + JUST_AFTER)
            for one in rule.conditions:
                deadlines += one.deadlines(config, state, evidence.holds, doubts, now)
    return deadlines


def rests_until(config: SupervisorConfig, state: State, now: float) -> float:
    """Until when time alone changes nothing of what is known of the vehicle, monotonic s."""
    after = now - _ROUNDING
    limits = config.profile.limits
    turns = [state.measured(name).turns_at(limits[name], after) for name in limits]
    # What it says of itself is young enough until then.
    said = state.heard.vehicle_received + config.vehicle_state_age
    words = (said, said - state.heard.vehicle.armed_age, flight.flies_until(state))
    turns += [turn for turn in words if turn >= after]
    return min(turns) - _ROUNDING


def _as_before(rule: Rule, evidence: RuleEvidence) -> bool:
    """Looked at again, it is what it was: a rule that did not hold, of a vehicle that rests."""
    looked_at = len(evidence.seen) == len(rule.conditions)
    quiet = evidence.holds is False and not evidence.latched and not evidence.put_off
    return rule.rests_on_the_vehicle and looked_at and quiet


def count_rules(turn: Turn, passed: float) -> None:
    """Bring every counter up to now, before anything new is taken in."""
    known = turn.state.rules
    counted = {
        rule.name: known.get(rule.name, _NOTHING).counted(rule, passed)
        for rule in turn.config.profile.rules
    }
    _keep(turn, counted)


def check_rules(turn: Turn) -> None:
    """Judge every rule that lives in this state; act on the gravest that is fulfilled."""
    fulfilled: list[JudgedRule] = []
    stage, known = turn.state.stage, turn.state.rules
    rules = dict(known)
    rests = _vehicle_rests(turn)
    for rule in turn.config.profile.rules:
        before = known.get(rule.name, _NOTHING)
        if stage not in rule.states:
            # What was counted in another state says nothing about the next time.
            latched = before.latched and rule.clears is Clears.NEVER
            rules[rule.name] = _LATCHED if latched else _NOTHING
            continue
        if rests and _as_before(rule, before):
            continue
        judged = judge(turn.config, turn.state, rule, turn.now)
        rules[rule.name] = _cleared(turn, rule, judged.evidence)
        waits = rules[rule.name].put_off
        due = _falls_on(turn) if waits else judged.evidence.fulfilled(rule)
        if due and not rules[rule.name].latched:
            fulfilled.append(judged)
    _keep(turn, rules)
    # A stable sort: of two that want the same, the one that the profile names first.
    for judged in sorted(fulfilled, key=lambda one: -one.rule.action):
        _act(turn, judged)


def _vehicle_rests(turn: Turn) -> bool:
    """Of the vehicle the same is known as at the last look: most updates are heartbeats."""
    state, before = turn.state, turn.before
    if (
        state.heard.measurements is before.heard.measurements
        and state.heard.heights is before.heard.heights
        and state.heard.vehicle is before.heard.vehicle
        and state.heard.disputed == before.heard.disputed
        and state.heard.vehicle_received == before.heard.vehicle_received
        and state.flight.rebooted == before.flight.rebooted
        and turn.now < before.own.vehicle_rests_until
    ):
        return True
    until = rests_until(turn.config, state, turn.now)
    turn.own = replace(turn.own, vehicle_rests_until=until)
    return False


def _cleared(turn: Turn, rule: Rule, evidence: RuleEvidence) -> RuleEvidence:
    if evidence.denied and evidence.cleared():
        evidence = replace(evidence, denied="")
    if not evidence.latched:
        return evidence
    by_itself = rule.clears is Clears.BY_ITSELF and evidence.cleared()
    disarmed = rule.clears is Clears.ON_DISARM and flight.disarmed(
        turn.config, turn.state, turn.now
    )
    if by_itself or disarmed:
        turn.log(f"rule '{rule.name}' has cleared")
        return replace(evidence, latched=False)
    return evidence


def _falls_on(turn: Turn) -> bool:
    """It moves as nothing on the ground does, and nobody has seen it come down."""
    moves = flight.moving(turn.config, turn.state, turn.now)
    return bool(moves) and flight.in_air(turn.config, turn.state, turn.now) is not False


def _act(turn: Turn, judged: JudgedRule) -> None:
    rule, reasons = judged.rule, judged.reasons()
    if not turn.own.leading or turn.state.mode is i.Mode.INHIBITED:
        return
    if turn.state.stage not in rule.states:
        return  # a graver one has just moved it on
    if rule.action is Action.DEPLOY:
        _act_on_deploy(turn, judged)
        return
    evidence = turn.state.rule(rule.name)
    _remember(turn, rule, replace(evidence, latched=True, denied=""))
    if rule.action is Action.KILL:
        order_kill(turn, rule.name, reasons)
    else:
        text = f"rule '{rule.name}': {rule.says or '; '.join(reasons)}"
        turn.warn(f"{text} ({'; '.join(reasons)})")


def _act_on_deploy(turn: Turn, judged: JudgedRule) -> None:
    rule, reasons, evidence = judged.rule, judged.reasons(), turn.state.rule(judged.rule.name)
    if evidence.put_off:
        denied = against_any_rule(turn.config, turn.state, turn.now)
        moves = flight.moving(turn.config, turn.state, turn.now)
        reasons = (*reasons, f"put off as it was too low, and it still falls: {moves}")
    else:
        denied = against_rule(turn.config, turn.state, rule, judged.findings, turn.now)
    lowered = too_low(turn.config, turn.state, turn.now)
    if turn.config.profile.below_minimum is BelowMinimum.NOTHING:
        denied = denied or lowered
    if denied:
        _deny(turn, rule, denied, reasons)
    elif not lowered:
        _remember(turn, rule, replace(evidence, latched=True, put_off=False, denied=""))
        order_deploy(turn, rule.name, reasons)
    elif not evidence.put_off:
        put_off(turn, rule.name)
        order_kill(turn, rule.name, (*reasons, f"no deploy: {lowered}"))


def put_off(turn: Turn, name: str) -> None:
    """The deploy of this rule waits until the vehicle is not too low any more."""
    evidence = replace(turn.state.rule(name), put_off=True, latched=False, denied="")
    _keep(turn, {**turn.state.rules, name: evidence})


def _deny(turn: Turn, rule: Rule, why: str, reasons: tuple[str, ...]) -> None:
    evidence = turn.state.rule(rule.name)
    if kind(evidence.denied) != kind(why):
        turn.log(f"rule '{rule.name}' wants a deploy ({'; '.join(reasons)}): denied, {why}")
    _remember(turn, rule, replace(evidence, denied=why))


def _remember(turn: Turn, rule: Rule, evidence: RuleEvidence) -> None:
    _keep(turn, {**turn.state.rules, rule.name: evidence})


def _keep(turn: Turn, rules: dict[str, RuleEvidence]) -> None:
    if rules != turn.state.rules:
        turn.state = replace(turn.state, rules=MappingProxyType(rules))
