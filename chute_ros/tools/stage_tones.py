"""The colours of states and decisions, the same in every picture."""

from __future__ import annotations

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor.machine import Stage

STAGE_TONES = {
    Stage.STARTUP: "quiet",
    Stage.BLOCKED: "warn",
    Stage.READY: "good",
    Stage.ARMED: "good",
    Stage.IN_FLIGHT: "plain",
    Stage.KILLING: "bad",
    Stage.DEPLOYING: "bad",
    Stage.DEPLOYED: "act",
    Stage.LANDED: "quiet",
    Stage.FAULT: "bad",
}
ACTION_TONES = {
    Action.NONE: "quiet",
    Action.FLIGHT_BLOCK: "warn",
    Action.FLIGHT_BLOCK_RELEASE: "good",
    Action.KILL: "bad",
    Action.DEPLOY: "act",
}
LINK_TONES = {
    LinkState.NEVER_SEEN: "quiet",
    LinkState.OK: "good",
    LinkState.STALE: "warn",
    LinkState.LOST: "bad",
    LinkState.UNMONITORED: "warn",
}
OUTCOME_TONES = {
    Outcome.NONE: "quiet",
    Outcome.SENT: "quiet",
    Outcome.ACCEPTED: "plain",
    Outcome.CONFIRMED: "good",
    Outcome.FAILED: "bad",
    Outcome.REFUSED: "warn",
}
