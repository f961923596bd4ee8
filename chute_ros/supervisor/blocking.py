"""The ground: is the vehicle fit to fly, is it armed, and is flight blocked or released?"""

from __future__ import annotations

from chute_ros.model import Action, LinkState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage, StageEvent, listed
from chute_ros.supervisor.preflight import block_reasons, not_seen
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.sending import decide, kill_failed, worth_sending
from chute_ros.supervisor.turn import Turn

#: What the health of the links can do; in flight nothing.
_OF_LINKS = (StageEvent.LINKS_UNHEALTHY, StageEvent.LINKS_HEALTHY)
#: Once the parachutes were armed or disarmed, their own status says so within this time, s.
ARMED_SHOWS = 2.0
#: What an autopilot was asked for comes within this, s: nothing that comes is said to be missing.
NOT_SEEN_AFTER = 5.0


def check_armed(turn: Turn) -> None:
    """ARMED is what the parachutes say: one may be armed or disarmed past us, or start anew."""
    state = turn.state
    if turn.now < state.stage_since + ARMED_SHOWS:
        return
    if state.stage is Stage.READY:
        _show_armed(turn, state.armed())
    elif state.stage is Stage.ARMED and not state.armed():
        told = [
            status
            for link in turn.config.deploy_links
            for status in state.evidence(link).devices.values()
            if status.link_state is LinkState.OK
        ]
        if told:
            text = "no parachute says any more that it is armed"
            turn.warn(text)
            turn.move(StageEvent.DISARMED, text)


def _show_armed(turn: Turn, armed: list[tuple[str, str]]) -> None:
    if armed:
        turn.move(StageEvent.ARMED, f"{', '.join(map(' '.join, armed))} says armed")


def check_links(turn: Turn) -> None:
    stage = turn.state.stage
    if not any(listed(stage, event) for event in _OF_LINKS):
        return
    reasons = block_reasons(turn.config, turn.state, turn.now)
    grace = max(turn.config.limits(link).startup_grace for link in turn.config.links)
    starting = turn.now < turn.state.started_at + grace
    if stage is Stage.STARTUP and reasons and starting:
        return
    event = StageEvent.LINKS_UNHEALTHY if reasons else StageEvent.LINKS_HEALTHY
    if listed(stage, event):
        turn.move(event, "; ".join(reasons))
        if not reasons:
            # What was armed before a link was silent is armed still, until its status says
            # otherwise: the heartbeat that makes the link whole may overtake it.
            heard = [
                one
                for one in sorted(turn.state.last_armed)
                if one[1] in turn.state.evidence(one[0]).devices
                and turn.state.hears(turn.config, one[0], turn.now)
            ]
            mute = [link for link in turn.config.deploy_links if turn.state.unmonitored(link)]
            if not heard and mute and turn.flight.armed_on_ground:
                turn.move(
                    StageEvent.ARMED, f"{', '.join(mute)} was armed, and cannot report otherwise"
                )
            _show_armed(turn, heard)


def tell_not_seen(turn: Turn) -> None:
    """Before flight, what the rules will not see; anew as it changes."""
    on_ground = turn.state.stage in (Stage.READY, Stage.ARMED)
    if not (on_ground and turn.now >= turn.state.stage_since + NOT_SEEN_AFTER):
        return
    text = not_seen(turn.config, turn.state)
    if text != turn.own.not_seen:
        turn.own = replace(turn.own, not_seen=text)
        turn.log(f"not seen in flight: {text or 'nothing any more, all is reported'}")


def block_or_release(turn: Turn) -> None:
    """Flight is blocked on the ground until READY, and after a deploy until a reset."""
    if turn.state.mode is i.Mode.INHIBITED:
        return
    if turn.state.stage in (Stage.READY, Stage.ARMED):
        action = Action.FLIGHT_BLOCK_RELEASE
        reasons: tuple[str, ...] = ("every required link is healthy",)
    elif turn.state.stage in (Stage.STARTUP, Stage.BLOCKED, Stage.DEPLOYED, Stage.FAULT) or (
        _killed_on_ground(turn)
    ):
        action = Action.FLIGHT_BLOCK
        reasons = block_reasons(turn.config, turn.state, turn.now)
    elif turn.state.stage is Stage.IN_FLIGHT:
        action, reasons = Action.FLIGHT_BLOCK_RELEASE, ("in the air",)
    else:
        return
    block = turn.state.block
    if turn.state.mode is i.Mode.SHADOW and block is not None and not block.decision.shadow:
        # Leaving ACTIVE took the block back; that must arrive before anything is only said.
        if worth_sending(turn, block):
            return
        block = None
    if block is None or block.decision.action is not action:
        decide(turn, "block", action, "links", reasons, turn.config.links)


def _killed_on_ground(turn: Turn) -> bool:
    """The kill has ended, so that a block does not overtake it, and nothing follows it."""
    kill = turn.killing.kill
    ended = kill is not None and (kill.confirmed or kill_failed(turn, kill))
    on_ground = not turn.killing.killed_in_flight and not turn.deploying.deploy_rule
    return turn.state.stage is Stage.KILLING and ended and on_ground
