"""The stages of a flight as the supervisor sees them, and every change between them.

The table is the whole truth: a pair that it does not list raises. What the supervisor does on the
way is in core.py; here is only what may follow what.
"""

from __future__ import annotations

import enum


class Stage(enum.IntEnum):
    """State of the vehicle; numbers of chute_msgs/SafetyState."""

    STARTUP = 0
    BLOCKED = 1
    READY = 2
    ARMED = 3
    IN_FLIGHT = 4
    KILLING = 5
    DEPLOYING = 6
    DEPLOYED = 7
    LANDED = 8
    FAULT = 9


ON_GROUND = (Stage.STARTUP, Stage.BLOCKED, Stage.READY, Stage.ARMED, Stage.LANDED)


class StageEvent(enum.Enum):
    """What can move the vehicle from one stage to another."""

    LINKS_HEALTHY = "every required link is healthy"
    LINKS_UNHEALTHY = "a required link is not healthy, or a device asks to block flight"
    ARMED = "the parachute was armed"
    DISARMED = "the parachute was disarmed"
    TAKEN_OFF = "the vehicle is in the air"
    LANDED = "the vehicle is on the ground"
    SECURED = "the vehicle is on the ground with its motors disarmed"
    KILL = "a kill was decided"
    DEPLOY_DUE = "the kill is confirmed or its time is over, and a deploy follows"
    PARACHUTE_OPEN = "a parachute says that it was released"
    TAKEN_BACK = "a parachute that nobody ordered to release says no more that it is out"
    MODE_CHANGED = "a person changed the mode while a deploy was under way"
    DEPLOY_FAILED = "no parachute confirmed in time"
    RESET = "a person asked for the start"


_S, _E = Stage, StageEvent

TRANSITIONS: dict[tuple[Stage, StageEvent], Stage] = {
    (_S.STARTUP, _E.LINKS_HEALTHY): _S.READY,
    (_S.STARTUP, _E.LINKS_UNHEALTHY): _S.BLOCKED,
    (_S.STARTUP, _E.TAKEN_OFF): _S.IN_FLIGHT,
    (_S.STARTUP, _E.KILL): _S.KILLING,
    (_S.BLOCKED, _E.LINKS_HEALTHY): _S.READY,
    (_S.BLOCKED, _E.TAKEN_OFF): _S.IN_FLIGHT,
    (_S.BLOCKED, _E.KILL): _S.KILLING,
    (_S.BLOCKED, _E.RESET): _S.STARTUP,
    (_S.READY, _E.LINKS_UNHEALTHY): _S.BLOCKED,
    (_S.READY, _E.ARMED): _S.ARMED,
    (_S.READY, _E.TAKEN_OFF): _S.IN_FLIGHT,
    (_S.READY, _E.KILL): _S.KILLING,
    (_S.READY, _E.RESET): _S.STARTUP,
    (_S.ARMED, _E.LINKS_UNHEALTHY): _S.BLOCKED,
    (_S.ARMED, _E.DISARMED): _S.READY,
    (_S.ARMED, _E.TAKEN_OFF): _S.IN_FLIGHT,
    (_S.ARMED, _E.KILL): _S.KILLING,
    (_S.ARMED, _E.RESET): _S.STARTUP,
    (_S.IN_FLIGHT, _E.LANDED): _S.LANDED,
    (_S.IN_FLIGHT, _E.KILL): _S.KILLING,
    (_S.IN_FLIGHT, _E.PARACHUTE_OPEN): _S.DEPLOYED,
    (_S.IN_FLIGHT, _E.RESET): _S.STARTUP,
    (_S.KILLING, _E.KILL): _S.KILLING,
    (_S.KILLING, _E.TAKEN_OFF): _S.IN_FLIGHT,
    (_S.KILLING, _E.DEPLOY_DUE): _S.DEPLOYING,
    (_S.KILLING, _E.PARACHUTE_OPEN): _S.DEPLOYED,
    (_S.KILLING, _E.RESET): _S.STARTUP,
    (_S.DEPLOYING, _E.PARACHUTE_OPEN): _S.DEPLOYED,
    (_S.DEPLOYING, _E.MODE_CHANGED): _S.KILLING,
    (_S.DEPLOYING, _E.DEPLOY_FAILED): _S.FAULT,
    (_S.DEPLOYED, _E.KILL): _S.KILLING,
    (_S.DEPLOYED, _E.TAKEN_BACK): _S.IN_FLIGHT,
    (_S.DEPLOYED, _E.RESET): _S.STARTUP,
    (_S.LANDED, _E.LINKS_UNHEALTHY): _S.BLOCKED,
    (_S.LANDED, _E.DISARMED): _S.READY,
    (_S.LANDED, _E.SECURED): _S.READY,
    (_S.LANDED, _E.TAKEN_OFF): _S.IN_FLIGHT,
    (_S.LANDED, _E.KILL): _S.KILLING,
    (_S.LANDED, _E.RESET): _S.STARTUP,
    (_S.FAULT, _E.PARACHUTE_OPEN): _S.DEPLOYED,
    (_S.FAULT, _E.KILL): _S.KILLING,
    (_S.FAULT, _E.RESET): _S.STARTUP,
}


def listed(stage: Stage, event: StageEvent) -> bool:
    """Does the table list this pair?"""
    return (stage, event) in TRANSITIONS
