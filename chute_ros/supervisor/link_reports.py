"""What the device nodes tell of themselves and of their parachutes. Nobody but a link that is
configured is listened to."""

from __future__ import annotations

import math
from types import MappingProxyType

from chute_ros.model import Action, LinkState, ParachuteStatus
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.link_evidence import LinkEvidence
from chute_ros.supervisor.machine import ON_GROUND, Stage, StageEvent
from chute_ros.supervisor.preflight import RELEASED, TWO_NODES
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.sending import pending_in, renew, slots
from chute_ros.supervisor.turn import Turn

#: Parachutes of which a release, or that they were armed, is remembered: made-up names must not
#: grow us.
MOST_REMEMBERED = 64


def take_heartbeat(turn: Turn, one: i.LinkHeartbeat) -> None:
    """A node lives. One whose count does not rise has restarted; a lost one may have."""
    if one.link not in turn.config.links:
        return
    before, limits = turn.state.evidence(one.link), turn.config.limits(one.link)
    known = not math.isnan(before.heard)
    silent = before.silent(limits.lost_after, turn.now)
    _set_evidence(turn, one.link, before.with_heartbeat(one, limits, turn.now))
    after = turn.state.evidence(one.link)
    if turn.flight.airborne and after.is_two(turn.now) and not before.is_two(turn.now):
        turn.warn(f"{one.link}: {TWO_NODES}")
    if turn.own.leading:
        # The alarms of one that follows are those of the leader, which has another clock.
        _check_clock(turn, one.link)
        _check_delay(turn, one.link, before.looks_late)
    # One whose count goes on, as of two of one name, has heard what was decided.
    restarted = one.seq <= before.seq and not before.goes_on(one.seq, turn.now)
    if known and (silent or restarted):
        # It may know of no decision; what still holds for it is decided anew.
        why = f"{one.link} {'restarted' if restarted else 'is back'}"
        for slot in slots(turn):
            pending = pending_in(turn, slot)
            if pending is None or one.link not in pending.targets:
                continue
            # One that goes on counting goes on with what it has begun: no second shot.
            begun = not restarted and one.link not in pending.not_begun()
            if slot == "block" or not begun:
                renew(turn, slot, why)


def _check_clock(turn: Turn, link: str) -> None:
    """Its wall clock against the one here."""
    text = f"{link}: its wall clock differs; it may refuse decisions as too old"
    difference = abs(turn.state.evidence(link).clocks_differ_by)
    told, limit = text in turn.alarming.alarms, turn.config.preflight.max_clock_difference
    if difference > limit and not told:
        turn.alarm(text)
    elif difference <= limit and told:
        alarms = tuple(one for one in turn.alarming.alarms if one != text)
        turn.alarming = replace(turn.alarming, alarms=alarms)
        turn.log(f"{link}: its wall clock agrees again")


def _check_delay(turn: Turn, link: str, before: str) -> None:
    """On the ground it forbids take-off."""
    text = turn.state.evidence(link).looks_late
    if turn.flight.airborne and text and not before:
        turn.warn(f"{link}: {text}")


def take_parachute(turn: Turn, one: i.ParachuteReport) -> None:
    """One device on a link tells its picture."""
    if one.link not in turn.config.links:
        return
    status, alive = one.status, one.status.link_state is LinkState.OK
    said = turn.state.evidence(one.link).devices.get(status.device)
    was_out = said is not None and said.deployed
    # One that started anew has forgotten it, which takes nothing back.
    forgot = said is not None and status.uptime < said.uptime
    _set_evidence(turn, one.link, turn.state.evidence(one.link).with_status(status, turn.now))
    _note_armed(turn, one.link, status)
    if status.deployed and not was_out:
        _note_release(turn, one.link, status.device)
    if alive and not status.deployed:
        before = turn.flight.released_before - {(one.link, status.device)}
        turn.flight = replace(turn.flight, released_before=before)
        aloft = flight.in_air(turn.config, turn.state, turn.now) is not False
        if was_out and aloft and turn.state.stage is Stage.DEPLOYED:
            text = f"{one.link} {status.device} no longer reports deployed"
            if turn.deploying.deploys or not turn.flight.airborne or forgot:
                turn.alarm(f"{text}; a forced deploy continues with the next")
            else:
                # It may have erred when it said so; with nothing out, the rules must live.
                turn.alarm(text)
                turn.move(StageEvent.TAKEN_BACK, text)
                _unlatch_deploys(turn)


def _note_armed(turn: Turn, link: str, status: ParachuteStatus) -> None:
    """One that is not received ends nothing: it is armed still, for all that is known."""
    armed, this = turn.state.last_armed, (link, status.device)
    if status.armed and link in turn.config.deploy_links and len(armed) < MOST_REMEMBERED:
        armed |= {this}
    elif not status.armed and status.link_state is LinkState.OK:
        armed -= {this}
    if armed != turn.state.last_armed:
        turn.state = replace(turn.state, last_armed=armed)


def _note_release(turn: Turn, link: str, device: str) -> None:
    """Whoever did it: nobody flies with it before a person has looked at it."""
    if link not in turn.config.deploy_links:
        return
    since_reset = turn.state.released_since_reset
    if len(since_reset) < MOST_REMEMBERED:
        since_reset = since_reset | {(link, device)}
    turn.state = replace(turn.state, released_since_reset=since_reset)
    if not turn.flight.airborne and turn.state.stage in ON_GROUND:
        turn.alarm(f"{link} {device} {RELEASED}")


def _unlatch_deploys(turn: Turn) -> None:
    """What a deploy rule was acted on for has not been done."""
    deploys = {one.name for one in turn.config.profile.rules if one.action is Action.DEPLOY}
    rules = {
        name: replace(evidence, latched=evidence.latched and name not in deploys)
        for name, evidence in turn.state.rules.items()
    }
    turn.state = replace(turn.state, rules=MappingProxyType(rules))


def _set_evidence(turn: Turn, link: str, evidence: LinkEvidence) -> None:
    links = {**turn.heard.links, link: evidence}
    turn.heard = replace(turn.heard, links=MappingProxyType(links))
