"""Topics of the supervisor, given to its runtime."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from chute_msgs.msg import ActionReport, LinkHeartbeat, ParachuteStatus, SafetyRequest

from chute_ros.ros import messages, qos
from chute_ros.ros.flight_recorder import FlightRecorder
from chute_ros.ros.supervisor_health import Health
from chute_ros.supervisor import inputs

if TYPE_CHECKING:
    from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

#: Links of which it is said that they ask for what does not exist: made-up names must not grow us.
MOST_MISASKED = 64


class SupervisorInputs:
    """run: has a step(now) of the runtime done."""

    def __init__(
        self,
        node: SafetySupervisorNode,
        recorder: FlightRecorder,
        health: Health,
        run: Callable[[Callable[[float], None]], None],
    ) -> None:
        self._node, self._recorder, self._run = node, recorder, run
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

    def _heard(self, topic: str, read: Callable[[Any], None], message: Any) -> None:
        self._recorder.message(topic, message)
        read(message)

    def _give(self, one: Any) -> None:
        self._run(lambda now: self._node.runtime.heard(one, math.nan, now))

    def _heartbeat(self, message: LinkHeartbeat) -> None:
        if message.supervisor:
            return
        stamp = messages.nanoseconds(message.header.stamp)
        difference = self._node.difference(message.header.stamp) if stamp else math.nan
        beat = messages.device_beat_from(message)
        self._run(lambda now: self._node.runtime.heard_beat(beat, stamp, difference, now))

    def _parachute(self, message: ParachuteStatus) -> None:
        self._give(inputs.ParachuteReport(message.link, messages.parachute_from(message)))

    def _action(self, message: ActionReport) -> None:
        self._give(messages.action_told_from(message))

    def _request(self, message: SafetyRequest) -> None:
        if (asked := messages.device_request_from(message)) is not None:
            self._give(asked)
        elif message.link not in self._misasked and len(self._misasked) < MOST_MISASKED:
            self._misasked.add(message.link)
            device = f"{message.link} {message.device}".strip()
            self._node.get_logger().error(
                f"{device} requests {message.request}: need KILL 1, FLIGHT_BLOCK 2 or "
                "FLIGHT_BLOCK_RELEASE 3 (reported once for each link)"
            )
