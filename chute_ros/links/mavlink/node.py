"""A parachute on a MAVLink network, and the autopilot beside it."""

from __future__ import annotations

import json
from typing import Any

from builtin_interfaces.msg import Time
from chute_msgs.msg import VehicleState
from chute_msgs.srv import (
    GetInfo,
    ParachuteAction,
    RequestMessage,
    SetMessageInterval,
    SetTriggers,
)
from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.links.mavlink.diagnostics import MavlinkDetails, details_of, link_task, tasks
from chute_ros.links.mavlink.parameters import PARAMETERS, MavlinkParameters
from chute_ros.links.mavlink.protocol.goals import impossible_masks
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.protocol.parachute import component_information
from chute_ros.links.mavlink.runtime import MavlinkRuntime
from chute_ros.links.mavlink.signing_memory import SigningMemory
from chute_ros.protocol.events import RequestFinished
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.ros import messages, qos
from chute_ros.ros.battery import BatteryPublisher
from chute_ros.ros.device_node import DeviceNode
from chute_ros.runtime.device import Summary
from chute_ros.runtime.topics import VehicleTold
from chute_ros.settings import settings_from
from chute_ros.transport.address import parse_address
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire import make_wire

#: COMPONENT_INFORMATION_BASIC.
_INFORMATION: int = dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC


class MavlinkParachuteNode(DeviceNode):
    """The node mavlink_parachute."""

    def __init__(self, **options: Any) -> None:
        super().__init__("mavlink_parachute", PARAMETERS, **options)
        address = parse_address(self.values["connection"])
        settings = settings_from(MavlinkParameters, self.values).runtime
        self._signing = SigningMemory(self, self.values)
        # Once the newest times are known.
        self.at_end.callback(self._signing.finish)
        #: Why take-off is forbidden, as it was last told.
        self._doubts: set[str] = set()
        self.carry(MavlinkRuntime(self.get_name(), settings, self, self._details))
        link = MavlinkLink(settings.link, self._signing.signer, self._signing.verifier)
        self.loop = WireLoop(
            link, make_wire(address), self.deliver, frames=lambda: link.received_count
        )
        self._vehicle_publisher = self.create_publisher(VehicleState, "vehicle/state", qos.STATUS)
        self._battery = BatteryPublisher(self)
        self.follow(VehicleTold, self._vehicle)
        self.serve(SetTriggers, "~/set_triggers", self._set_triggers)
        self.serve(ParachuteAction, "~/parachute_action", self._parachute_action)
        self.serve(RequestMessage, "~/request_message", self._request_message)
        self.serve(SetMessageInterval, "~/set_message_interval", self._set_interval)
        self.serve(GetInfo, "~/get_info", self._get_info)
        self.begin()

    # -- what DeviceNode asks for ---------------------------------------------------------------

    def _details(self, link: MavlinkLink, now: float) -> MavlinkDetails:
        self._signing.keep(now)
        return details_of(link, now)

    def parameter_changed(self, name: str, value: Any) -> None:
        if name == "autopilot_message_rate" and self.loop is not None:
            self.loop.call(lambda link, now: link.set_autopilot_message_rate(value, now))

    def diagnose(self, summary: Summary) -> list[DiagnosticStatus]:
        assert self.loop is not None
        name, details = self.diagnostic_name, summary.details
        self._tell_doubts(details.doubts)
        traffic = {
            "frames received": details.received,
            "frames received per s": self.rate(details.received),
            "frames sent": details.sent,
            "send errors": self.loop.send_errors,
        }
        return [
            link_task(name, details, traffic, self.wire_picture()),
            *tasks(name, details, self.values["expect_parachute"]),
            self._signing.task(name),
        ]

    def _vehicle(self, told: VehicleTold, stamp: Time) -> None:
        state = told.report.state
        self._vehicle_publisher.publish(messages.vehicle_state(state, self.wall_at(told.at)))
        self._battery.publish(state, told.at)

    def _tell_doubts(self, doubts: tuple[str, ...]) -> None:
        for doubt in set(doubts) - self._doubts:
            self.get_logger().error(f"forbids take-off: {doubt}")
        self._doubts = set(doubts)

    # -- services -------------------------------------------------------------------------------

    async def _set_triggers(self, request: Any, response: Any) -> Any:
        if why := impossible_masks(request.arm, request.select):
            return _denied(response, why)
        end = await self.request(
            lambda link, token, now: link.set_triggers(
                token, request.arm, request.select, request.device, now
            )
        )
        response.armed_triggers = self._armed_triggers(request.device)
        return _fill(response, end)

    async def _parachute_action(self, request: Any, response: Any) -> Any:
        if request.action > dialect.PARACHUTE_RELEASE:
            why = f"action {request.action}: need DISABLE 0, ENABLE 1 or RELEASE 2"
            return _denied(response, why)
        self.get_logger().warning(
            f"~/parachute_action {request.action} called: {request.reason!r}"
        )
        end = await self.request(
            lambda link, token, now: link.parachute_action(
                token, request.action, request.device, now
            )
        )
        return _fill(response, end)

    async def _request_message(self, request: Any, response: Any) -> Any:
        end = await self._message(request.message_id, request.device)
        if end.data is not None:
            fields = end.data.to_dict().items()
            response.json = json.dumps({name: messages.json_value(v) for name, v in fields})
        return _fill(response, end)

    async def _set_interval(self, request: Any, response: Any) -> Any:
        if request.interval_us < -1:
            why = f"interval_us {request.interval_us}: need microseconds, -1 (off) or 0 (default)"
            return _denied(response, why)
        end = await self.request(
            lambda link, token, now: link.set_message_interval(
                token, request.message_id, request.interval_us, request.device, now
            )
        )
        if end.data is not None:
            response.reported_interval_us = end.data.interval_us
        return _fill(response, end)

    async def _get_info(self, request: Any, response: Any) -> Any:
        end = await self._message(_INFORMATION, request.device)
        response.success, response.message = end.finished.success, end.finished.message
        response.uptime = model.NAN
        if end.data is not None:
            for name, value in vars(component_information(end.data)).items():
                setattr(response, name, value)
        return response

    def _message(self, message_id: int, device: str) -> Any:
        return self.request(
            lambda link, token, now: link.request_message(token, message_id, device, now)
        )

    # -- inside ---------------------------------------------------------------------------------

    def _armed_triggers(self, device: str) -> int:
        """By the newest status that was published; without a device that of the one that was
        asked, the first that is not lost."""
        told = [one for name, one in self.statuses.items() if device in ("", name)]
        heard = [one for one in told if one.link_state is not model.LinkState.LOST]
        return next((int(status.armed_triggers) for status in (*heard, *told)), 0)


def _denied(response: Any, why: str) -> Any:
    response.result, response.message = dialect.MAV_RESULT_DENIED, why
    return response


def _fill(response: Any, end: RequestFinished) -> Any:
    """The fields that all answers to a command share."""
    response.success, response.message = end.finished.success, end.finished.message
    response.result = end.finished.result
    return response
