"""What people and devices ask of the supervisor, and what it answers at once.

Every request with a token is answered exactly once, now or when its outcome is known.
"""

from __future__ import annotations

import math
from types import MappingProxyType

from chute_ros.model import Action
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.answers import give_up_waiting
from chute_ros.supervisor.gate import OPERATOR, against_person
from chute_ros.supervisor.machine import ON_GROUND, Stage, StageEvent, listed
from chute_ros.supervisor.orders import note_released, order_deploy, order_kill
from chute_ros.supervisor.pending import Ask
from chute_ros.supervisor.preflight import arm_reasons
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.sending import decide
from chute_ros.supervisor.turn import Turn

#: Devices whose wish to block flight is remembered: made-up names must not grow us.
MOST_DEVICE_BLOCKS = 64


def arm_request(turn: Turn, one: i.ArmRequest) -> None:
    """Arming needs every pre-flight check; disarming only the ground."""
    if one.arm:
        wrong = "; ".join(arm_reasons(turn.config, turn.state, one.day, turn.now))
    else:
        wrong = _against_disarming(turn)
    if wrong:
        turn.finish(one.token, False, False, "refused: " + wrong)
    else:
        links = turn.config.deploy_links
        turn.outputs.append(i.ArmDevices(one.token, one.arm, one.triggers, links))


def arm_done(turn: Turn, one: i.ArmDone) -> None:
    """The device nodes have answered."""
    event = StageEvent.ARMED if one.arm else StageEvent.DISARMED
    if one.success and listed(turn.state.stage, event):
        turn.move(event)
    if one.success:
        turn.flight = replace(turn.flight, armed_on_ground=one.arm)
    elif not one.token:
        turn.alarm(f"the parachutes are not disarmed after the flight: {one.message}")
    turn.finish(one.token, one.success, one.success, one.message)


def kill_request(turn: Turn, one: i.KillRequest) -> None:
    """A person's is never refused while ACTIVE; a device's is evidence for the rules."""
    reason = f"{one.by}: {one.reason}"
    if not one.token:
        _device_asks(turn, one)
        return
    if not turn.own.leading:
        turn.finish(one.token, False, False, f"refused: {i.CALL_AGAIN}")
        return
    order_kill(turn, one.by, (reason,), one.token, one.kill_only)
    if turn.state.mode is not i.Mode.ACTIVE:
        _nothing_sent(turn, one.token)


def _device_asks(turn: Turn, one: i.KillRequest) -> None:
    asks = turn.state.asking(turn.now)
    if one.by in asks or len(asks) < MOST_DEVICE_BLOCKS:
        asks[one.by] = Ask(turn.now, one.by.partition(" ")[0], one.reason)
    rules = dict(turn.state.rules)
    for rule in turn.config.profile.rules:
        # Asked anew is a new occasion, whatever became of the last.
        if rule.asks_for_a_kill:
            rules[rule.name] = replace(turn.state.rule(rule.name), latched=False)
    turn.state = replace(turn.state, asks=MappingProxyType(asks), rules=MappingProxyType(rules))


def block_request(turn: Turn, one: i.BlockRequest) -> None:
    """Blocks flight on the ground as an unhealthy link does; in the air it is remembered."""
    blocks, device = dict(turn.state.device_blocks), f"{one.link} {one.device}".strip()
    if not one.block:
        blocks.pop(device, None)
    elif device in blocks or len(blocks) < MOST_DEVICE_BLOCKS:
        blocks[device] = one.reason or "no reason given"
    elif not turn.state.block_refused:
        turn.state = replace(turn.state, block_refused=True)
        text = f"not remembered, {len(blocks)} devices do already"
        turn.warn(f"{device} asks to block flight: {text}")
    if blocks != turn.state.device_blocks:
        full = turn.state.block_refused and len(blocks) >= MOST_DEVICE_BLOCKS
        kept = MappingProxyType(blocks)
        turn.state = replace(turn.state, device_blocks=kept, block_refused=full)


def deploy_request(turn: Turn, one: i.DeployRequest) -> None:
    """Refused on the ground unless forced; one that is under way is joined."""
    wrong = against_person(turn.config, turn.state, one.force, turn.now)
    reason = f"operator{', forced' if one.force else ''}: {one.reason or 'no reason given'}"
    if turn.state.mode is not i.Mode.ACTIVE:
        # Whatever else is against it: no force sends anything in this mode.
        if not wrong:
            order_deploy(turn, OPERATOR, (reason,))
        _nothing_sent(turn, one.token)
    elif wrong:
        turn.finish(one.token, False, False, "refused: " + wrong)
    else:
        tokens = (*turn.own.deploy_tokens, one.token)
        turn.own = replace(turn.own, deploy_tokens=tokens)
        order_deploy(turn, OPERATOR, (reason,))


def reset_request(turn: Turn, one: i.ResetRequest) -> None:
    """Back to the start, on the ground only."""
    stage = turn.state.stage
    in_air = flight.in_air(turn.config, turn.state, turn.now)
    if in_air and flight.says_air_in_vain(turn.config, turn.state, turn.now):
        in_air = False
    if in_air or (in_air is None and stage is Stage.IN_FLIGHT):
        why = (
            "is in the air" if in_air else "was in the air, and nothing fresh says that it is down"
        )
        text = f"refused: the vehicle {why}"
        if in_air is None or flight.is_still(turn.config, turn.state, turn.now):
            text += "; if it lies still: safety/kill (kill_only), and this again after "
            text += f"{flight.STILL_FOR:g} s"
        elif flight.says_rests(turn.config, turn.state, turn.now):
            text += "; it says that it stands with its motors off, and moves by its estimator: "
            text += f"this again after {flight.RESTS_FOR:g} s of that"
        turn.finish(one.token, False, False, text)
    elif in_air is None and turn.deploying.deploy_rule:
        text = "refused: a deploy is under way and nothing fresh says that it is on the ground"
        turn.finish(one.token, False, False, text)
    elif not listed(stage, StageEvent.RESET):
        turn.finish(one.token, False, False, f"refused: the vehicle is {stage.name}")
    else:
        give_up_waiting(turn, "reset by a person")
        turn.move(StageEvent.RESET)
        turn.state = replace(
            turn.state,
            started_at=turn.now,
            block=None,
            rules=MappingProxyType({}),
            asks=MappingProxyType({}),
            # A device that still wants it asks again; one that was exchanged cannot.
            device_blocks=MappingProxyType({}),
            released_since_reset=frozenset(),
            last_armed=_armed_still(turn),
        )
        turn.killing = replace(turn.killing, kill=None, killed_in_flight=False, kill_only=False)
        turn.deploying = replace(turn.deploying, deploys=())
        turn.flight = replace(turn.flight, flown=False, airborne=False, rebooted=False)
        turn.alarming = replace(turn.alarming, alarms=(), alarm_at=math.nan, canopy_fails=False)
        note_released(turn)
        turn.finish(one.token, True, True, "back to the start")


def _armed_still(turn: Turn) -> frozenset[tuple[str, str]]:
    """Without those that were exchanged while they were armed, which cannot say otherwise."""
    state, links = turn.state, turn.config.deploy_links
    silent = {link for link in links if not state.hears(turn.config, link, turn.now)}
    return frozenset(one for one in state.last_armed if one[0] in silent or state.receives(*one))


def mode_request(turn: Turn, one: i.ModeRequest) -> None:
    """In flight only with force. Whoever leaves ACTIVE takes its flight block back first."""
    before, stage = turn.state.mode, turn.state.stage
    if one.mode is before:
        turn.finish(one.token, True, True, f"mode is {before.name} already")
        return
    if stage not in ON_GROUND and not one.force:
        text = f"refused: the vehicle is {stage.name}; force changes it all the same"
        turn.finish(one.token, False, False, text)
        return
    if before is i.Mode.ACTIVE:
        give_up_waiting(turn, f"mode changed to {one.mode.name}")
        turn.killing = replace(turn.killing, kill=None)
        turn.deploying = replace(turn.deploying, deploys=())
        if stage is Stage.DEPLOYING:
            # What is judged anew must find a stage in which the rules live.
            turn.move(StageEvent.MODE_CHANGED)
        block = turn.state.block
        if block is not None and (
            block.decision.action is Action.FLIGHT_BLOCK or block.unreported()
        ):
            reasons = (f"mode changes from ACTIVE to {one.mode.name}",)
            release = Action.FLIGHT_BLOCK_RELEASE
            decide(turn, "block", release, "mode", reasons, turn.config.links)
        else:
            turn.state = replace(turn.state, block=None)
    else:
        # What was said in the other mode was not sent; what holds now is decided anew.
        turn.state = replace(turn.state, block=None)
    why = one.reason or "no reason given"
    turn.log(f"mode {before.name} -> {one.mode.name} ({why})")
    # What was only said in one mode is done in the other.
    turn.state = replace(turn.state, mode=one.mode, rules=MappingProxyType({}))
    turn.finish(one.token, True, True, f"mode {one.mode.name}")


def _against_disarming(turn: Turn) -> str:
    """Why the parachute is not disarmed; empty: it is on the ground, no deploy on its way."""
    stage = turn.state.stage
    down = flight.in_air(turn.config, turn.state, turn.now) is False
    if stage in ON_GROUND or (down and not turn.deploying.deploy_rule):
        return ""
    return f"the vehicle is {stage.name}: not disarmed in flight"


def _nothing_sent(turn: Turn, token: int) -> None:
    text = f"refused: mode is {turn.state.mode.name}; nothing is sent"
    turn.finish(token, False, False, text)
