"""Who waits for a kill or a deploy, and what they are told of it."""

from __future__ import annotations

from chute_ros.model import Outcome
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.sending import kill_failed, put
from chute_ros.supervisor.turn import Turn


def deploy_reached(turn: Turn, outcome: Outcome) -> bool:
    """A step of the deploy has got this far, or further."""
    return any(deploy.reached(outcome) for deploy in turn.deploying.deploys)


def deploy_details(turn: Turn) -> str:
    """What was reported last on each step of the deploy, in words."""
    return "; ".join(d.newest_details() for d in turn.deploying.deploys if d.details)


def end_kill(turn: Turn) -> None:
    """Say how the kill went as soon as that is known, before another takes its place."""
    kill = turn.killing.kill
    if kill is None:
        return
    failed = kill_failed(turn, kill)
    waited = turn.now - kill.decided_at
    text = kill.newest_details() or f"no report within {waited:.1f} s"
    if kill.confirmed or failed:
        finish_kill(turn, kill.confirmed, kill.reached(Outcome.ACCEPTED), text)
    if failed and not kill.given_up:
        put(turn, "kill", replace(kill, given_up=True))
        turn.alarm(f"the motors may still turn, no kill confirmed: {text}")


def finish_kill(turn: Turn, success: bool, accepted: bool, message: str) -> None:
    """Answer everyone who waits for the kill."""
    for token in turn.own.kill_tokens:
        turn.finish(token, success, accepted, message)
    turn.own = replace(turn.own, kill_tokens=())


def finish_deploy(turn: Turn, success: bool, accepted: bool, message: str) -> None:
    """Answer everyone who waits for the deploy."""
    for token in turn.own.deploy_tokens:
        turn.finish(token, success, accepted, message)
    turn.own = replace(turn.own, deploy_tokens=())
    turn.deploying = replace(turn.deploying, deploy_rule="", deploy_reasons=())


def answer_all(turn: Turn, why: str) -> None:
    """Nobody waits any more; what was ordered goes on, here or elsewhere."""
    for token in (*turn.own.kill_tokens, *turn.own.deploy_tokens):
        turn.finish(token, False, False, why)
    turn.own = replace(turn.own, kill_tokens=(), deploy_tokens=())


def give_up_waiting(turn: Turn, why: str) -> None:
    """What was asked for is not pursued any more."""
    finish_kill(turn, False, False, why)
    finish_deploy(turn, False, False, why)
