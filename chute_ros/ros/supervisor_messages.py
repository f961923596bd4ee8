"""The supervisor's picture as it is published: safety/state and /diagnostics."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from chute_msgs.msg import RuleState, SafetyState, SafetySummary
from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros.ros import diagnostics, messages
from chute_ros.runtime.topics import SafetyTold
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.policy import judge
from chute_ros.supervisor.preflight import block_reasons, link_problem
from chute_ros.supervisor.readings import doubt, measured, unusable
from chute_ros.supervisor.rules import Rule
from chute_ros.supervisor.state import State
from chute_ros.supervisor.state_text import UNGUARDED, alarms, state_text

#: What a rule has in place of conditions that can never hold.
CANNOT_BE_FULFILLED = (
    "cannot be fulfilled: it needs a source besides the autopilot (imu or odometry in "
    "vehicle_sources)"
)


def state_message(config: SupervisorConfig, told: SafetyTold, stamp: Time) -> SafetyState:
    """safety/state."""
    state, now = told.state, told.now
    blocked = state.flight_blocked
    message = SafetyState(
        supervisor=told.supervisor,
        epoch=state.epoch,
        state=int(state.stage),
        state_text=state_text(config, state, told.reasons, now),
        mode=int(state.mode),
        flight_blocked=blocked,
        block_reasons=list(told.reasons) if blocked else [],
        device_blocks=sorted(state.device_blocks),
        alarms=list(told.alarms),
    )
    message.header.stamp = stamp
    for link in config.links:
        evidence = state.evidence(link)
        message.links.append(link)
        message.link_stamps.append(messages.stamp_of(told.stamps.get(link, 0)))
        message.link_states.append(int(evidence.judged(config.limits(link), now)))
        message.link_ages.append(now - evidence.heard)
        message.devices_healthy.append(evidence.device_healthy)
    message.rules = [_rule_message(config, state, rule, now) for rule in config.profile.rules]
    message.unusable = [
        f"{name}: {why}"
        for name in config.profile.limits
        if (why := unusable(config, state, name, now))
    ]
    if state.newest is not None:
        message.decision_id = state.newest.id
        message.decision_action = int(state.newest.action)
        message.decision_rule = state.newest.rule
    message.fired_id = told.fired
    return message


def summary_message(
    config: SupervisorConfig, told: SafetyTold, whole: SafetyState
) -> SafetySummary:
    """safety/summary. whole: the message of the same for safety/state."""
    state = told.state
    return SafetySummary(
        header=whole.header,
        supervisor=whole.supervisor,
        state=whole.state,
        state_name=state.stage.name,
        text=whole.state_text,
        mode=whole.mode,
        flight_blocked=whole.flight_blocked,
        armed=[" ".join(one) for one in state.armed()],
        released=[" ".join(one) for one in sorted(state.released_since_reset)],
        links_ok=sum(
            not link_problem(config, one, state.evidence(one), told.now) for one in config.links
        ),
        links=len(config.links),
        alarms=len(whole.alarms),
    )


def decisions_task(
    name: str, config: SupervisorConfig, state: State, now: float
) -> DiagnosticStatus:
    """The same in diagnostics."""
    reasons = block_reasons(config, state, now)
    text = state_text(config, state, reasons, now)
    level = diagnostics.OK
    if state.alarming.alarms or state.stage is Stage.FAULT or UNGUARDED in text:
        level = diagnostics.ERROR
    elif (
        reasons
        or alarms(config, state, now)
        or state.heard.disputed
        or state.mode is not Mode.ACTIVE
    ):
        level = diagnostics.WARN
        # In the air it takes nothing back that a take-off would be forbidden now.
        text += f": {'; '.join(reasons)}" if text == state.stage.name and reasons else ""
    values: dict[str, object] = {
        "state": state.stage.name,
        "mode": state.mode.name,
        "epoch": state.epoch,
        "decisions": state.next_id - 1,
        "profile": config.profile.name,
        "device requested a kill": ", ".join(state.asks),
        "sources contradict each other": ", ".join(sorted(state.heard.disputed)),
    }
    for link in config.links:
        evidence = state.evidence(link)
        values[f"{link}: link"] = evidence.judged(config.limits(link), now).name
        values[f"{link}: times lost"] = evidence.lost_count
        values[f"{link}: clock differs by (s)"] = evidence.clock_difference
        values[f"{link}: heartbeat age (s)"] = now - evidence.heard
        values[f"{link}: device healthy"] = evidence.device_healthy
    for rule in config.profile.rules:
        if rule.name in config.blind_rules:
            values[f"rule {rule.name}"] = CANNOT_BE_FULFILLED
            continue
        counted = state.rule(rule.name)
        latched = ", acted on" if counted.latched else ""
        values[f"rule {rule.name}"] = f"{counted.level:.2f} s of {rule.hold:g} s{latched}"
    for measurement in config.profile.limits:
        value = measured(config, state, measurement, now)
        why = unusable(config, state, measurement, now)
        in_doubt = doubt(state, measurement, value, now)
        told = f"{value:.2f} (in doubt: {in_doubt})" if in_doubt else f"{value:.2f}"
        values[measurement] = f"unusable: {why}" if why else told
    return diagnostics.status(name, "decisions", level, text, values, "")


def _rule_message(config: SupervisorConfig, state: State, rule: Rule, now: float) -> RuleState:
    if rule.name in config.blind_rules:
        return RuleState(
            name=rule.name,
            action=int(rule.action),
            hold=rule.hold,
            conditions=[CANNOT_BE_FULFILLED],
        )
    judged = judge(config, state, rule, now)
    counted = state.rule(rule.name)
    alive = state.stage in rule.states
    marks = {True: "[x]", False: "[ ]", None: "[?]"}
    return RuleState(
        name=rule.name,
        action=int(rule.action),
        alive=alive,
        fulfilled=alive and counted.fulfilled(rule),
        latched=counted.latched,
        level=counted.level,
        hold=rule.hold,
        conditions=[f"{marks[one.holds]} {one.text}" for one in judged.findings] if alive else [],
        denied=counted.denied,
    )
