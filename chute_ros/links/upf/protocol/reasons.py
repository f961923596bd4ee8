"""Why a UPF parachute is not healthy, in words: what is so, and what is needed."""

from __future__ import annotations

from collections.abc import Sequence

from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.devices import Trigger
from chute_ros.links.upf.protocol.roster import UpfDevices
from chute_ros.model import LinkState, ParachuteStatus

_NEEDED = "need READY, TAKEOFF or ARMED"


def reasons_of(
    config: UpfConfig,
    devices: UpfDevices,
    picture: ParachuteStatus | None,
    troubles: Sequence[str],
    now: float,
) -> tuple[str, ...]:
    """Every reason; none if nothing is wrong. picture: of the parachute, None: there is none yet.
    troubles: of the bus."""
    found = [_never_heard(config)] if picture is None else _of_picture(picture, devices)
    for trigger in devices.triggers.values():
        if not trigger.sound:
            found += _of_trigger(trigger, now)
    return tuple(dict.fromkeys([*found, *troubles]))


def _never_heard(config: UpfConfig) -> str:
    kind, wanted, status = "controller", config.controller_node_id, "ParachuteStatus"
    if config.without_controller:
        kind, wanted, status = "trigger", config.trigger_node_id, "TriggerStatus"
    name = f"{kind} {wanted}" if wanted else f"a {kind}"
    where = "from this node id" if wanted else f"({kind}_node_id 0: of any node)"
    return f"{name} was never received: need its {status} {where}"


def _of_picture(picture: ParachuteStatus, devices: UpfDevices) -> list[str]:
    trigger = picture.device not in map(str, devices.controllers)
    name = f"{'trigger' if trigger else 'controller'} {picture.device}"
    found = list(picture.faults)
    if picture.link_state is not LinkState.OK and not found:
        found.append(f"{name} is {picture.link_state.name}, need OK")
    if picture.deployed:
        found.append(f"{name}: state {picture.state.name}, the parachute is out, {_NEEDED}")
    elif not picture.healthy:
        found.append(f"{name}: state {picture.state.name}, {_NEEDED}")
    return found


def _of_trigger(trigger: Trigger, now: float) -> list[str]:
    voltage = trigger.number("supply_voltage")
    supply = "" if voltage != voltage else f", supply {voltage:.1f} V"
    state = trigger.state or "not known"
    doubted = ", reports fired" if trigger.launched or trigger.doubted else ""
    text = f"trigger {trigger.node_id}: state {state}{doubted}{supply}, need READY"
    return [*trigger.faults(now), text]
