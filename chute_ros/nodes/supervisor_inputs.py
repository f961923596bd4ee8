"""What comes to the supervisor on topics, as inputs of its core."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from builtin_interfaces.msg import Time
from chute_msgs.msg import ActionReport, LinkHeartbeat, ParachuteStatus, SafetyRequest
from rclpy.clock import Clock
from rclpy.node import Node

from chute_ros.nodes import messages, qos
from chute_ros.nodes.flight_recorder import FlightRecorder
from chute_ros.nodes.supervisor_health import Health
from chute_ros.runtime.supervisor_inputs import input_of
from chute_ros.supervisor import inputs
from chute_ros.supervisor.config import SupervisorConfig

#: Links of which it is said that they ask for what does not exist: made-up names must not grow us.
MOST_MISASKED = 64


class SupervisorInputs:
    """turn: the loop's, which takes an input."""

    def __init__(
        self,
        node: Node,
        config: SupervisorConfig,
        wall: Clock,
        recorder: FlightRecorder,
        health: Health,
        turn: Callable[[inputs.Input], None],
    ) -> None:
        self._node, self._config, self._wall = node, config, wall
        self._recorder, self._turn = recorder, turn
        #: Of the newest heartbeat of each link.
        self.stamps: dict[str, Time] = {}
        self._misasked: set[str] = set()
        for kind, topic, read, profile in (
            (LinkHeartbeat, "safety/heartbeat", self._heartbeat, qos.newest(qos.STATUS)),
            (ParachuteStatus, "parachute/status", self._parachute, qos.newest(qos.STATUS)),
            (ActionReport, "safety/action", self._action, qos.DECISION),
            (SafetyRequest, "safety/request", self._request, qos.STATUS),
        ):
            heard = partial(self._heard, topic, read)
            events = health.watch(topic)
            node.create_subscription(kind, topic, heard, profile, event_callbacks=events)

    def _heard(self, topic: str, read: Callable[[Any], inputs.Input | None], message: Any) -> None:
        self._recorder.message(topic, message)
        one = read(message)
        if one is not None:
            self._turn(one)

    def _heartbeat(self, message: LinkHeartbeat) -> inputs.Input | None:
        if message.supervisor:
            return None
        if message.link in self._config.links:
            self.stamps[message.link] = message.header.stamp
        sent = messages.seconds(message.header.stamp)
        difference = messages.seconds(self._wall.now().to_msg()) - sent if sent else math.nan
        return input_of(messages.device_beat_from(message), difference)

    def _parachute(self, message: ParachuteStatus) -> inputs.Input:
        return inputs.ParachuteReport(message.link, messages.parachute_from(message))

    def _action(self, message: ActionReport) -> inputs.Input:
        return messages.action_told_from(message).report

    def _request(self, message: SafetyRequest) -> inputs.Input | None:
        if (asked := messages.device_request_from(message)) is not None:
            return input_of(asked, math.nan)
        device = f"{message.link} {message.device}".strip()
        if message.link not in self._misasked and len(self._misasked) < MOST_MISASKED:
            self._misasked.add(message.link)
            self._node.get_logger().error(
                f"{device} asks for {message.request}: need KILL 1, FLIGHT_BLOCK 2 or "
                "FLIGHT_BLOCK_RELEASE 3 (said once for each link)"
            )
        return None
