"""The deploy as it goes on: it waits for the kill, climbs its ladder, ends with a confirmation."""

from __future__ import annotations

from chute_ros.model import Action, Armed, Outcome
from chute_ros.supervisor import flight, readings
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.answers import deploy_details, deploy_reached, end_kill, finish_deploy
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.gate import OPERATOR, too_low
from chute_ros.supervisor.machine import Stage, StageEvent, listed
from chute_ros.supervisor.orders import armed_since, order_deploy, order_kill
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.policy import put_off
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.sending import fire, send_again
from chute_ros.supervisor.state import State
from chute_ros.supervisor.turn import Turn


def step_deadline(config: SupervisorConfig, state: State, step: Pending) -> float:
    """When the newest step of the ladder is given up, monotonic s."""
    if len(state.deploying.deploys) >= len(state.ladder(config)):
        return step.decided_at + config.deploy_timeout
    return step.decided_at + config.ladder_step_timeout


def release_due(config: SupervisorConfig, state: State, now: float) -> float:
    """When a deploy that waits for its kill waits no longer, monotonic s. Sooner where the vehicle
    is low: lines above motors that may still turn are a risk, the ground that comes first is none.
    That it falls on unheard is assumed only where a rule that deploys has acted."""
    if state.killing.kill is None:
        return state.deploying.deploy_due
    deploys = (one.name for one in config.profile.rules if one.action is Action.DEPLOY)
    falls = any(state.rule(name).latched for name in deploys)
    low = flight.low_at(config, state, falls, now)
    soonest = state.killing.kill.decided_at + config.low_kill_to_deploy_delay
    return min(state.deploying.deploy_due, max(low, soonest))


def check_parachutes(turn: Turn) -> None:
    """One that says that it is released ends every deploy, whoever fired it."""
    out = sorted(turn.state.newly_released(turn.config, turn.now))
    if out and listed(turn.state.stage, StageEvent.PARACHUTE_OPEN):
        said = f"{', '.join(map(' '.join, out))} says deployed"
        _note_open(turn, said)


def _note_open(turn: Turn, why: str) -> None:
    turn.move(StageEvent.PARACHUTE_OPEN, why)
    height = readings.measured(turn.config, turn.state, "height", turn.now)
    turn.deploying = replace(turn.deploying, deploy_height=height)


def check_kill(turn: Turn) -> None:
    """The deploy follows the kill's confirmation, or its delay."""
    kill = turn.killing.kill
    if kill is None:
        return
    end_kill(turn)
    if turn.state.stage is Stage.DEPLOYED and turn.flight.airborne:
        _kill_again(turn, kill)
    if turn.state.stage is not Stage.KILLING or not turn.deploying.deploy_rule:
        return
    if kill.confirmed or turn.now >= release_due(turn.config, turn.state, turn.now):
        low = too_low(turn.config, turn.state, turn.now)
        if low and turn.deploying.deploy_rule != OPERATOR:
            # It was high enough when the kill left; a canopy needs the height now.
            turn.alarm(f"no deploy by rule '{turn.deploying.deploy_rule}' after the kill: {low}")
            put_off(turn, turn.deploying.deploy_rule)
            # Nobody waits for it: a person's is held back by no height.
            turn.deploying = replace(turn.deploying, deploy_rule="", deploy_reasons=())
            return
        if kill.unreported():
            # A node that misses the kill must not see the deploy first: it would refuse the
            # kill as older from then on.
            send_again(turn, "kill")
        before = turn.before.killing.kill
        if kill.confirmed and before is not None and before.confirmed:
            why = told = "kill confirmed before this deploy was wanted"
        else:
            waited = turn.now - kill.decided_at
            why = f"kill {'confirmed' if kill.confirmed else 'not confirmed'} after {waited:.2f} s"
            told = f"{why} ({_limit(turn, kill)})"
        turn.move(StageEvent.DEPLOY_DUE, why)
        launches = _own_launch_first(turn)
        _fire(turn, f"{told}; {launches}" if launches else told)


def _own_launch_first(turn: Turn) -> str:
    """A device asks for the kill before it launches by itself: its step is the first, so that no
    other canopy comes out beside its own. Returns that in words; empty: it is as configured."""
    asking = {who: ask.link for who, ask in turn.state.asking(turn.now).items()}
    named = [rung for rung in turn.ladder if f"{rung.link} {rung.device}" in asking]
    chosen = [rung for rung in turn.ladder if not rung.device and rung.link in asking.values()]
    launch = named or chosen
    ladder = (*launch, *(rung for rung in turn.ladder if rung not in launch))
    if ladder == turn.ladder:
        return ""
    turn.deploying = replace(turn.deploying, deploy_ladder=ladder)
    return f"{', '.join(asking)} asks for the kill to launch by itself: its step is the first"


def _kill_again(turn: Turn, kill: Pending) -> None:
    """Motors that were off, and armed again by anybody: they wind up the canopy's lines. (An
    autopilot that terminates the flight may say ARMED all the time.)"""
    was_off = turn.before.heard.vehicle.armed is Armed.DISARMED
    if was_off and kill.confirmed and armed_since(turn, kill):
        why = "the motors were armed again under a canopy that is out"
        turn.alarm(f"{why}: they are stopped again")
        order_kill(turn, "armed under the canopy", (why,))


def _limit(turn: Turn, kill: Pending) -> str:
    """For how long this deploy waits for its kill, in words."""
    config, height = turn.config, turn.state.measured("height")
    low = release_due(config, turn.state, turn.now) < turn.deploying.deploy_due
    if kill.confirmed or not low:
        return f"limit {config.kill_to_deploy_delay:g} s"
    told = f"{height.value:.1f} m reported {turn.now - height.measured_at:.2f} s ago"
    limit = f"limit {config.low_kill_to_deploy_delay:g} s below {config.profile.low_height:g} m"
    return f"{limit}: {told}"


def check_deploy(turn: Turn) -> None:
    """Confirmed, one step further, or at the end of the ladder."""
    confirmed = deploy_reached(turn, Outcome.CONFIRMED)
    # Also while somebody kills once more after the ladder's end.
    if confirmed and turn.state.stage in (Stage.KILLING, Stage.DEPLOYING, Stage.FAULT):
        _note_open(turn, deploy_details(turn))
    elif turn.state.stage is Stage.DEPLOYING and turn.deploying.deploys:
        _climb(turn)
    elif turn.state.stage is Stage.FAULT:
        _try_again(turn)
    _answer(turn)
    _alarm_again(turn)


def _try_again(turn: Turn) -> None:
    """As long as it is in the air, whoever could not be reached may be now. A device that has
    confirmed is not among them."""
    since = turn.state.stage_since
    back = any(turn.state.evidence(rung.link).regained_at > since for rung in turn.ladder)
    over = back or turn.now >= since + turn.config.deploy_timeout
    deploys = turn.deploying.deploys
    if over and _still_in_air(turn) and deploys and turn.state.mode is i.Mode.ACTIVE:
        rule = deploys[0].decision.rule
        if rule != OPERATOR and too_low(turn.config, turn.state, turn.now):
            return
        waited = turn.now - turn.state.stage_since
        why = f"tried again {waited:.1f} s after the ladder's end: it is still in the air"
        order_deploy(turn, rule, (why,))


def _still_in_air(turn: Turn) -> bool:
    """As the autopilot says; where it is silent, because it moves as nothing on the ground."""
    in_air = flight.in_air(turn.config, turn.state, turn.now)
    moves = flight.moving(turn.config, turn.state, turn.now)
    return bool(in_air or (in_air is None and turn.flight.airborne and moves))


def _climb(turn: Turn) -> None:
    """Step by step, each with its limit. One whose node is silent is sent, not awaited."""
    for _ in turn.ladder:
        step = turn.deploying.deploys[-1]
        text = step.newest_details() or "no device node reported"
        waited = turn.now - step.decided_at
        last = len(turn.deploying.deploys) >= len(turn.ladder)
        silent = all(
            turn.state.evidence(link).silent(turn.config.limits(link).lost_after, turn.now)
            for link in step.targets
        )
        over = step.all_failed() or turn.now >= step_deadline(turn.config, turn.state, step)
        # What refuses may yet do it, and the next step need not wait for that.
        over |= not last and step.all_refused()
        unconfirmable = last and step.all_sent() and all(map(turn.state.unmonitored, step.targets))
        over |= unconfirmable
        if not over and (last or not silent):
            return
        if last:
            first = turn.deploying.deploys[0].decided_at
            turn.move(StageEvent.DEPLOY_FAILED, text)
            limit = "and none can be" if unconfirmable else f"within {turn.now - first:.1f} s"
            turn.alarm(f"no parachute confirmed {limit}: {text}")
            alarm_at = turn.now + turn.config.alarm_interval
            turn.alarming = replace(turn.alarming, alarm_at=alarm_at)
            return
        number = len(turn.deploying.deploys)
        rung = turn.ladder[number - 1]
        why = "its node is silent" if silent and not over else f"not confirmed: {text}"
        _fire(turn, f"step {number} of {len(turn.ladder)}, {rung}: {why} ({waited:.2f} s)")


def _fire(turn: Turn, why: str) -> None:
    fire(turn, Action.DEPLOY, turn.deploying.deploy_rule, (*turn.deploying.deploy_reasons, why))


def _answer(turn: Turn) -> None:
    accepted, text = deploy_reached(turn, Outcome.ACCEPTED), deploy_details(turn)
    out = turn.state.stage is Stage.DEPLOYED
    text = text or ("its own status says deployed" if out else "no device node reported")
    kill = turn.killing.kill
    if kill is not None and not kill.confirmed:
        why = kill.newest_details() or "nobody reported"
        text = f"WARNING, the motors may still turn ({why}): {text}"
    if turn.state.stage is Stage.FAULT:
        finish_deploy(turn, False, accepted, text)
    elif turn.state.stage is Stage.DEPLOYED:
        reported = not turn.deploying.deploys or deploy_reached(turn, Outcome.CONFIRMED)
        waited = turn.now >= turn.state.stage_since + turn.config.report_wait
        if reported or waited or not turn.own.deploy_tokens:
            finish_deploy(turn, True, accepted, text)


def _alarm_again(turn: Turn) -> None:
    """The end of the ladder without a parachute is an alarm that does not stop until one is
    out or a person resets, whatever is tried meanwhile; so is a canopy that does not carry."""
    out = turn.state.stage is Stage.DEPLOYED
    if (not out or turn.alarming.canopy_fails) and turn.now >= turn.alarming.alarm_at:
        # A state that was handed over or read from a black box may know of no alarm.
        begin = "the canopy does not carry" if out else "still no parachute confirmed"
        text = ": ".join((begin, *turn.alarming.alarms[-1:]))
        turn.warn(text)
        alarm_at = turn.now + turn.config.alarm_interval
        turn.alarming = replace(turn.alarming, alarm_at=alarm_at)
