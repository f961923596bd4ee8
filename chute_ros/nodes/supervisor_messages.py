"""The supervisor's picture as it is published: safety/state and /diagnostics."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from chute_msgs.msg import SafetyState
from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.nodes import diagnostics
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import block_reasons
from chute_ros.supervisor.state import LinkEvidence, State


def state_message(config: SupervisorConfig, state: State, now: float, stamp: Time) -> SafetyState:
    """safety/state at now."""
    reasons = block_reasons(config, state, now)
    blocked = _flight_blocked(state)
    message = SafetyState(
        epoch=state.epoch,
        state=int(state.stage),
        state_text=_text(state, reasons),
        mode=int(state.mode),
        flight_blocked=blocked,
        block_reasons=list(reasons) if blocked else [],
        device_blocks=sorted(state.device_blocks),
        alarms=list(state.alarms),
    )
    message.header.stamp = stamp
    for link in config.links:
        evidence = state.links.get(link, LinkEvidence())
        message.links.append(link)
        message.link_states.append(int(evidence.state(config, now)))
        message.link_ages.append(now - evidence.heard)
        message.devices_healthy.append(evidence.device_healthy)
    newest = max(
        (p.decision for p in (state.block, state.kill, state.deploy) if p is not None),
        key=lambda decision: decision.id,
        default=None,
    )
    if newest is not None:
        message.decision_id = newest.id
        message.decision_action = int(newest.action)
        message.decision_rule = newest.rule
    return message


def decisions_task(
    name: str, config: SupervisorConfig, state: State, now: float, heartbeat_late: float
) -> DiagnosticStatus:
    """The same in diagnostics. heartbeat_late: how late the newest own heartbeat was, s."""
    reasons = block_reasons(config, state, now)
    level = diagnostics.OK
    if state.alarms or state.stage is Stage.FAULT:
        level = diagnostics.ERROR
    elif reasons:
        level = diagnostics.WARN
    values: dict[str, object] = {
        "state": state.stage.name,
        "mode": state.mode.name,
        "epoch": state.epoch,
        "decisions": state.next_id - 1,
        "newest heartbeat late by (s)": heartbeat_late,
    }
    for link in config.links:
        evidence = state.links.get(link, LinkEvidence())
        values[f"{link}: link"] = evidence.state(config, now).name
        values[f"{link}: heartbeat age (s)"] = now - evidence.heard
        values[f"{link}: device healthy"] = evidence.device_healthy
    return diagnostics.status(name, "decisions", level, _text(state, reasons), values, "")


def _flight_blocked(state: State) -> bool:
    if state.block is None or state.block.decision.shadow:
        return False
    return state.block.decision.action is model.Action.FLIGHT_BLOCK


def _text(state: State, reasons: tuple[str, ...]) -> str:
    if state.stage in (Stage.STARTUP, Stage.BLOCKED) and reasons:
        return f"{state.stage.name}: {'; '.join(reasons)}"
    if state.alarms:
        return f"{state.stage.name}: {state.alarms[-1]}"
    return state.stage.name
