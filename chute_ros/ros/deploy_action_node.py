"""The action safety/deploy_action, which is the service safety/deploy with feedback.

It is a node of its own, and a client of the supervisor as any other: nothing is added to the
process that decides, and there is no second way to fire.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from chute_msgs.action import Deploy
from chute_msgs.msg import ActionReport, SafetyDecision
from chute_msgs.srv import Deploy as DeployService
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from chute_ros.ros import qos
from chute_ros.ros.deploy_progress import DeployProgress
from chute_ros.ros.parameters import settings_taken
from chute_ros.ros.plain_border import PlainLogger, hearing_plainly, with_plain_texts

#: The answer comes sooner (s), whatever the supervisor's parameters are in practice; without one
#: the supervisor that had the call has ended.
ANSWER_WITHIN = 120.0
#: How long a result is kept for who asks for it late, s.
_RESULT_KEPT = 60


class DeployActionNode(Node):
    """The node deploy_action. started_with: the arguments of its process."""

    def __init__(self, started_with: Sequence[str] = (), **options: Any) -> None:
        super().__init__("deploy_action", **options)
        self._logger = PlainLogger(self.get_logger().name)
        self.settings_taken = settings_taken(self, [], started_with)
        # Several may wait at once.
        group = ReentrantCallbackGroup()
        self._client = self.create_client(DeployService, "safety/deploy", callback_group=group)
        #: Goals that are under way, each with what it was told.
        self._goals: list[tuple[Any, DeployProgress]] = []
        #: Until when an answer is waited for, monotonic s.
        self._waiting: dict[Future, float] = {}
        for kind, topic, hear in (
            (SafetyDecision, "safety/decision", self._decided),
            (ActionReport, "safety/action", self._reported),
        ):
            self.create_subscription(kind, topic, hearing_plainly(hear), qos.DECISION)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0, self._check_waiting, clock=steady)
        self._server = ActionServer(
            self,
            Deploy,
            "safety/deploy_action",
            self._deploy,
            callback_group=group,
            cancel_callback=self._cancelled,
            result_timeout=_RESULT_KEPT,
        )

    def destroy_node(self) -> None:
        """The server first, as ROS wants it."""
        self._server.destroy()
        super().destroy_node()

    async def _deploy(self, goal: Any) -> Deploy.Result:
        request = with_plain_texts(goal.request)
        self.get_logger().warning(
            f"safety/deploy_action called (force={request.force}): {request.reason!r}"
        )
        under_way = goal, DeployProgress()
        self._goals.append(under_way)
        try:
            answer = await self._answer(request)
        finally:
            self._goals.remove(under_way)
        result = with_plain_texts(
            Deploy.Result(success=answer.success, accepted=answer.accepted, message=answer.message)
        )
        goal.succeed() if result.success else goal.abort()
        self.get_logger().info(f"safety/deploy_action answered: {result.message}")
        return result

    async def _answer(self, request: Any) -> DeployService.Response:
        """The service's; one of our own if there is none."""
        if not self._client.service_is_ready():
            # A call that waits for a supervisor would release when nobody expects it any more.
            return _none("nothing was ordered: no supervisor offers safety/deploy")
        call = DeployService.Request(force=request.force, reason=request.reason)
        future = self._client.call_async(call)
        self._waiting[future] = time.monotonic() + ANSWER_WITHIN
        answer: DeployService.Response | None = await future
        self._waiting.pop(future, None)
        return answer or _none(
            "the supervisor that received the order has ended without an answer: safety/state "
            "shows what became of it"
        )

    def _check_waiting(self) -> None:
        ended = not self._client.service_is_ready()
        for future, until in list(self._waiting.items()):
            if ended or time.monotonic() > until:
                self._client.remove_pending_request(future)
                future.set_result(None)

    def _cancelled(self, goal: Any) -> CancelResponse:
        self.get_logger().warning("a cancel is refused: a release cannot be taken back")
        return CancelResponse.REJECT

    def _decided(self, message: SafetyDecision) -> None:
        for goal, progress in self._goals:
            _tell(goal, progress.decided(message))

    def _reported(self, message: ActionReport) -> None:
        for goal, progress in self._goals:
            _tell(goal, progress.reported(message))


def _none(why: str) -> DeployService.Response:
    return DeployService.Response(success=False, accepted=False, message=why)


def _tell(goal: Any, feedback: Deploy.Feedback | None) -> None:
    if feedback is not None:
        goal.publish_feedback(feedback)
