"""The supervisor's core: one function of (state, inputs, now) to (state, outputs).

It fuses the heartbeats of all links and the measurements of the vehicle, blocks flight while a
required link is not healthy, counts the rules of its profile, and carries what they, a person or a
device want through to the devices: the kill first, then the deploy, step by step of its ladder,
until a device's own status confirms it. A fire command leaves only through sending.fire.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import MappingProxyType
from typing import Any

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.action_reports import take_action_report
from chute_ros.supervisor.airborne import check_vehicle, note_down, note_height
from chute_ros.supervisor.answers import answer_all
from chute_ros.supervisor.blocking import block_or_release, check_armed, check_links, tell_not_seen
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.deploying import check_deploy, check_kill, check_parachutes
from chute_ros.supervisor.link_reports import take_heartbeat, take_parachute
from chute_ros.supervisor.policy import check_rules, count_rules
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.requests import (
    arm_done,
    arm_request,
    block_request,
    deploy_request,
    kill_request,
    mode_request,
    reset_request,
)
from chute_ros.supervisor.sending import renew_not_begun, send_unreported
from chute_ros.supervisor.state import State
from chute_ros.supervisor.turn import Turn
from chute_ros.supervisor.vehicle_reports import take_vehicle
from chute_ros.supervisor.wakes import next_deadline

#: What people ask for, besides a kill, which devices want as well.
_PERSONS = (i.ArmRequest, i.DeployRequest, i.ResetRequest, i.ModeRequest)
#: A vehicle that nobody watched may have climbed as fast, m/s.
_CLIMBS_UNSEEN = 20.0


def update(
    config: SupervisorConfig, state: State, inputs: tuple[i.Input, ...], now: float
) -> tuple[State, tuple[i.Output, ...]]:
    """Take in what came since the last call, look at the clock, and decide."""
    # Time does not run backwards; a clock that says so is not followed. (NaN is never the larger.)
    now = max(now, state.own.updated_at)
    turn = Turn(config, state, now)
    _begin(turn)
    for one in inputs:
        _take(turn, one)
    _check(turn)
    turn.own = replace(turn.own, updated_at=now)
    return turn.state, tuple(turn.outputs)


def _begin(turn: Turn) -> None:
    """What time has done since the last update."""
    state = turn.state
    if math.isnan(state.own.updated_at):
        return
    passed = turn.now - state.own.updated_at
    # A deadline lies after the last update: none can be missed by more than what has passed.
    if passed > turn.config.late_after:
        late = turn.now - next_deadline(turn.config, state, state.own.updated_at)
        if late > turn.config.late_after:
            _was_late(turn, late, passed)
            passed -= late
    count_rules(turn, passed)


def _was_late(turn: Turn, late: float, passed: float) -> None:
    """While nobody listened, nobody was silent: what was sent meanwhile is still to come, and has
    as long for it as an update may be late. It comes one by one, and the first is not everybody's.
    """
    unheard = min(late + turn.config.late_after, passed)
    heard = {
        link: replace(evidence, heard=evidence.heard + unheard)
        for link, evidence in turn.heard.links.items()
    }
    rules = dict(turn.state.rules)
    # Full before a silence that was our own, they would fire at its first word.
    deaf = late >= turn.config.vehicle_state_age / 2.0
    for rule in turn.config.profile.rules if deaf else ():
        if not all(one.counted for one in rule.conditions) and rule.name in rules:
            rules[rule.name] = replace(rules[rule.name], level=0.0, holds=False, kept=())
    unseen = late * _CLIMBS_UNSEEN >= turn.config.profile.minimum_height
    turn.heard = replace(turn.heard, links=MappingProxyType(heard))
    turn.state = replace(turn.state, rules=MappingProxyType(rules))
    turn.own = replace(turn.own, late_count=turn.own.late_count + 1)
    turn.flight = replace(
        turn.flight,  # A height that can be used counts all the same.
        was_high=turn.flight.was_high or (turn.flight.airborne and unseen),
    )
    text = f"an update came {late:.2f} s late (limit {turn.config.late_after:g} s)"
    turn.warn(f"{text}: silence meanwhile does not count")


def _take(turn: Turn, one: i.Input) -> None:
    """One input, in the order in which it came. One that follows does nothing for people."""
    if not turn.own.leading and isinstance(one, _PERSONS):
        turn.finish(one.token, False, False, f"refused: {i.CALL_AGAIN}")
        return
    _HANDLERS[type(one)](turn, one)


def _take_over(turn: Turn, one: i.TakeOver) -> None:
    """What has not been begun is decided anew, so that no shot is lost; what a device has
    begun goes on there, so that there is no second one."""
    turn.own = replace(turn.own, leading=True)
    turn.state = replace(turn.state, epoch=one.epoch)
    # A parachute that this one has heard to be out is not ordered once more.
    check_parachutes(turn)
    renew_not_begun(turn, "decided anew by the supervisor that leads now")


def _step_down(turn: Turn, one: i.StepDown) -> None:
    answer_all(turn, f"{i.CALL_AGAIN}: {one.why}")
    turn.own = replace(turn.own, leading=False)


#: What is done with each kind of input.
_HANDLERS: dict[type[i.Input], Callable[[Turn, Any], None]] = {
    i.LinkHeartbeat: take_heartbeat,
    i.ParachuteReport: take_parachute,
    i.VehicleReport: take_vehicle,
    i.ActionReport: take_action_report,
    i.ArmRequest: arm_request,
    i.ArmDone: arm_done,
    i.KillRequest: kill_request,
    i.BlockRequest: block_request,
    i.DeployRequest: deploy_request,
    i.ResetRequest: reset_request,
    i.ModeRequest: mode_request,
    i.TakeOver: _take_over,
    i.StepDown: _step_down,
}


def _check(turn: Turn) -> None:
    """What follows from all that is known now. One that follows only counts: what it was
    told by the leader is what was decided."""
    if not turn.own.leading:
        note_down(turn)
        note_height(turn)
        check_rules(turn)
        return
    check_vehicle(turn)
    note_height(turn)
    check_parachutes(turn)
    check_rules(turn)
    check_armed(turn)
    # After the rules, of which one may block flight.
    check_links(turn)
    tell_not_seen(turn)
    check_kill(turn)
    check_deploy(turn)
    block_or_release(turn)
    send_unreported(turn)
