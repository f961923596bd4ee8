"""When the core must look at the clock."""

from __future__ import annotations

import math

from chute_ros.supervisor import flight
from chute_ros.supervisor.blocking import ARMED_SHOWS, NOT_SEEN_AFTER
from chute_ros.supervisor.conditions.base import JUST_AFTER
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.deploying import release_due, step_deadline
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.policy import rule_deadlines
from chute_ros.supervisor.state import State


def next_deadline(config: SupervisorConfig, state: State, now: float) -> float:
    """When update has something to decide without any input, later than now; infinity: never."""
    deadlines: list[float] = []
    for link, evidence in state.heard.links.items():
        deadlines += evidence.deadlines(config.limits(link))
    if state.stage in (Stage.STARTUP, Stage.READY, Stage.ARMED, Stage.LANDED):
        since = state.heard.vehicle_received - state.heard.vehicle.armed_age
        # Just after the limit, which still counts as young enough.
        deadlines.append(math.nextafter(since + config.vehicle_state_age, math.inf) + JUST_AFTER)
    if state.stage in (Stage.READY, Stage.ARMED):
        deadlines += [state.stage_since + ARMED_SHOWS, state.stage_since + NOT_SEEN_AFTER]
    if state.stage is Stage.STARTUP:
        deadlines += [state.started_at + config.limits(one).startup_grace for one in config.links]
    if state.stage is Stage.DEPLOYED and state.own.deploy_tokens:
        deadlines.append(state.stage_since + config.report_wait)
    for pending in (state.block, state.killing.kill, *state.deploying.deploys):
        if pending is not None and pending.unreported():
            deadlines.append(pending.resend_at(config))
    if state.killing.kill is not None:
        deadlines.append(state.killing.kill.decided_at + config.kill_timeout)
    if state.stage is Stage.KILLING and state.deploying.deploy_rule:
        deadlines.append(release_due(config, state, now))
    if state.deploy is not None:
        deadlines.append(step_deadline(config, state, state.deploy))
    deadlines.append(state.alarming.alarm_at)
    if state.stage is Stage.FAULT:
        deadlines.append(state.stage_since + config.deploy_timeout)
    if state.flight.airborne:
        deadlines += [flight.landed_at(config, state), flight.rested_at(config, state)]
        if state.stage is Stage.KILLING:
            deadlines.append(flight.down_after_kill_at(config, state))
    deadlines += rule_deadlines(config, state, now)
    return min([deadline for deadline in deadlines if deadline > now], default=math.inf)
