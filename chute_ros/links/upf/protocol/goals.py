"""The goals of the UPF protocol: which requests, and what shows their effect.

Source: Flyfire UPF UAVCAN protocol V1.0, "global working state" (ParachuteService, and what
excludes what) and the architecture without a controller (TriggerService).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.definitions import (
    PARACHUTE_SERVICE,
    TRIGGER_SERVICE,
    Definitions,
)
from chute_ros.links.upf.protocol.devices import Controller, Trigger
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.calls import Call, CallFinished
from chute_ros.protocol.goal import ConfirmedCommand

UpfGoal = ConfirmedCommand[Call]

#: Priority of what fires, 0 the most urgent to 31.
FIRE_PRIORITY = 2
#: Name of the goal that fires.
DEPLOY = "deploy"

_S = ParachuteState
#: Request of ParachuteService -> the states that show that it was done.
_SHOWN_BY: dict[str, tuple[ParachuteState, ...]] = {
    "TYPE_TAKEOFF": (_S.TAKEOFF, _S.ARMED),
    "TYPE_ARM": (_S.ARMED,),
    "TYPE_DISARM": (_S.TAKEOFF, _S.READY),
    "TYPE_LAND": (_S.READY,),
}


#: Forced or not -> the request.
_DEPLOYS = {False: "TYPE_DEPLOY", True: "TYPE_DEPLOY_FORCE"}
DEPLOY_PREFIX = "TYPE_DEPLOY"
#: Every request of ParachuteService.
REQUESTS = (*_SHOWN_BY, *_DEPLOYS.values())
_READIER, _LESS_READY = ("TYPE_TAKEOFF", "TYPE_ARM"), ("TYPE_DISARM", "TYPE_LAND")
#: Which requests under way a newer one puts an end to, so that the older does not have the last
#: word by being sent again.
OPPOSITE: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(_READIER, _LESS_READY),
    **dict.fromkeys(_LESS_READY, _READIER),
}


def read_answer(
    definitions: Definitions, deploy_answered: Callable[[Call, bool], None]
) -> Callable[[CallFinished], CallFinished]:
    """Says of an answered call of the flyfire services what its result means. deploy_answered:
    is told which call to deploy a controller answered, and whether it accepted."""

    def read(finished: CallFinished) -> CallFinished:
        assert finished.values is not None
        call = finished.command
        name = definitions.result_name(call.service, finished.values)
        if definitions.type_name(call.service, call.values) in _DEPLOYS.values():
            deploy_answered(call, name == "SUCCESS")
        return replace(
            finished,
            accepted=name == "SUCCESS",
            not_now="TEMPORARILY" in name or "BUSY" in name,
            result=int(finished.values["result"]),
            words=_words(name),
        )

    return read


def _words(result: str) -> str:
    """A result as it is told: every refusal that is final says that it failed."""
    words = result.lower().replace("_", " ")
    final = result != "SUCCESS" and "TEMPORARILY" not in result and "BUSY" not in result
    return f"failed: {words}" if final and words != "failed" else words


def excluded(controller: Controller, type_name: str) -> str:
    """Why the controller would reject this request; empty: nothing is known that would."""
    switch = p.EXCLUDES.get(type_name)
    if switch is None or not controller.switch(switch):
        return ""
    return (
        f"{switch} of controller {controller.node_id} is on: the controller does this by itself "
        f"and rejects {type_name}; set {switch!r} to false to command it from here"
    )


def request(
    controller: Controller,
    definitions: Definitions,
    type_name: str,
    now: float,
    even_if_shown: bool = False,
) -> UpfGoal:
    """Take-off, arm, disarm or land, and its own status after it. even_if_shown: sent even where
    it is so already, as an opposite one may be on its way."""
    wanted = _SHOWN_BY[type_name]
    names = " or ".join(state.name for state in wanted)
    alive = controller.alive and not controller.overdue(now) and not even_if_shown
    return ConfirmedCommand(
        type_name,
        (_call(controller, definitions, type_name),),
        f"ParachuteStatus reports {names}",
        lambda: (alive or controller.status_received > now) and controller.state in wanted,
        hinders_release=type_name in _LESS_READY,
        needs_acknowledgement=even_if_shown,
        hint=lambda: _why_not(controller, type_name),
    )


def deploy(
    controller: Controller,
    triggers: Callable[[], list[Trigger]],
    definitions: Definitions,
    force: bool,
    now: float,
) -> UpfGoal:
    """Deploy through the controller.

    A status from before the order is believed only while the link is alive: what a lost device
    said long ago must not keep us from sending.
    """
    alive = controller.alive and not controller.overdue(now)

    def shown() -> bool:
        if controller.deployed and (alive or controller.status_received > now):
            return True
        return any(_fired(trigger, now) for trigger in triggers())

    type_name = _DEPLOYS[force]
    return ConfirmedCommand(
        DEPLOY,
        (_call(controller, definitions, type_name, FIRE_PRIORITY),),
        "ParachuteStatus reports LAUNCHED",
        shown,
        insist=force,
        urgent=True,
        hint=lambda: _why_not_deployed(controller, force),
    )


def fire_trigger(
    trigger: Trigger, triggers: Callable[[], list[Trigger]], definitions: Definitions, now: float
) -> UpfGoal:
    """Deploy through a trigger: the architecture without a controller. Any one that has fired is
    enough."""
    return ConfirmedCommand(
        DEPLOY,
        (trigger_call(trigger, definitions),),
        f"TriggerStatus of {trigger.node_id} reports launched",
        lambda: any(_fired(one, now) for one in (trigger, *triggers())),
        insist=True,
        urgent=True,
    )


def trigger_call(trigger: Trigger, definitions: Definitions) -> Call:
    """TriggerService to launch."""
    values = definitions.request(TRIGGER_SERVICE, "TYPE_LAUNCH")
    return Call(trigger.node_id, TRIGGER_SERVICE, values, FIRE_PRIORITY)


def _fired(trigger: Trigger, now: float) -> bool:
    believed = trigger.alive and not trigger.overdue(now)
    return trigger.launched and (believed or trigger.status_received > now)


def _call(
    controller: Controller, definitions: Definitions, type_name: str, priority: int = 16
) -> Call:
    values = definitions.request(PARACHUTE_SERVICE, type_name)
    return Call(controller.node_id, PARACHUTE_SERVICE, values, priority)


def _why_not(controller: Controller, type_name: str) -> str:
    """What may be behind a rejection."""
    why = excluded(controller, type_name)
    if why:
        return why
    hints = [f"its state is {controller.state.name}"]
    switch = p.EXCLUDES[type_name]
    if controller.switch(switch) is None:
        hints.append(f"it rejects {type_name} while its parameter {switch!r} is on")
    return "; ".join(hints)


def _why_not_deployed(controller: Controller, force: bool) -> str:
    hints = []
    if controller.never_deploys:
        hints.append(f"{p.ENABLE_PARACHUTE} is off: it never deploys, not even by force")
    if not force and controller.state not in (_S.TAKEOFF, _S.ARMED):
        hints.append(f"its state is {controller.state.name}: force sends TYPE_DEPLOY_FORCE")
    return "; ".join(hints)
