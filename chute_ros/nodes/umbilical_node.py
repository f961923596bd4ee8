"""The ground side of a rocket's serial umbilical."""

from __future__ import annotations

import datetime
from typing import Any

from chute_msgs.msg import Telem, VehicleState
from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.errors import ParameterError
from chute_ros.nodes import messages, qos
from chute_ros.nodes.device_node import DeviceNode, Summary, block_reason
from chute_ros.nodes.dump_files import DumpFiles
from chute_ros.nodes.link_log import log_event
from chute_ros.nodes.telem_message import telem, unfit, without_place
from chute_ros.nodes.umbilical_diagnostics import (
    computer_task,
    details_of,
    heartbeat_task,
    memory_task,
    port_task,
)
from chute_ros.nodes.umbilical_parameters import PARAMETERS, config_from
from chute_ros.nodes.umbilical_services import UmbilicalServices
from chute_ros.protocol.effect import NO_ANSWER, EffectFinished
from chute_ros.protocol.events import Notice, RequestFinished, VehicleChanged
from chute_ros.protocol.umbilical import events
from chute_ros.protocol.umbilical.link import UmbilicalLink
from chute_ros.protocol.umbilical.reasons import reasons_of
from chute_ros.protocol.umbilical.sayings import LogLine
from chute_ros.transport.address import parse_serial_address
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.telem_layouts import load_layouts
from chute_ros.transport.wire import make_wire


class UmbilicalNode(DeviceNode):
    """The node umbilical."""

    PICTURES = (*DeviceNode.PICTURES, events.TelemetryReceived, LogLine)

    def __init__(self, **options: Any) -> None:
        super().__init__("umbilical", PARAMETERS, **options)
        address = parse_serial_address(self.values["connection"])
        layouts = load_layouts(self.values["telem_path"], "parameter telem_path")
        for layout in layouts:
            if bad := unfit(layout):
                raise ParameterError(f"parameter telem_path: {layout.name}: {'; '.join(bad)}")
            if names := without_place(layout):
                text = f"{layout.name}: umbilical/telem has no field for {', '.join(names)}"
                self.get_logger().warning(text)
        self.files = DumpFiles(self.values["dump_folder"])
        self.at_end.callback(self._end_dump)
        link = UmbilicalLink(config_from(self.values), layouts)
        self.loop = WireLoop(
            link, make_wire(address), self.deliver, link.wire_opened, link.not_written
        )
        self._progress = ""
        # The flight computer's own log, told apart from ours by the logger's name.
        self._its_log = self.get_logger().get_child("flight_computer")
        self._telem_publisher = self.create_publisher(Telem, "umbilical/telem", qos.STATUS)
        self._vehicle_publisher = None
        if self.values["publish_vehicle_state"]:
            self._vehicle_publisher = self.create_publisher(
                VehicleState, "vehicle/state", qos.STATUS
            )
        self.offered = UmbilicalServices(self)
        self.begin()

    def _end_dump(self) -> None:
        """One that is under way keeps what has come."""
        for event in self.inbox.left():
            if isinstance(event, events.DumpData):
                self.files.write(event.data)
        self.files.finish(False)

    # -- what DeviceNode asks for ---------------------------------------------------------------

    def summarise(self, link: UmbilicalLink, now: float) -> Summary:
        details = details_of(link, now)
        status = details.status
        stale_after = link.config.telemetry.stale_after
        reasons = reasons_of(status, details.received_bytes, stale_after)
        state = link.computer.liveness.state
        return Summary(state, status.healthy, details.record_age, details, reasons)

    def link_event(self, event: Any) -> None:
        if isinstance(event, events.TelemetryReceived):
            self._telem_publisher.publish(telem(event.record, event.sequence, self.stamp()))
        elif isinstance(event, VehicleChanged):
            if self._vehicle_publisher is not None:
                message = messages.vehicle_state(event.state, self.stamp())
                self._vehicle_publisher.publish(message)
        elif isinstance(event, LogLine):
            log_event(self._its_log, Notice(event.severity, event.text))
        elif isinstance(event, events.Progress):
            self._progress = event.text
            self.get_logger().info(event.text, throttle_duration_sec=1.0)
        elif isinstance(event, events.DumpData):
            self.files.write(event.data)
        elif isinstance(event, events.DumpStarted):
            self._dump_started(event)
        elif isinstance(event, events.DumpFinished):
            self._dump_finished(event)

    def failed_end(self, token: int, text: str) -> RequestFinished:
        return RequestFinished(EffectFinished(token, False, False, NO_ANSWER, text))

    def carry_out(self, decision: model.Decision) -> None:
        if decision.action is model.Action.KILL:
            # The motor's valve is closed: that is what stops a hybrid motor.
            # And nothing launches after it until the supervisor releases flight.
            reason = self._decided_block = f"killed: {block_reason(decision)}"

            def kill(link: UmbilicalLink, token: int, now: float) -> None:
                link.flight_block(reason, now)
                link.command(token, "safe", True, now)

            self.desk.request_for(decision, kill)
        elif decision.action is model.Action.DEPLOY:
            force = self.values["decided_deploy_forces"]
            self.deploy_for(decision, lambda link, token, now: link.deploy(token, force, now))
        elif decision.action is not model.Action.NONE:
            self.carry_out_flight_block(
                decision, "launch is refused", "launch is left to the gate"
            )

    def arm_link(self, link: UmbilicalLink, token: int, request: Any, now: float) -> None:
        link.arm(token, request.arm, request.triggers, now)

    def deploy_link(self, link: UmbilicalLink, token: int, request: Any, now: float) -> None:
        link.deploy(token, request.force, now, again=request.force)

    def diagnose(self, summary: Summary) -> list[DiagnosticStatus]:
        assert self.loop is not None
        name, details = self.diagnostic_name, summary.details
        traffic = {
            "records per s": self.rate(details.records),
            "writes that failed": self.loop.send_errors,
        }
        wire = self.wire_picture()
        return [
            port_task(name, details, traffic, wire),
            computer_task(name, details),
            heartbeat_task(name, details, wire.is_open),
            memory_task(name, details, self._progress),
        ]

    # -- inside ---------------------------------------------------------------------------------

    def _dump_started(self, event: events.DumpStarted) -> None:
        wanted = self.offered.dump_paths.pop(event.token, "")
        now = datetime.datetime.now(datetime.timezone.utc)
        path = self.files.start(event.memory, event.suffix, wanted, now)
        self.get_logger().info(f"{event.memory} dump begins, to {path}")

    def _dump_finished(self, event: events.DumpFinished) -> None:
        result = self.files.finish(event.complete)
        if event.token:
            self.offered.dump_results[event.token] = result
        text = f"{event.text}; {result.failure or f'in {result.path}'}"
        if result.failure or not event.complete:
            self.get_logger().warning(text)
        else:
            self.get_logger().info(text)
