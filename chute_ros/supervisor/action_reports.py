"""How far a node got with a decision, and which is the newest that it knows."""

from __future__ import annotations

from types import MappingProxyType

from chute_ros.model import Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.epochs import LARGEST_EPOCH, RANKS, epoch_above
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.sending import (
    pending_in,
    put,
    renew_missing,
    renew_not_begun,
    slots,
    wanted,
)
from chute_ros.supervisor.turn import Turn


def take_action_report(turn: Turn, one: i.ActionReport) -> None:
    """How far a node got with a decision, and which is the newest that it knows."""
    if one.link not in turn.config.links or one.outcome is Outcome.NONE:
        return
    of_our_epoch = one.epoch == turn.state.epoch
    # Somebody else decides, or decided before us, under our epoch: the numbers are not ours.
    same = one.newest_epoch == turn.state.epoch
    foreign = same and one.newest_id >= turn.state.next_id
    if not foreign:
        _take_outcome(turn, one)
    if of_our_epoch and turn.own.leading and (foreign or one.newest_epoch > turn.state.epoch):
        _overtake(turn, one)


def _take_outcome(turn: Turn, one: i.ActionReport) -> None:
    for slot in slots(turn):
        pending = pending_in(turn, slot)
        if pending is None or one.link not in pending.targets:
            continue
        number, failed = (one.epoch, one.id), one.outcome is Outcome.FAILED
        if number != pending.number:
            asked_again = one.link in pending.decision.targets
            refused = failed or one.outcome is Outcome.REFUSED
            if number not in pending.earlier or (asked_again and refused):
                continue
        elif (
            failed
            and not pending.of(one.link)
            and wanted(turn, slot)
            and _overtaken(turn, number, one.link)
        ):
            # Refused as older, not tried: those that have not begun get a new number.
            renew_missing(turn, slot, f"{one.link} saw a newer decision first")
            return
        reached = pending.of(one.link) | {one.outcome}
        outcomes = MappingProxyType({**pending.outcomes, one.link: reached})
        details, text = pending.details, f"{one.link}: {one.detail}"
        if text not in details:
            details = (*details, text)[-8:]
        put(turn, slot, replace(pending, outcomes=outcomes, details=details))


def _overtaken(turn: Turn, number: tuple[int, int], link: str) -> bool:
    """A node that saw a later decision of ours before this one refuses this one as older."""
    others = [pending_in(turn, slot) for slot in slots(turn)]
    return any(
        other is not None and link in other.targets and other.number > number for other in others
    )


def _overtake(turn: Turn, one: i.ActionReport) -> None:
    """A node refuses what is older than it has seen: go on above that, unless it is another
    supervisor's."""
    epoch = epoch_above(one.newest_epoch, turn.config.rank)
    if epoch > LARGEST_EPOCH:
        turn.alarm(f"{one.link} has seen epoch {one.newest_epoch}, the largest: restart it")
        return
    if turn.config.standby and one.newest_epoch % RANKS != turn.config.rank:
        turn.outputs.append(i.Refused(one.newest_epoch))
        return
    text = f"{one.link} has seen epoch {one.newest_epoch}: continuing as {epoch}"
    turn.log(text)
    turn.state = replace(turn.state, epoch=epoch)
    renew_not_begun(turn, f"{one.link} knows a newer epoch")
