"""Calls an action of a simulated vehicle that runs: a service of sim_bench."""

from __future__ import annotations

import secrets

import rclpy
from std_srvs.srv import Trigger

from chute_ros.errors import ChuteError
from chute_ros.interrupts import in_one_piece
from chute_ros.ros.middleware import set_up_middleware

#: How long a service may take to be offered, and to answer, s.
_WITHIN = 10.0


class NotDoneError(ChuteError):
    """An action was not done; the text says why."""


def call_action(namespace: str, name: str) -> str:
    """What is done by the action of this name, in words. NotDoneError: it is not done."""
    set_up_middleware()
    rclpy.init(args=[])
    node = rclpy.create_node(f"sim_{secrets.token_hex(4)}", namespace=namespace)
    try:
        client = node.create_client(Trigger, f"sim/{name}")
        if not client.wait_for_service(_WITHIN):
            raise NotDoneError(
                f"{namespace}/sim/{name} is not offered within {_WITHIN:g} s: start a vehicle "
                "that has it (make sim) in the same ROS domain"
            )
        answer = client.call_async(Trigger.Request())
        with in_one_piece():
            rclpy.spin_until_future_complete(node, answer, timeout_sec=_WITHIN)
        if not answer.done():
            raise NotDoneError(f"no answer within {_WITHIN:g} s")
        if not answer.result().success:
            raise NotDoneError(answer.result().message)
        return str(answer.result().message)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
