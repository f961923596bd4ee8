"""What a person must know of the state: in a sentence, and what warns as long as it holds.

Whatever shows a vehicle (safety/state, safety/summary, diagnostics, `chute`, the panel, the fleet)
has it from here: no reader decides for itself whether a vehicle is guarded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from chute_ros.model import Action, Decision
from chute_ros.plain_text import span_text
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import ON_GROUND, Stage
from chute_ros.supervisor.measurements import CLIMB_RATE, FALL_SIGNS
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.policy import judge
from chute_ros.supervisor.readings import unusable
from chute_ros.supervisor.state import State

#: What the modes mean in which no vehicle is protected.
MODES = {
    Mode.SHADOW: "SHADOW: reports its decisions and sends none",
    Mode.INHIBITED: "INHIBITED: decides nothing",
}
#: In the text of a state: nothing can be released now, or nobody would notice that it must be.
UNGUARDED = "NOT GUARDED"
#: Alarms that are published at most.
_MOST_ALARMS = 16
_NOT_OURS = "not by an order of this supervisor"
#: Stages of a vehicle that may have come down, and that somebody walks up to.
_MAY_BE_DOWN = (Stage.KILLING, Stage.DEPLOYED, Stage.FAULT)
#: A link in one of these reaches no parachute, for how long nobody knows.
_GONE = (LinkJudgement.NEVER_SEEN, LinkJudgement.LOST)


def alarms(config: SupervisorConfig, state: State, now: float) -> tuple[str, ...]:
    """Faults that last: those that stay until a reset, and what warns as long as it holds."""
    last = (*state.alarming.alarms, *_warnings(config, state, now))
    return (*last, *_unguarded(config, state, now))[-_MOST_ALARMS:]


def state_text(
    config: SupervisorConfig, state: State, reasons: tuple[str, ...], now: float
) -> str:
    """The state with its reason in a sentence. reasons: against a take-off (block_reasons)."""
    text = _stage_text(config, state, reasons, now) + _arming_text(config, state, now)
    return f"{MODES[state.mode]}; {text}" if state.mode in MODES else text


def _arming_text(config: SupervisorConfig, state: State, now: float) -> str:
    """Which parachutes are armed, wherever the stage by itself lets a person on the ground believe
    otherwise; it goes on after that."""
    down = state.stage in _MAY_BE_DOWN and not state.flight.airborne
    if state.stage is Stage.ARMED or not (down or state.stage in ON_GROUND):
        return ""
    armed, silent = _armed(config, state, now)
    text = f"; ARMED all the same: {_listed(armed)} (safety/arm disarms)" if armed else ""
    if silent:
        text += f"; ARMED when it was last received: {_listed(silent)}"
    if any(link not in config.links or state.hears(config, link, now) for link, _ in silent):
        text += " (one that was exchanged since is forgotten by safety/reset)"
    return text


def _armed_in_part(config: SupervisorConfig, state: State, now: float) -> str:
    """Which parachutes are armed, where those of another link that is received are not."""
    armed, _ = _armed(config, state, now)
    links = {link for link, _ in armed}
    others = [
        (link, device)
        for link in config.deploy_links
        for device in sorted(state.evidence(link).devices)
        if link not in links and _received(config, state, (link, device), now)
    ]
    return f"{_listed(armed)}; NOT armed: {_listed(others)}" if armed and others else ""


def _armed(
    config: SupervisorConfig, state: State, now: float
) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """(link, device) of those that say that they are armed, and of those that said so last and are
    silent; one that is out is neither."""
    out = state.released(config)
    said = [one for one in sorted(state.last_armed) if one not in out]
    armed = [one for one in said if _received(config, state, one, now)]
    return armed, [one for one in said if one not in armed]


def _received(config: SupervisorConfig, state: State, one: tuple[str, str], now: float) -> bool:
    """Its node receives this (link, device), and is received itself."""
    return state.receives(*one) and state.hears(config, one[0], now)


def _listed(those: list[tuple[str, str]]) -> str:
    return ", ".join(map(" ".join, those))


def _stage_text(
    config: SupervisorConfig, state: State, reasons: tuple[str, ...], now: float
) -> str:
    stage = state.stage
    if stage in (Stage.STARTUP, Stage.BLOCKED) and reasons:
        return f"{stage.name}: {'; '.join(reasons)}"
    if unguarded := _unguarded(config, state, now):
        return f"{stage.name}, {UNGUARDED}: {'; '.join(unguarded)}"
    told = [*state.alarming.alarms, *_warnings(config, state, now)][-1:]
    if sentence := _what_was_done(config, state, now):
        # The alarm that led to FAULT is its detail, and stands beside it.
        told = [] if stage is Stage.FAULT else told
        return f"{stage.name}: {'; '.join((sentence, *told))}"
    if told:
        return f"{stage.name}: {told[0]}"
    if state.heard.disputed:
        parts = ", ".join(sorted(state.heard.disputed))
        return f"{stage.name}: {parts} in doubt, as the vehicle's sources contradict each other"
    if stage is Stage.IN_FLIGHT and state.mode is not Mode.ACTIVE:
        return f"{stage.name}: this supervisor guards no vehicle in this mode"
    deploys = any(rule.action is Action.DEPLOY for rule in config.profile.rules)
    if stage is Stage.IN_FLIGHT and not deploys:
        name = config.profile.name
        return f"{stage.name}: only a person releases: profile {name} has no rule that does"
    return stage.name


def _unguarded(config: SupervisorConfig, state: State, now: float) -> list[str]:
    """Why nobody would be saved now in flight; empty: the vehicle is guarded."""
    if state.stage is not Stage.IN_FLIGHT:
        return []
    told = []
    problems = {link: _no_parachute(config, state, link, now) for link in config.deploy_links}
    if all(problems.values()):
        gone = all(problem in _GONE_WORDS for problem in problems.values())
        what = "no parachute can be reached" if gone else "no parachute can be relied on"
        links = ", ".join(f"{link} {problem}" for link, problem in problems.items())
        told.append(f"{what}: {links}")
    signs = (*FALL_SIGNS, CLIMB_RATE)
    used = config.profile.measured
    if used & {*signs} and all(unusable(config, state, name, now) for name in signs):
        told.append("nothing reports whether it falls: no vertical speed, acceleration or height")
    return told


_GONE_WORDS = tuple(f"is {one.name}" for one in _GONE)


def _no_parachute(config: SupervisorConfig, state: State, link: str, now: float) -> str:
    """Why this link would release nothing; empty: it may."""
    evidence, limits = state.evidence(link), config.limits(link)
    judged = evidence.judged(limits, now)
    if judged in _GONE:
        return f"is {judged.name}"
    unhealthy = judged is LinkJudgement.OK and not evidence.device_healthy
    return "is not healthy" if unhealthy else ""


def _warnings(config: SupervisorConfig, state: State, now: float) -> list[str]:
    """Of the rules that only warn, those that do now."""
    told = []
    for rule in config.profile.rules:
        evidence = state.rule(rule.name)
        warns = evidence.latched or evidence.fulfilled(rule)
        if rule.action is Action.NONE and state.stage in rule.states and warns:
            says = rule.says or "; ".join(judge(config, state, rule, now).reasons())
            told.append(f"rule '{rule.name}' warns: {says}")
    return told


def _what_was_done(config: SupervisorConfig, state: State, now: float) -> str:
    """The kill or the deploy of this state: what, when, by whose order and why; what is armed, if
    not all is; empty: none."""
    kill, deploys = state.killing.kill, state.deploying.deploys
    if state.stage is Stage.ARMED:
        return _armed_in_part(config, state, now)
    if state.stage is Stage.KILLING and kill is not None:
        what = "the motors are off" if kill.confirmed else "the motors are being stopped"
        height = _at_height(state.killing.killed_height)
        follows = "; the deploy follows" if state.deploying.deploy_rule else ""
        after = "; no deploy follows" if state.killing.kill_only else follows
        by = _ordered(config, kill.decision, kill.decided_at, height, now)
        return f"{what}, {by}{after}"
    if state.stage is Stage.DEPLOYED:
        return _what_is_out(config, state, now)
    if state.stage not in (Stage.DEPLOYING, Stage.FAULT) or not deploys:
        return ""
    height = _at_height(state.deploying.deploy_height)
    by = _ordered(config, deploys[0].decision, deploys[0].decided_at, height, now)
    if state.stage is Stage.FAULT:
        return f"no parachute confirmed that it was released, {by}"
    step = f"step {len(deploys)} of {len(state.ladder(config))}"
    return f"{_target(deploys[-1].decision)} is to release ({step}), {by}"


def _what_is_out(config: SupervisorConfig, state: State, now: float) -> str:
    """Which parachute is out, since when, at what height, and by whose order each."""
    deploys = state.deploying.deploys
    whose: dict[str, list[str]] = {}
    for link, device in sorted(state.newly_released(config, now)):
        ordered = [one for one in deploys if _names(one.decision, link, device)]
        whose.setdefault(_by(config, ordered), []).append(f"{link} {device}")
    if not whose:
        confirmed = [one for one in deploys if one.confirmed]
        who = [_target(one.decision) for one in confirmed[-1:]]
        whose[_by(config, deploys)] = who or ["a parachute that is not received any more"]
    when = f" {span_text(now - state.stage_since)} ago{_at_height(state.deploying.deploy_height)}"
    told = []
    for by in sorted(whose, key=lambda one: one == _NOT_OURS):
        told.append(f"{', '.join(whose[by])} released{when}, {by}")
        when = ""  # of the first; of another it may be another's
    return "; ".join(told)


def _by(config: SupervisorConfig, ordered: Sequence[Pending]) -> str:
    """By whose order, the first of these."""
    return f"by {_whose(config, ordered[0].decision)}" if ordered else _NOT_OURS


def _names(decision: Decision, link: str, device: str) -> bool:
    return link in decision.targets and decision.device in ("", device)


def _ordered(
    config: SupervisorConfig, decision: Decision, at: float, height: str, now: float
) -> str:
    return f"ordered {span_text(now - at)} ago{height} by {_whose(config, decision)}"


def _whose(config: SupervisorConfig, decision: Decision) -> str:
    """The rule and what it says, or who asked and why."""
    why = decision.reasons[0] if decision.reasons else ""
    for rule in config.profile.rules:
        if rule.name == decision.rule:
            return f"rule '{rule.name}' ({rule.says or why})"
    # A person's reason begins with who it was.
    return why if why.startswith(decision.rule) else f"{decision.rule}: {why}"


def _target(decision: Decision) -> str:
    return " ".join((*decision.targets, decision.device)).strip()


def _at_height(height: float) -> str:
    return "" if math.isnan(height) else f" at {height:.1f} m"
