"""Why flight is blocked or arming refused: every reason with its value and its limit, in words."""

from __future__ import annotations

import math

from chute_ros.model import LinkState
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.state import LinkEvidence, State


def link_problem(config: SupervisorConfig, link: str, evidence: LinkEvidence, now: float) -> str:
    """What is wrong with one link; empty: nothing. Missing, stale, lost and unhealthy differ."""
    state = evidence.state(config, now)
    if state is LinkState.NEVER_SEEN:
        who = "node" if math.isnan(evidence.heard) else "device"
        return f"{link}: its {who} was never heard"
    if state in (LinkState.STALE, LinkState.LOST):
        silence, limit = now - evidence.heard, config.heartbeat.stale_after
        if evidence.silent(limit, now):
            text = f"heartbeat of its node {silence:.2f} s old (limit {limit:g} s)"
            return f"{link}: {state.name}, {text}"
        return f"{link}: its device is {state.name}" + _faults(evidence)
    if not evidence.device_healthy:
        return f"{link}: its device is not healthy" + _faults(evidence)
    return ""


def _faults(evidence: LinkEvidence) -> str:
    faults = [
        f"{device} {fault}" for device, all_ in sorted(evidence.faults.items()) for fault in all_
    ]
    faults += [f"{device} is released" for device in sorted(evidence.deployed)]
    return f" ({'; '.join(faults)})" if faults else ""


def block_reasons(config: SupervisorConfig, state: State, now: float) -> tuple[str, ...]:
    """Every reason against taking off now; empty: none."""
    problem = {
        link: link_problem(config, link, state.links.get(link, LinkEvidence()), now)
        for link in config.links
    }
    against = [link for link in config.required_links if problem[link]]
    for links in (config.kill_links, config.deploy_links):
        # One that can do it is enough; none at all means that nobody would.
        if all(problem[link] for link in links):
            against += links
    reasons = [problem[link] for link in dict.fromkeys(against)]
    reasons += [
        f"{device} asks to block flight: {why}" for device, why in state.device_blocks.items()
    ]
    if config.require_vehicle_state and (text := _vehicle_problem(config, state, now)):
        reasons.append(text)
    if state.stage in (Stage.DEPLOYED, Stage.FAULT):
        reasons.append(f"the vehicle is {state.stage.name}: needs a reset on the ground")
    return tuple(reasons)


def _vehicle_problem(config: SupervisorConfig, state: State, now: float) -> str:
    """Without vehicle/state nobody can tell flight from ground; empty: it is there."""
    age = state.vehicle.armed_age + now - state.vehicle_received
    if math.isnan(age):
        return "vehicle/state: whether the motors are armed was never told"
    if age > config.vehicle_state_age:
        limit = config.vehicle_state_age
        return f"vehicle/state: armed or not is {age:.1f} s old (limit {limit:g} s)"
    return ""


def arm_reasons(config: SupervisorConfig, state: State, now: float) -> tuple[str, ...]:
    """Every reason against arming the parachute now; empty: none."""
    reasons = block_reasons(config, state, now)
    if state.mode is not Mode.ACTIVE:
        reasons += (f"supervisor mode is {state.mode.name} (need ACTIVE)",)
    if state.stage not in (Stage.READY, Stage.ARMED):
        reasons += (f"the vehicle is {state.stage.name} (need READY)",)
    return reasons
