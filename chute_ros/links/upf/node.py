"""A Flyfire UPF parachute on a DroneCAN bus."""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time
from chute_msgs.msg import ActionReport, TriggerStatus, VehicleState
from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros.links.upf.allocation_file import AllocationFile
from chute_ros.links.upf.diagnostics import allocation_task, bus_task, details_of
from chute_ros.links.upf.parameters import PARAMETERS, UpfParameters, config_from
from chute_ros.links.upf.protocol.config import AllocatorUse
from chute_ros.links.upf.protocol.events import TriggerChanged
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.links.upf.runtime import UpfRuntime
from chute_ros.links.upf.services import UpfServices
from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.ros import diagnostics, messages, qos, two_clocks
from chute_ros.ros.device_node import DeviceNode
from chute_ros.ros.kept_file import Newest
from chute_ros.runtime.device import Summary
from chute_ros.settings import settings_from
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


class UpfCanNode(DeviceNode):
    """The node upf_can."""

    def __init__(self, **options: Any) -> None:
        super().__init__("upf_can", PARAMETERS, **options)
        name = self.get_fully_qualified_name()
        address = parse_can_address(self.values["connection"], self.values["bitrate"])
        types = load_data_types(self.values["dsdl_path"], "parameter dsdl_path")
        self._file = AllocationFile(self.values["allocation_table_file"], name)
        settings = settings_from(UpfParameters, self.values).runtime
        gives_ids = settings.link.allocator is not AllocatorUse.NO
        table = self._file.load() if gives_ids else {}
        utc_offset = two_clocks.wall_at(0.0) * 1e-9
        runtime = UpfRuntime(self.get_name(), settings, self, details_of)
        self.carry(runtime)
        link = UpfLink(config_from(settings.link, table, name, utc_offset), types)
        self._wire = make_can_wire(address)
        self.loop = WireLoop(link, self._wire, self.deliver)
        self._trigger_publisher = self.create_publisher(
            TriggerStatus, "upf/trigger_status", qos.STATUS
        )
        self.follow(TriggerChanged, self._publish_trigger)
        self.follow(KeepTable, lambda one, at: self._tables.give(one))
        self.create_subscription(
            VehicleState,
            "vehicle/state",
            lambda one: runtime.heard_vehicle(messages.vehicle_state_from(one)),
            qos.newest(qos.STATUS),
        )
        self.create_subscription(
            ActionReport,
            "safety/action",
            lambda one: runtime.heard_action(messages.action_told_from(one)),
            qos.DECISION,
        )
        UpfServices(self)
        # Its thread keeps us alive: not before all that may end the start.
        self._tables = Newest(self._keep, "node ids")
        self.at_end.callback(self._tables.close)
        self.begin()

    # -- what DeviceNode asks for ---------------------------------------------------------------

    def diagnose(self, summary: Summary) -> list[DiagnosticStatus]:
        assert self.loop is not None
        name, details = self.diagnostic_name, summary.details
        traffic = {
            "transfers received": details.received,
            "transfers received per s": self.rate(details.received),
            "transfers sent": details.sent,
            "frames that could not be sent": self.loop.send_errors,
            **{f"bad packets: {why}": n for why, n in sorted(self._wire.counts.items())},
        }
        return [
            bus_task(name, details, traffic, self.wire_picture()),
            *(diagnostics.status(name, *task) for task in details.tasks),
            allocation_task(name, details, str(self._file.path)),
        ]

    # -- inside ---------------------------------------------------------------------------------

    def _publish_trigger(self, event: TriggerChanged, stamp: Time) -> None:
        state = _TRIGGER_STATES.get(event.picture["state"], TriggerStatus.UNKNOWN)
        message = TriggerStatus(link=self.get_name(), **{**event.picture, "state": state})
        message.header.stamp = self.wall_at(event.received)
        self._trigger_publisher.publish(message)

    def _keep(self, event: KeepTable) -> None:
        """In a thread of its own: to be sure that it is on the disk may take long."""
        try:
            self._file.save(event.table)
        except OSError as error:
            # Without a kept table nobody gets a node id: the device asks again and again.
            self.get_logger().error(
                f"the table of node ids cannot be saved, no id is given out: {error}",
                throttle_duration_sec=5.0,
            )
            return
        self.get_logger().info(f"node ids saved: {sorted(event.table.values())}")
        if (loop := self.loop) is not None:
            loop.call(lambda link, now: link.table_kept(event.number, now))
