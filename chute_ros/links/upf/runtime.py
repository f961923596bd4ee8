"""Decisions carried out by upf_can, its device's requests, and the health of the device."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from chute_ros.links.upf.protocol.bus_requests import BusRequestDone
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.device_table import DeviceTable
from chute_ros.links.upf.protocol.devices import Trigger
from chute_ros.links.upf.protocol.events import BusRequestFinished
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.model import (
    NAN,
    Action,
    Decision,
    LinkState,
    Outcome,
    ParachuteStatus,
    VehicleState,
)
from chute_ros.protocol.events import AskSupervisor, Notice, SafetyAsk, Severity, failed_request
from chute_ros.protocol.goal import EffectFinished
from chute_ros.runtime.device import DeviceRuntime, DeviceSettings, Summary, block_reason
from chute_ros.runtime.topics import ActionTold, DeviceRequest, SafetyPicture
from chute_ros.settings import nested, parameter
from chute_ros.supervisor.config import TRIGGER

_NEEDED = "need READY, TAKEOFF or ARMED"
#: Kills that were confirmed are remembered, so many.
_MOST_KILLS = 50


@dataclass(frozen=True)
class UpfSettings(DeviceSettings):
    """Settings of a UpfRuntime."""

    link: UpfConfig = nested(UpfConfig())
    decided_deploy_forces: bool = parameter(
        True, "send a deploy that the supervisor decided as TYPE_DEPLOY_FORCE"
    )


@dataclass(frozen=True)
class FailedEnd:
    """The end of a request that could not be begun, whichever kind it was."""

    finished: EffectFinished
    done: BusRequestDone


class UpfRuntime(DeviceRuntime[UpfSettings]):
    """Its link is an UpfLink."""

    BLOCKS_FLIGHT = False
    # Has left by then, and the supervisor needs the processor now.
    UNHURRIED = (AskSupervisor,)

    def __init__(self, *options: Any, **more: Any) -> None:
        super().__init__(*options, **more)
        #: Flight is blocked since before the vehicle was in the air, or armed.
        self._held = False
        #: Kills that were confirmed: (epoch, id, link) of the newest reports.
        self._kills: deque[tuple[int, int, str]] = deque(maxlen=_MOST_KILLS)

    def summarise(self, link: UpfLink, now: float) -> Summary:
        troubles = link.bus.troubles()
        picture = link.devices.picture(now)
        reasons = reasons_of(link.config, link.devices, picture, troubles, now)
        if picture is None:
            return Summary(LinkState.NEVER_SEEN, False, NAN, reasons)
        device = link.devices.controller() or link.devices.trigger()
        assert device is not None
        # Doubt about who is on the bus, or a trigger that is in trouble or was never received,
        # forbids take-off, but takes nothing back in flight. One that arms under a flight block
        # does not fly by that: the supervisor knows its height, and releases the block.
        in_air = link.in_air(now)
        self._held = bool(self.decided_block) and (self._held or not in_air)
        sound = not (troubles or link.devices.missing_trigger()) and all(
            one.sound for one in link.devices.triggers.values()
        )
        healthy = picture.healthy and (sound or (in_air and not self._held))
        liveness = device.liveness
        return Summary(liveness.state, healthy, liveness.age(now), () if healthy else reasons)

    def failed_end(self, token: int, text: str) -> FailedEnd:
        return FailedEnd(failed_request(token, text).finished, BusRequestDone(False, text, 0))

    def carry_out(self, decision: Decision) -> None:
        if decision.action is Action.DEPLOY:
            self._deploy_decided(decision)
        elif decision.action is Action.KILL:
            text = "a UPF parachute stops no motors: take upf_can out of kill_links"
            self.decisions.report(decision, Outcome.FAILED, text)
        elif decision.action is not Action.NONE:
            self.decided_block = block_reason(decision)
            # The device asks for it and does nothing about it itself.
            text = "noted; nothing goes to the device"
            self.decisions.report(decision, Outcome.CONFIRMED, text)

    def _deploy_decided(self, decision: Decision) -> None:
        force, device = self.settings.decided_deploy_forces, decision.device
        if device == TRIGGER:
            self.deploy_for(decision, lambda link, token, now: link.fire_triggers(token, now))
        elif device and not device.isdecimal():
            text = f'device {device!r}: need a DroneCAN node id or "{TRIGGER}"; nothing was sent'
            self.decisions.report(decision, Outcome.FAILED, text)
        else:
            node_id = int(device or 0)

            def begin(link: UpfLink, token: int, now: float) -> None:
                link.kill_waited_for(now)
                link.deploy(token, force, now, node_id)

            self.deploy_for(decision, begin)

    # -- what the device asks -------------------------------------------------------------------

    def in_turn(self, events: list[Any]) -> None:
        """What a device asks for leaves at once: a kill does not wait for the owner."""
        with ExitStack() as each:  # from the last to the first, each whatever the others raise
            for event in reversed(events):
                if isinstance(event, AskSupervisor):
                    asked = DeviceRequest(self.name, event.device, event.ask, event.reason)
                    each.callback(self.shell.publish, asked)

    def event(self, event: Any) -> None:
        if isinstance(event, AskSupervisor):
            text = f"{event.device} requests {event.ask.name} from the supervisor: {event.reason}"
            lets_go = event.ask is SafetyAsk.FLIGHT_BLOCK_RELEASE
            self.shell.log(Notice(Severity.INFO if lets_go else Severity.WARNING, text))
        elif isinstance(event, BusRequestFinished):
            self.desk.finished(event.token, event)
        else:
            super().event(event)

    # -- what the device is told ----------------------------------------------------------------

    def heard_vehicle(self, state: VehicleState) -> None:
        """vehicle/state came."""
        self.shell.in_link(lambda link, now: link.vehicle(state, now))

    def heard_action(self, told: ActionTold) -> None:
        """How far another node got with a decision."""
        one = told.report
        report = (one.epoch, one.id, one.link)
        confirmed = told.action is Action.KILL and one.outcome is Outcome.CONFIRMED
        if confirmed and report not in self._kills:
            # Once: a report is said again when its decision is, long after it happened.
            self._kills.append(report)
            self.shell.in_link(lambda link, now: link.kill_confirmed(now))

    def picture(self, one: SafetyPicture) -> None:
        prefix = f"{self.name} "
        blocks = one.device_blocks
        standing = [text.removeprefix(prefix) for text in blocks if text.startswith(prefix)]
        self.shell.in_link(lambda link, now: link.supervisor_said(one.blocked, standing, now))


def reasons_of(
    config: UpfConfig,
    devices: DeviceTable,
    picture: ParachuteStatus | None,
    troubles: Sequence[str],
    now: float,
) -> tuple[str, ...]:
    """Why it is not healthy, in words: what is so, and what is needed; none if nothing is wrong.
    picture: of the parachute, None: there is none yet. troubles: of the bus."""
    found = [_never_heard(config)] if picture is None else _of_picture(picture, devices)
    if missing := devices.missing_trigger():
        found.append(_never_received("trigger", missing, "TriggerStatus"))
    for trigger in devices.triggers.values():
        if not trigger.sound:
            found += _of_trigger(trigger, now)
    return tuple(dict.fromkeys([*found, *troubles]))


def _never_heard(config: UpfConfig) -> str:
    if config.without_controller:
        return _never_received("trigger", config.trigger_node_id, "TriggerStatus")
    return _never_received("controller", config.controller_node_id, "ParachuteStatus")


def _never_received(kind: str, wanted: int, status: str) -> str:
    name = f"{kind} {wanted}" if wanted else f"a {kind}"
    where = "from this node id" if wanted else f"({kind}_node_id 0: of any node)"
    return f"{name} was never received: need its {status} {where}"


def _of_picture(picture: ParachuteStatus, devices: DeviceTable) -> list[str]:
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
