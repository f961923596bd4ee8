"""The safety supervisor: carries its core's decisions out into ROS and the inputs back in.

One loop does it all: every message and request becomes an input of the core; one timer, set to the
core's next deadline, wakes it when nothing comes. Its heartbeat comes from that loop alone.
"""

from __future__ import annotations

import time
from itertools import count
from operator import attrgetter
from typing import Any

from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyDecision,
    SafetyRequest,
    SafetyState,
    VehicleState,
)
from chute_msgs.srv import Arm, Deploy, Kill, SetMode
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from chute_ros.nodes import diagnostics, messages, qos
from chute_ros.nodes.device_arming import DeviceArming
from chute_ros.nodes.parameters import declare
from chute_ros.nodes.supervisor_messages import decisions_task, state_message
from chute_ros.nodes.supervisor_parameters import PARAMETERS, config_from
from chute_ros.supervisor import inputs
from chute_ros.supervisor.core import next_deadline, update
from chute_ros.supervisor.state import State

HEARTBEAT_INTERVAL = 0.1  # s
STATE_INTERVAL = 1.0  # s, at the latest
#: Links of which it is said that they ask for what does not exist: made-up names must not grow us.
MOST_MISASKED = 64


class SafetySupervisorNode(Node):
    """The node safety_supervisor."""

    def __init__(self, **options: Any) -> None:
        super().__init__("safety_supervisor", **options)
        self.values = declare(self, PARAMETERS)
        self.config = config_from(self.values)
        #: With the namespace, so that the diagnostics of several vehicles can be told apart.
        self.diagnostic_name = self.get_fully_qualified_name().lstrip("/")
        self.wall = Clock(clock_type=ClockType.SYSTEM_TIME)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        now = time.monotonic()
        # Rises from start to start; a device node that knows a higher one makes us go on above it.
        epoch = max(1, int(time.time()) & 0xFFFFFFFF)
        self.state = State(epoch, now, mode=inputs.Mode[self.values["mode"]])
        self._tokens = count(1)
        self._waiting: dict[int, Future] = {}
        self._misasked: set[str] = set()
        self._arming = DeviceArming(self, self.config.deploy_links, self._turn)
        self._seq = count()
        self._beat_at = now
        self._state_at = now
        self._latest = 0.0
        self._published: State | None = None
        self._decision_publisher = self.create_publisher(
            SafetyDecision, "safety/decision", qos.DECISION
        )
        self._state_publisher = self.create_publisher(SafetyState, "safety/state", qos.LATCHED)
        self._heartbeat_publisher = self.create_publisher(
            LinkHeartbeat, "safety/heartbeat", qos.STATUS
        )
        self._diagnostics_publisher = self.create_publisher(
            DiagnosticArray, "/diagnostics", qos.STATUS
        )
        for kind, topic, callback, profile in (
            (LinkHeartbeat, "safety/heartbeat", self._heartbeat, qos.STATUS),
            (ParachuteStatus, "parachute/status", self._parachute, qos.STATUS),
            (VehicleState, "vehicle/state", self._vehicle, qos.STATUS),
            (ActionReport, "safety/action", self._action, qos.DECISION),
            (SafetyRequest, "safety/request", self._device_request, qos.STATUS),
        ):
            self.create_subscription(kind, topic, callback, profile)
        # A service that awaits its outcome must not keep the decision loop from running.
        group = ReentrantCallbackGroup()
        for kind, name, callback in (
            (Arm, "safety/arm", self._arm),
            (Deploy, "safety/deploy", self._deploy),
            (Kill, "safety/kill", self._kill),
            (Trigger, "safety/reset", self._reset),
            (SetMode, "safety/set_mode", self._set_mode),
        ):
            self.create_service(kind, name, callback, callback_group=group)
        self.create_timer(1.0, self._diagnose, clock=self._steady)
        self._timer = self.create_timer(HEARTBEAT_INTERVAL, self._turn, clock=self._steady)
        self._turn()

    # -- the loop -------------------------------------------------------------------------------

    def _turn(self, *new: inputs.Input) -> None:
        """Give the core what came, do what it says, sleep until its next deadline."""
        now = time.monotonic()
        self.state, outputs = update(self.config, self.state, new, now)
        for output in outputs:
            self._do(output, now)
        self._arming.give_up(now)
        if now >= self._beat_at:
            self._beat(now)
        if self._changed() or now >= self._state_at:
            self._publish_state(now)
        wake = min(next_deadline(self.config, self.state, now), self._beat_at, self._state_at)
        self._timer.timer_period_ns = max(1_000_000, int((wake - time.monotonic()) * 1e9))
        self._timer.reset()

    def _do(self, output: inputs.Output, now: float) -> None:
        if isinstance(output, inputs.Decide):
            self._publish_decision(output)
        elif isinstance(output, inputs.Finish):
            future = self._waiting.pop(output.token, None)
            if future is not None:
                future.set_result(output)
        elif isinstance(output, inputs.ArmDevices):
            self._arming.begin(output, now)
        else:
            log = self.get_logger()
            log.error(output.text) if output.alarm else log.info(output.text)

    def _publish_decision(self, output: inputs.Decide) -> None:
        decision = output.decision
        self._decision_publisher.publish(messages.decision(decision, self.wall.now().to_msg()))
        if not output.again:
            shadow = " (SHADOW, not sent)" if decision.shadow else ""
            self.get_logger().warning(
                f"decision {decision.epoch}.{decision.id} {decision.action.name}{shadow} by rule "
                f"'{decision.rule}' to {', '.join(decision.targets)}: "
                f"{'; '.join(decision.reasons)}"
            )

    # -- inputs ---------------------------------------------------------------------------------

    def _heartbeat(self, message: LinkHeartbeat) -> None:
        if not message.supervisor:
            state = messages.link_state(message)
            self._turn(
                inputs.LinkHeartbeat(message.link, state, message.device_healthy, message.seq)
            )

    def _parachute(self, message: ParachuteStatus) -> None:
        self._turn(
            inputs.ParachuteReport(
                message.link,
                message.device,
                message.deployed,
                tuple(message.faults),
                message.link_state == ParachuteStatus.LINK_OK,
            )
        )

    def _vehicle(self, message: VehicleState) -> None:
        self._turn(inputs.VehicleReport(messages.vehicle_state_from(message)))

    def _action(self, message: ActionReport) -> None:
        self._turn(
            inputs.ActionReport(
                message.epoch,
                message.id,
                message.link,
                messages.outcome(message),
                message.detail,
                message.newest_epoch,
                message.newest_id,
            )
        )

    def _device_request(self, message: SafetyRequest) -> None:
        device, reason = f"{message.link} {message.device}".strip(), message.reason
        if message.request == SafetyRequest.KILL:
            self._turn(inputs.KillRequest(0, device, reason))
        elif message.request in (SafetyRequest.FLIGHT_BLOCK, SafetyRequest.FLIGHT_BLOCK_RELEASE):
            block = message.request == SafetyRequest.FLIGHT_BLOCK
            self._turn(inputs.BlockRequest(message.link, message.device, block, reason))
        elif message.link not in self._misasked and len(self._misasked) < MOST_MISASKED:
            self._misasked.add(message.link)
            self.get_logger().error(
                f"{device} asks for {message.request}: need KILL 1, FLIGHT_BLOCK 2 or "
                "FLIGHT_BLOCK_RELEASE 3 (said once for each link)"
            )

    # -- services -------------------------------------------------------------------------------

    async def _ask(self, make: Any) -> inputs.Finish:
        token = next(self._tokens)
        self._waiting[token] = future = Future()
        self._turn(make(token))
        return await future

    async def _arm(self, request: Any, response: Any) -> Any:
        end = await self._ask(lambda t: inputs.ArmRequest(t, request.arm, request.triggers))
        response.success, response.message = end.success, end.message
        return response

    async def _deploy(self, request: Any, response: Any) -> Any:
        end = await self._ask(lambda t: inputs.DeployRequest(t, request.force, request.reason))
        response.success, response.accepted = end.success, end.accepted
        response.message = end.message
        return response

    async def _kill(self, request: Any, response: Any) -> Any:
        reason = request.reason or "no reason given"
        end = await self._ask(lambda t: inputs.KillRequest(t, "operator", reason))
        response.success, response.accepted = end.success, end.accepted
        response.message = end.message
        return response

    async def _reset(self, request: Any, response: Any) -> Any:
        end = await self._ask(inputs.ResetRequest)
        response.success, response.message = end.success, end.message
        return response

    async def _set_mode(self, request: Any, response: Any) -> Any:
        if request.mode not in inputs.Mode._value2member_map_:
            response.message = f"mode {request.mode}: need ACTIVE 0, SHADOW 1 or INHIBITED 2"
            return response
        mode = inputs.Mode(request.mode)
        self.get_logger().warning(f"set_mode {mode.name}: {request.reason!r}")
        end = await self._ask(lambda t: inputs.ModeRequest(t, mode, request.force))
        response.success, response.message = end.success, end.message
        return response

    # -- outputs --------------------------------------------------------------------------------

    def _beat(self, now: float) -> None:
        self._latest = now - self._beat_at
        self._beat_at = max(self._beat_at + HEARTBEAT_INTERVAL, now)
        message = LinkHeartbeat(
            link=self.get_name(),
            link_state=LinkHeartbeat.LINK_OK,
            seq=next(self._seq) % 2**32,
            device_healthy=True,
            age=0.0,
            supervisor=True,
        )
        message.header.stamp = self.wall.now().to_msg()
        self._heartbeat_publisher.publish(message)

    def _changed(self) -> bool:
        before, now = self._published, self.state
        told = attrgetter("stage", "mode", "next_id", "alarms", "device_blocks")
        return before is None or told(before) != told(now)

    def _publish_state(self, now: float) -> None:
        self._published, self._state_at = self.state, now + STATE_INTERVAL
        stamp = self.wall.now().to_msg()
        self._state_publisher.publish(state_message(self.config, self.state, now, stamp))

    def _diagnose(self) -> None:
        task = decisions_task(
            self.diagnostic_name, self.config, self.state, time.monotonic(), self._latest
        )
        self._diagnostics_publisher.publish(diagnostics.array(self.wall.now().to_msg(), [task]))
