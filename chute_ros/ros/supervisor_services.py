"""The supervisor's services: there only while it leads, so that a caller reaches the one that
decides."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from typing import Any

from chute_msgs.srv import Arm, Deploy, Kill, SetMode
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.node import Node
from rclpy.service import Service
from rclpy.task import Future
from rclpy.type_support import check_for_type_support
from std_srvs.srv import Trigger

from chute_ros.ros import messages
from chute_ros.supervisor import inputs

#: Makes an input of a token, and gets the answer.
Ask = Callable[[Callable[[int], inputs.Input], Callable[[inputs.Finish], None]], None]
_EPOCH = date(1970, 1, 1).toordinal()


class SupervisorServices:
    """ask: asks the core, and has the answer given to who waits for it."""

    def __init__(self, node: Node, wall: Clock, ask: Ask) -> None:
        self._node, self._wall, self._ask_core = node, wall, ask
        # A service that awaits its outcome must not keep the decision loop from running.
        self._group = ReentrantCallbackGroup()
        self._offers = (
            (Arm, "safety/arm", self._arm),
            (Deploy, "safety/deploy", self._deploy),
            (Kill, "safety/kill", self._kill),
            (Trigger, "safety/reset", self._reset),
            (SetMode, "safety/set_mode", self._set_mode),
        )
        for kind, _, _ in self._offers:
            # Now, not at a takeover: it opens files.
            check_for_type_support(kind)
        self._services: list[Service] = []
        self._calls = 0
        self._open = False

    def open(self) -> None:
        """Offer them. What the system does not allow now is tried again by tidy: the one that
        leads must decide all the same."""
        self._open = True
        for kind, name, callback in self._offers[len(self._services) :]:
            served = self._counted(name, callback)
            try:
                service = self._node.create_service(kind, name, served, callback_group=self._group)
            except Exception as error:  # noqa: BLE001 - the middleware names none
                text = f"cannot offer {name}: {error}; trying again"
                self._node.get_logger().error(text, throttle_duration_sec=1.0)
                return
            self._services.append(service)

    def close(self) -> None:
        """Another decides now. Whoever waits still gets an answer: tidy ends them."""
        self._open = False

    def tidy(self) -> None:
        """Called often: offer what is still missing, or take the services away once nobody waits
        at them any more."""
        if self._open:
            self.open()
        elif not self._calls:
            for service in self._services:
                self._node.destroy_service(service)
            self._services.clear()

    def _counted(
        self, name: str, callback: Callable[[Any, Any], Any]
    ) -> Callable[[Any, Any], Any]:
        async def served(request: Any, response: Any) -> Any:
            self._calls += 1
            try:
                answer = await callback(request, response)
            finally:
                self._calls -= 1
            # What a person did is told whatever came of it.
            log = self._node.get_logger()
            text = messages.answered(name, request, response)
            log.info(text) if response.success else log.warning(text)
            return answer

        return served

    async def _ask(self, make: Callable[[int], inputs.Input]) -> inputs.Finish:
        future = Future()
        self._ask_core(make, future.set_result)
        end: inputs.Finish = await future
        return end

    async def _arm(self, request: Any, response: Any) -> Any:
        today = date.fromtimestamp(messages.seconds(self._wall.now().to_msg()))
        day = max(0, today.toordinal() - _EPOCH)
        end = await self._ask(lambda t: inputs.ArmRequest(t, request.arm, request.triggers, day))
        response.success, response.message = end.success, end.message
        return response

    async def _deploy(self, request: Any, response: Any) -> Any:
        end = await self._ask(lambda t: inputs.DeployRequest(t, request.force, request.reason))
        response.success, response.accepted = end.success, end.accepted
        response.message = end.message
        return response

    async def _kill(self, request: Any, response: Any) -> Any:
        reason = request.reason or "no reason given"
        kill_only = request.kill_only
        end = await self._ask(lambda t: inputs.KillRequest(t, "operator", reason, kill_only))
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
        force, why = request.force, request.reason
        end = await self._ask(lambda t: inputs.ModeRequest(t, mode, force, why))
        response.success, response.message = end.success, end.message
        return response
