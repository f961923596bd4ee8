"""The ground side of a rocket's serial umbilical."""

from __future__ import annotations

import datetime
from typing import Any

from builtin_interfaces.msg import Time
from chute_msgs.msg import Telem, VehicleState
from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.diagnostics import details_of, memory_task, port_task
from chute_ros.links.umbilical.dump_files import DumpFiles
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.parameters import PARAMETERS, UmbilicalParameters
from chute_ros.links.umbilical.protocol import events
from chute_ros.links.umbilical.protocol.line_parser import LogLine
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.links.umbilical.runtime import UmbilicalRuntime
from chute_ros.links.umbilical.services import UmbilicalServices
from chute_ros.links.umbilical.telem_message import telem, unfit, without_place
from chute_ros.protocol.events import Notice
from chute_ros.ros import diagnostics, messages, qos
from chute_ros.ros.device_node import DeviceNode
from chute_ros.ros.link_log import log_notice
from chute_ros.runtime.device import Summary
from chute_ros.runtime.topics import VehicleTold
from chute_ros.settings import settings_from
from chute_ros.transport.address import parse_serial_address
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire import make_wire


class UmbilicalNode(DeviceNode):
    """The node umbilical."""

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
        settings = settings_from(UmbilicalParameters, self.values).runtime
        self.carry(UmbilicalRuntime(self.get_name(), settings, self, details_of))
        self.files = DumpFiles(self.values["dump_folder"])
        self.at_end.callback(self._end_dump)
        link = UmbilicalLink(settings.link, layouts)
        self.loop = WireLoop(
            link, make_wire(address), self.deliver, link.wire_opened, link.not_written
        )
        self._progress = events.WorkProgress("", 0, 0)
        # The flight computer's own log, told apart from ours by the logger's name.
        its_log = self.get_logger().get_child("flight_computer")
        self._telem_publisher = self.create_publisher(Telem, "umbilical/telem", qos.STATUS)
        if settings.publish_vehicle_state:
            vehicle = self.create_publisher(VehicleState, "vehicle/state", qos.STATUS)
            self.follow(
                VehicleTold,
                lambda one, stamp: vehicle.publish(
                    messages.vehicle_state(one.report.state, self.wall_at(one.at))
                ),
            )
        for kind, follower in (
            (events.TelemetryReceived, self._telemetry),
            (LogLine, lambda one, at: log_notice(its_log, Notice(one.severity, one.text))),
            (events.WorkProgress, self._progressed),
            (events.DumpData, lambda one, at: self.files.write(one.data)),
            (events.DumpStarted, self._dump_started),
            (events.DumpFinished, self._dump_finished),
        ):
            self.follow(kind, follower)
        self.offered = UmbilicalServices(self)
        self.begin()

    def _end_dump(self) -> None:
        """One that is under way keeps what has come."""
        for event in self.inbox.left():
            if isinstance(event, events.DumpData):
                self.files.write(event.data)
        self.files.finish(False)

    # -- what only this node's link tells -------------------------------------------------------

    def _telemetry(self, event: events.TelemetryReceived, stamp: Time) -> None:
        received = self.wall_at(event.record.received)
        self._telem_publisher.publish(telem(event.record, event.sequence, received))

    def _progressed(self, event: events.WorkProgress, stamp: Time) -> None:
        self._progress = event
        self.get_logger().info(event.text, throttle_duration_sec=1.0)

    def diagnose(self, summary: Summary) -> list[DiagnosticStatus]:
        assert self.loop is not None
        name, details = self.diagnostic_name, summary.details
        traffic = {
            "records per s": self.rate(details.records),
            "writes that failed": self.loop.send_errors,
        }
        return [
            port_task(name, details, traffic, self.wire_picture()),
            diagnostics.status(name, *details.computer),
            diagnostics.status(name, *details.heartbeat),
            memory_task(name, details, self._progress),
        ]

    # -- inside ---------------------------------------------------------------------------------

    def _dump_started(self, event: events.DumpStarted, stamp: Time) -> None:
        wanted = self.offered.dump_paths.pop(event.token, "")
        now = datetime.datetime.now(datetime.timezone.utc)
        path = self.files.start(event.memory, event.suffix, wanted, now)
        self.get_logger().info(f"{event.memory} dump begins, to {path}")

    def _dump_finished(self, event: events.DumpFinished, stamp: Time) -> None:
        result = self.files.finish(event.complete)
        if event.token:
            self.offered.dump_results[event.token] = result
        text = f"{event.text}; {result.failure or f'in {result.path}'}"
        if result.failure or not event.complete:
            self.get_logger().warning(text)
        else:
            self.get_logger().info(text)
