"""Kill and deploy as people, devices and rules order them: the kill first, each once. An order of
the same kind that is under way is joined."""

from __future__ import annotations

from chute_ros.model import Action, Armed, Outcome
from chute_ros.supervisor import flight, readings
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.answers import deploy_reached, end_kill
from chute_ros.supervisor.gate import OPERATOR, out_already, too_low
from chute_ros.supervisor.machine import ON_GROUND, Stage, StageEvent, listed
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.sending import fire, kill_failed
from chute_ros.supervisor.turn import Turn

#: What a vehicle says so soon after a kill was decided may be from before it, s.
_KILL_SETTLES = 0.2


def order_kill(
    turn: Turn, rule: str, reasons: tuple[str, ...], token: int = 0, kill_only: bool = False
) -> None:
    """Stop the motors. token not 0: a person waits for it, and kill_only says whether they
    want no deploy to follow it."""
    if turn.state.mode is not i.Mode.ACTIVE:
        fire(turn, Action.KILL, rule, reasons)
        return
    end_kill(turn)
    if token:
        turn.own = replace(turn.own, kill_tokens=(*turn.own.kill_tokens, token))
    # Beside an open canopy it changes nothing else; nor does it end what FAULT tries again.
    if turn.state.stage not in (Stage.DEPLOYED, Stage.FAULT):
        _to_killing(turn, "; ".join(reasons))
    if token:
        turn.killing = replace(turn.killing, kill_only=kill_only)
    if not _kill_joined(turn, token):
        fire(turn, Action.KILL, rule, reasons)


def order_deploy(turn: Turn, rule: str, reasons: tuple[str, ...]) -> None:
    """The kill first, unless one is on its way or confirmed; the deploy follows it."""
    if turn.state.mode is not i.Mode.ACTIVE:
        for action in (Action.KILL, Action.DEPLOY):
            fire(turn, action, rule, reasons)
        return
    again = turn.state.stage is Stage.DEPLOYED  # a person insists: another parachute
    if turn.deploying.deploy_rule:
        _join_deploy(turn, rule, reasons)
        return
    if deploy_reached(turn, Outcome.CONFIRMED) and not again:
        return  # out already, which is said at the end of this update
    all_out = all(out_already(turn.state, rung) for rung in turn.config.ladder)
    if again and rule != OPERATOR and all_out:
        text = f"the canopy does not carry, and no other is left: {'; '.join(reasons)}"
        turn.alarm(text)
        alarm_at = turn.now + turn.config.alarm_interval
        turn.alarming = replace(turn.alarming, canopy_fails=True, alarm_at=alarm_at)
        return
    if turn.state.stage in ON_GROUND or again:
        note_released(turn)
    end_kill(turn)
    kill, since = turn.killing.kill, turn.now
    if turn.state.stage is Stage.KILLING and _kill_under_way(turn):
        assert kill is not None
        since = kill.decided_at
    elif (
        turn.state.stage is not Stage.KILLING
        or kill is None
        or not kill.confirmed
        or armed_since(turn, kill)
    ):
        _to_killing(turn, "; ".join(reasons))
        fire(turn, Action.KILL, rule, reasons)
    still_in = tuple(r for r in turn.config.ladder if not out_already(turn.state, r))
    turn.deploying = replace(
        turn.deploying,
        deploy_rule=rule,
        deploy_reasons=reasons,
        deploy_due=since + turn.config.kill_to_deploy_delay,
        # Where all are out as far as is known, none of them is trusted to be.
        deploy_ladder=still_in,
        deploys=(),
        deploy_height=readings.measured(turn.config, turn.state, "height", turn.now),
    )


def _join_deploy(turn: Turn, rule: str, reasons: tuple[str, ...]) -> None:
    """A rule's deploy that a person wants as well is theirs: no height holds it back."""
    if rule == OPERATOR and turn.deploying.deploy_rule != OPERATOR:
        both = (*turn.deploying.deploy_reasons, *reasons)
        turn.deploying = replace(turn.deploying, deploy_rule=rule, deploy_reasons=both)


def _to_killing(turn: Turn, why: str) -> None:
    if listed(turn.state.stage, StageEvent.KILL):
        if turn.state.stage is not Stage.KILLING:
            stood = flight.down_undisputed(turn.config, turn.state, turn.now) or flight.disarmed(
                turn.config, turn.state, turn.now
            )
            sinking = -readings.measured(turn.config, turn.state, "vertical_speed", turn.now)
            turn.killing = replace(
                turn.killing,
                kill_only=False,
                killed_in_flight=turn.flight.airborne,
                killed_standing=stood,
                killed_low=bool(too_low(turn.config, turn.state, turn.now)),
                killed_at=turn.now,
                killed_height=readings.measured(turn.config, turn.state, "height", turn.now),
                killed_sinking=max(sinking, 0.0),
            )
        turn.move(StageEvent.KILL, why)


def _kill_under_way(turn: Turn) -> bool:
    """A kill is on its way and may still be confirmed."""
    kill = turn.killing.kill
    return kill is not None and not kill.confirmed and not kill_failed(turn, kill)


def _kill_joined(turn: Turn, token: int) -> bool:
    """Does a kill that was decided already serve this request?

    A person who asks after the confirmation sees motors that turn, and is obeyed again. A
    device repeats itself; that must not become a new decision each time.
    """
    kill = turn.killing.kill
    if token or kill is None or _kill_under_way(turn):
        return _kill_under_way(turn)
    if kill.confirmed and armed_since(turn, kill):
        return False
    wait = turn.config.kill_timeout if kill.confirmed else turn.config.resend_interval
    return turn.now < kill.decided_at + wait


def armed_since(turn: Turn, kill: Pending) -> bool:
    """The vehicle says, and said after this kill had its time, that it is armed (again)."""
    said_at = turn.heard.vehicle_received - turn.heard.vehicle.armed_age
    said = flight.armed(turn.config, turn.state, turn.now)
    return said is Armed.ARMED and said_at > kill.decided_at + _KILL_SETTLES


def note_released(turn: Turn) -> None:
    """What is released now was so before the flight and says nothing of what happens in it."""
    before = turn.flight.released_before | turn.state.released(turn.config)
    turn.flight = replace(turn.flight, released_before=before)
