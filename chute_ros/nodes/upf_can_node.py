"""A Flyfire UPF parachute on a DroneCAN bus."""

from __future__ import annotations

import time
from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from chute_msgs.msg import (
    ActionReport,
    SafetyState,
    TriggerStatus,
    VehicleState,
)
from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.nodes import messages, qos
from chute_ros.nodes.device_node import DeviceNode, Summary
from chute_ros.nodes.kept_file import Newest
from chute_ros.nodes.upf_allocation_file import AllocationFile
from chute_ros.nodes.upf_diagnostics import (
    allocation_task,
    bus_task,
    details_of,
    device_tasks,
    vehicle_service_task,
)
from chute_ros.nodes.upf_parameters import PARAMETERS, config_from
from chute_ros.nodes.upf_services import UpfServices
from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.protocol.effect import NO_ANSWER, EffectFinished
from chute_ros.protocol.upf.errands import ErrandDone
from chute_ros.protocol.upf.events import ErrandFinished, TriggerChanged
from chute_ros.protocol.upf.link import UpfLink
from chute_ros.protocol.upf.reasons import reasons_of
from chute_ros.protocol.upf.vehicle_service import Ask, AskSupervisor
from chute_ros.supervisor.config import TRIGGER
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_wire import make_can_wire
from chute_ros.transport.data_types import load_data_types
from chute_ros.transport.loop import WireLoop

_TRIGGER_STATES = {
    "NOT_READY": TriggerStatus.NOT_READY,
    "READY": TriggerStatus.READY,
    "LAUNCHED": TriggerStatus.LAUNCHED,
    "ABNORMAL": TriggerStatus.ABNORMAL,
}


@dataclass(frozen=True)
class _FailedEnd:
    """The end of a request that could not be begun, whichever kind it was."""

    finished: EffectFinished
    done: ErrandDone


class UpfCanNode(DeviceNode):
    """The node upf_can."""

    BLOCKS_FLIGHT = False
    # Has left by then, and the supervisor needs the processor now.
    UNHURRIED = (AskSupervisor,)

    def __init__(self, **options: Any) -> None:
        super().__init__("upf_can", PARAMETERS, **options)
        name = self.get_fully_qualified_name()
        address = parse_can_address(self.values["connection"], self.values["bitrate"])
        types = load_data_types(self.values["dsdl_path"], "parameter dsdl_path")
        self._file = AllocationFile(self.values["allocation_table_file"], name)
        table = self._file.load() if self.values["allocator"] != "false" else {}
        utc_offset = time.time() - time.monotonic()
        link = UpfLink(config_from(self.values, table, name, utc_offset), types)
        self.loop = WireLoop(link, make_can_wire(address), self.deliver)
        #: Kills that were confirmed: (epoch, id, link) of the newest reports.
        self._kills: deque[tuple[int, int, str]] = deque(maxlen=50)
        self._trigger_publisher = self.create_publisher(
            TriggerStatus, "upf/trigger_status", qos.STATUS
        )
        self.create_subscription(
            VehicleState, "vehicle/state", self._vehicle, qos.newest(qos.STATUS)
        )
        self.create_subscription(ActionReport, "safety/action", self._action, qos.DECISION)
        UpfServices(self)
        # Its thread keeps us alive: not before all that may end the start.
        self._tables = Newest(self._keep, "node ids")
        self.at_end.callback(self._tables.close)
        self.begin()

    # -- what DeviceNode asks for ---------------------------------------------------------------

    def summarise(self, link: UpfLink, now: float) -> Summary:
        details = details_of(link, now)
        picture = link.devices.picture(now)
        reasons = reasons_of(link.config, link.devices, picture, details.troubles, now)
        if picture is None:
            return Summary(model.LinkState.NEVER_SEEN, False, model.NAN, details, reasons)
        device = link.devices.controller() or link.devices.trigger()
        assert device is not None
        # Doubt about who is on the bus, or a trigger that is in trouble, forbids take-off, but
        # takes nothing back in flight.
        sound = not details.troubles and all(one.sound for one in link.devices.triggers.values())
        healthy = picture.healthy and (sound or link.in_air(now))
        liveness = device.liveness
        told = () if healthy else reasons
        return Summary(liveness.state, healthy, liveness.age(now), details, told)

    def link_event(self, event: Any) -> None:
        if isinstance(event, AskSupervisor):
            text = f"{event.device} asks the supervisor for {event.ask.name}: {event.reason}"
            if event.ask is Ask.FLIGHT_BLOCK_RELEASE:
                self.get_logger().info(text)
            else:
                self.get_logger().warning(text)
        elif isinstance(event, ErrandFinished):
            self.desk.finished(event.token, event)
        elif isinstance(event, TriggerChanged):
            self._publish_trigger(event)
        elif isinstance(event, KeepTable):
            self._tables.give(event)

    def failed_end(self, token: int, text: str) -> _FailedEnd:
        finished = EffectFinished(token, False, False, NO_ANSWER, text)
        return _FailedEnd(finished, ErrandDone(False, text, 0))

    def carry_out(self, decision: model.Decision) -> None:
        if decision.action is model.Action.DEPLOY:
            self._deploy_decided(decision)
        elif decision.action is model.Action.KILL:
            text = "a UPF parachute stops no motors: take upf_can out of kill_links"
            self.decisions.report(decision, model.Outcome.FAILED, text)
        elif decision.action is not model.Action.NONE:
            # The device asks for it and does nothing about it itself.
            text = "noted; nothing goes to the device"
            self.decisions.report(decision, model.Outcome.CONFIRMED, text)

    def flight_block(self, reason: str) -> None:
        """A UPF parachute asks for it and does nothing about it itself."""

    def _deploy_decided(self, decision: model.Decision) -> None:
        force, device = self.values["decided_deploy_forces"], decision.device
        if device == TRIGGER:
            self.deploy_for(decision, lambda link, token, now: link.fire_triggers(token, now))
        elif device and not device.isdecimal():
            text = f'device {device!r}: need a DroneCAN node id or "{TRIGGER}"; nothing was sent'
            self.decisions.report(decision, model.Outcome.FAILED, text)
        else:
            node_id = int(device or 0)

            def begin(link: Any, token: int, now: float) -> None:
                link.kill_waited_for(now)
                link.deploy(token, force, now, node_id)

            self.deploy_for(decision, begin)

    def arm_link(self, link: UpfLink, token: int, request: Any, now: float) -> None:
        link.arm(token, request.arm, request.triggers, now)

    def deploy_link(self, link: UpfLink, token: int, request: Any, now: float) -> None:
        link.deploy(token, request.force, now)

    def diagnose(self, summary: Summary) -> list[DiagnosticStatus]:
        assert self.loop is not None
        name, details = self.diagnostic_name, summary.details
        traffic = {
            "transfers received": details.received,
            "transfers received per s": self.rate(details.received),
            "transfers sent": details.sent,
            "frames that could not be sent": self.loop.send_errors,
            **{f"bad packets: {why}": n for why, n in sorted(self.loop.wire.counts.items())},
        }
        wire = self.wire_picture()
        return [
            bus_task(name, details, traffic, wire),
            *device_tasks(name, details, self.values["without_controller"]),
            vehicle_service_task(name, details),
            allocation_task(name, details, str(self._file.path)),
        ]

    def deliver(self, events: list[Any]) -> None:
        """What a device asks for leaves at once: a kill does not wait for the executor."""
        with ExitStack() as each:  # from the last to the first, each whatever the others raise
            each.callback(super().deliver, events)
            for event in reversed(events):
                if isinstance(event, AskSupervisor):
                    ask = (int(event.ask), event.device, event.reason)
                    each.callback(self.ask_supervisor, *ask)

    # -- from the rest of the vehicle -----------------------------------------------------------

    def _vehicle(self, message: VehicleState) -> None:
        state = messages.vehicle_state_from(message)
        self.in_link(lambda link, now: link.vehicle(state, now))

    def _action(self, message: ActionReport) -> None:
        confirmed = message.outcome == model.Outcome.CONFIRMED
        report = (message.epoch, message.id, message.link)
        if message.action == model.Action.KILL and confirmed and report not in self._kills:
            # Once: a report is said again when its decision is, long after it happened.
            self._kills.append(report)
            self.in_link(lambda link, now: link.kill_confirmed(now))

    def safety_state(self, message: SafetyState) -> None:
        prefix = f"{self.get_name()} "
        standing = [
            one.removeprefix(prefix) for one in message.device_blocks if one.startswith(prefix)
        ]
        blocked = message.flight_blocked
        self.in_link(lambda link, now: link.supervisor_said(blocked, standing, now))

    # -- inside ---------------------------------------------------------------------------------

    def _publish_trigger(self, event: TriggerChanged) -> None:
        picture = event.picture
        message = TriggerStatus(
            link=self.get_name(),
            node_id=picture["node_id"],
            link_state=int(picture["link_state"]),
            state=_TRIGGER_STATES.get(picture["state"], TriggerStatus.UNKNOWN),
            launched=picture["launched"],
            supply_voltage=picture["supply_voltage"],
            error_flags=picture["error_flags"],
            faults=list(picture["faults"]),
        )
        message.header.stamp = self.stamp()
        self._trigger_publisher.publish(message)

    def _keep(self, event: KeepTable) -> None:
        """In a thread of its own: to be sure that it is on the disk may take long."""
        try:
            self._file.save(event.table)
        except OSError as error:
            # Without a kept table nobody gets a node id: the device asks again and again.
            self.get_logger().error(
                f"the table of node ids cannot be kept, none is given out: {error}",
                throttle_duration_sec=5.0,
            )
            return
        self.get_logger().info(f"node ids kept: {sorted(event.table.values())}")
        if (loop := self.loop) is not None:
            loop.call(lambda link, now: link.table_kept(event.number, now))
