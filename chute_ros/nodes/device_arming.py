"""Arming through the device nodes: the supervisor calls each one's arm service and waits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from chute_msgs.srv import Arm
from rclpy.node import Node
from rclpy.task import Future

from chute_ros.supervisor import inputs

#: A device node's arm service that has not answered by then is given up, s.
ARM_TIMEOUT = 10.0


class DeviceArming:
    """One round for each order; tell gets the ArmDone once every link has answered."""

    def __init__(self, node: Node, links: tuple[str, ...], tell: Callable[[Any], None]) -> None:
        self._tell = tell
        self._clients = {link: node.create_client(Arm, f"{link}/arm") for link in links}
        self._rounds: dict[int, tuple[inputs.ArmDevices, dict[str, tuple[bool, str]], float]] = {}

    def begin(self, order: inputs.ArmDevices, now: float) -> None:
        """Call the services that the order names."""
        self._rounds[order.token] = (order, {}, now + ARM_TIMEOUT)
        request = Arm.Request(arm=order.arm, triggers=order.triggers)
        for link in order.links:
            client = self._clients[link]
            if not client.service_is_ready():
                self._answered(order.token, link, False, f"its service {link}/arm is not there")
                continue
            future = client.call_async(request)

            def answered(future: Future, link: str = link) -> None:
                answer = future.result()
                self._answered(order.token, link, answer.success, answer.message)

            future.add_done_callback(answered)

    def give_up(self, now: float) -> None:
        """Look at the clock: a link that does not answer has failed."""
        for token, (order, answers, until) in list(self._rounds.items()):
            if now >= until:
                for link in [link for link in order.links if link not in answers]:
                    self._answered(token, link, False, f"no answer within {ARM_TIMEOUT:g} s")

    def _answered(self, token: int, link: str, success: bool, message: str) -> None:
        if token not in self._rounds:
            return
        order, answers, _ = self._rounds[token]
        answers[link] = (success, message)
        if len(answers) < len(order.links):
            return
        del self._rounds[token]
        text = "; ".join(f"{name}: {answers[name][1]}" for name in order.links)
        success = all(answer[0] for answer in answers.values())
        self._tell(inputs.ArmDone(token, order.arm, success, text))
