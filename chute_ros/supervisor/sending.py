"""Decisions on their way: made, published, sent again under the same number or a new one."""

from __future__ import annotations

from typing import Literal

from chute_ros.model import Action, Decision
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.turn import Turn

#: A decision that may be on its way; a number is that of the deploy's step, from 0.
Slot = Literal["block", "kill"] | int


def slots(turn: Turn) -> tuple[Slot, ...]:
    """Every decision that may be on its way."""
    return ("block", "kill", *range(len(turn.deploying.deploys)))


def fire(turn: Turn, action: Action, rule: str, reasons: tuple[str, ...]) -> None:
    """The only place from which a kill or a deploy leaves. Default is deny."""
    state = turn.state
    if not state.own.leading or state.mode is i.Mode.INHIBITED:
        return
    if state.mode is i.Mode.SHADOW:
        only_say(turn, action, rule, reasons)
    elif action is Action.KILL:
        decide(turn, "kill", action, rule, reasons, turn.config.kill_links)
    elif state.stage is Stage.DEPLOYING and state.killing.kill is not None:
        step = len(state.deploying.deploys)
        if step < len(turn.ladder) and not any(d.confirmed for d in state.deploying.deploys):
            rung = turn.ladder[step]
            decide(turn, step, action, rule, reasons, (rung.link,), rung.device)


def only_say(turn: Turn, action: Action, rule: str, reasons: tuple[str, ...]) -> None:
    """In SHADOW a kill or a deploy is published as what would have been done; nobody carries
    it out, so nothing is awaited."""
    first = turn.config.ladder[0]
    links = turn.config.kill_links if action is Action.KILL else (first.link,)
    device = "" if action is Action.KILL else first.device
    publish(turn, action, rule, reasons, links, device)


def publish(
    turn: Turn,
    action: Action,
    rule: str,
    reasons: tuple[str, ...],
    targets: tuple[str, ...],
    device: str,
) -> Decision:
    """A new decision under the next number, in SHADOW only as what would have been done."""
    state = turn.state
    shadow = state.mode is i.Mode.SHADOW
    decision = Decision(state.epoch, state.next_id, action, rule, reasons, targets, shadow, device)
    turn.outputs.append(i.Decide(decision))
    turn.state = replace(state, next_id=state.next_id + 1, newest=decision)
    return decision


def decide(
    turn: Turn,
    slot: Slot,
    action: Action,
    rule: str,
    reasons: tuple[str, ...],
    targets: tuple[str, ...],
    device: str = "",
) -> None:
    """Publish a new decision and await what comes of it."""
    decision = publish(turn, action, rule, reasons, targets, device)
    put(turn, slot, Pending(decision, targets, turn.now, turn.now))


def wanted(turn: Turn, slot: Slot) -> bool:
    """Does the present stage still want what is in this slot carried out?

    A deploy that failed before is not tried again because a node restarts on the ground, and
    a flight block must not overtake a kill or a deploy that is on its way.
    """
    stage = turn.state.stage
    if slot == "block":
        under_way = stage is Stage.KILLING and (
            turn.killing.killed_in_flight or bool(turn.deploying.deploy_rule)
        )
        return stage is not Stage.DEPLOYING and not under_way
    if slot == "kill":
        if turn.deploying.deploy_rule or stage is Stage.DEPLOYED:
            return stage in (Stage.KILLING, Stage.DEPLOYING, Stage.DEPLOYED)
        # One that failed long ago is not what a node that is back must do.
        kill = turn.killing.kill
        young = kill is not None and kill_can_help(turn, kill)
        return young and stage in (Stage.KILLING, Stage.DEPLOYING, Stage.FAULT)
    return stage is Stage.DEPLOYING


def renew(turn: Turn, slot: Slot, why: str) -> None:
    """Decide again, under a new number, what is still to be carried out."""
    pending = pending_in(turn, slot)
    if pending is None or not wanted(turn, slot) or not turn.own.leading:
        return
    if pending.confirmed and slot != "block":
        return
    new = _under_new_number(turn, slot, pending, pending.targets, why)
    # The time since the first decision goes on counting towards its limits.
    new = replace(new, decided_at=pending.decided_at, given_up=pending.given_up)
    put(turn, slot, new)


def renew_not_begun(turn: Turn, why: str) -> None:
    """Decide again what not every target has begun with: it goes on where it was begun, and a
    second order would start it again."""
    for slot in slots(turn):
        pending = pending_in(turn, slot)
        if pending is not None and (slot == "block" or pending.not_begun()):
            renew(turn, slot, why)


def renew_missing(turn: Turn, slot: Slot, why: str) -> None:
    """The same under a new number, to those that have not reported; what is known stays."""
    pending = pending_in(turn, slot)
    assert pending is not None
    if not turn.own.leading:
        return
    new = _under_new_number(turn, slot, pending, pending.unreported(), why)
    earlier = pending.earlier | {pending.number}
    renewed = replace(pending, decision=new.decision, earlier=earlier, sent_at=turn.now)
    put(turn, slot, renewed)


def _under_new_number(
    turn: Turn, slot: Slot, pending: Pending, targets: tuple[str, ...], why: str
) -> Pending:
    d = pending.decision
    reasons = d.reasons if why in d.reasons else (*d.reasons, why)
    decide(turn, slot, d.action, d.rule, reasons, targets, d.device)
    renewed = pending_in(turn, slot)
    assert renewed is not None
    return renewed


def send_again(turn: Turn, slot: Slot) -> None:
    """The same decision once more: its number lets a node that knows it do nothing."""
    pending = pending_in(turn, slot)
    assert pending is not None
    turn.outputs.append(i.Decide(pending.decision, again=True))
    put(turn, slot, replace(pending, sent_at=turn.now))


def send_unreported(turn: Turn) -> None:
    """Send again what is due of what nobody has reported on."""
    waiting = {slot: one for slot in slots(turn) if (one := _unheard(turn, slot)) is not None}
    due = {slot for slot, one in waiting.items() if turn.now >= one.resend_at(turn.config)}
    # A node that is started anew must not see the deploy first.
    kill_too = any(isinstance(slot, int) for slot in due)
    for slot in waiting:
        if slot in due or (slot == "kill" and kill_too):
            send_again(turn, slot)


def _unheard(turn: Turn, slot: Slot) -> Pending | None:
    """What is on its way, and worth to be sent again."""
    one = pending_in(turn, slot)
    heard = one is None or one.decision.shadow or not worth_sending(turn, one)
    return None if heard else one


def worth_sending(turn: Turn, pending: Pending) -> bool:
    """Somebody has not reported: a node that is alive, or any while it can still help."""
    action = pending.decision.action
    if action is Action.DEPLOY:
        # It ends with the stage, by its limit or because a parachute is out.
        return turn.state.stage is Stage.DEPLOYING and bool(pending.unreported())
    if action is Action.KILL:
        return kill_can_help(turn, pending) and bool(pending.unreported())
    return any(
        not turn.state.evidence(link).silent(turn.config.limits(link).lost_after, turn.now)
        for link in pending.unreported()
    )


def pending_in(turn: Turn, slot: Slot) -> Pending | None:
    """The decision in this slot."""
    if slot == "block":
        return turn.state.block
    return turn.killing.kill if slot == "kill" else turn.deploying.deploys[slot]


def put(turn: Turn, slot: Slot, pending: Pending) -> None:
    """Remember a decision."""
    if slot == "block":
        turn.state = replace(turn.state, block=pending)
    elif slot == "kill":
        turn.killing = replace(turn.killing, kill=pending)
    else:
        deploys = turn.deploying.deploys
        turn.deploying = replace(
            turn.deploying, deploys=(*deploys[:slot], pending, *deploys[slot + 1 :])
        )


def kill_failed(turn: Turn, kill: Pending) -> bool:
    """Nobody has confirmed it, and nobody is expected to any more."""
    late = turn.now >= kill.decided_at + turn.config.kill_timeout
    return not kill.confirmed and (late or kill.all_failed())


def kill_can_help(turn: Turn, kill: Pending) -> bool:
    """It was decided so short a time ago that it is still meant."""
    limit = max(turn.config.kill_timeout, turn.config.deploy_timeout)
    return turn.now < kill.decided_at + limit
