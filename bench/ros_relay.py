"""What ROS alone costs: the bare relay cut into three rclpy processes, with our topics between.

The same messages and qualities of service as our nodes, and nothing of what our nodes do.
Arguments: bus PORT, decide, or network PORT; then what ROS takes.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable

import rclpy
from chute_msgs.msg import ActionReport, SafetyDecision, SafetyRequest
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from bench.bare_relay import Bus, Network
from chute_ros.ros import qos

_REQUEST = (SafetyRequest, "safety/request")
_DECISION = (SafetyDecision, "safety/decision")
_ACTION = (ActionReport, "safety/action")


def _read(step: Callable[[], None]) -> None:
    """Read a socket for ever, beside the executor."""

    def run() -> None:
        while rclpy.ok():
            step()

    threading.Thread(target=run, daemon=True).start()


def _bus(node: Node, port: int) -> None:
    bus = Bus(port)
    waiting: list[tuple[int, int]] = []
    publisher = node.create_publisher(*_REQUEST, qos.STATUS)

    def step() -> None:
        request = bus.kill_switch()
        if request is not None:
            waiting[:] = [request]
            publisher.publish(
                SafetyRequest(link="upf_can", device="33", request=SafetyRequest.KILL)
            )

    def action(_: ActionReport) -> None:
        if waiting:
            bus.success(*waiting.pop())

    node.create_subscription(*_ACTION, action, qos.DECISION)
    _read(step)


def _decide(node: Node) -> None:
    publisher = node.create_publisher(*_DECISION, qos.DECISION)

    def request(_: SafetyRequest) -> None:
        targets = ["mavlink_parachute"]
        publisher.publish(SafetyDecision(action=SafetyDecision.KILL, targets=targets))

    node.create_subscription(*_REQUEST, request, qos.STATUS)


def _network(node: Node, port: int) -> None:
    network = Network(port)
    publisher = node.create_publisher(*_ACTION, qos.DECISION)

    def step() -> None:
        if network.killed():
            outcome = ActionReport.CONFIRMED
            publisher.publish(ActionReport(action=SafetyDecision.KILL, outcome=outcome))

    node.create_subscription(*_DECISION, lambda _: network.kill(), qos.DECISION)
    _read(step)


def main() -> None:
    """Relay until the end of the process."""
    role = sys.argv[1]
    rclpy.init()
    node = Node(f"relay_{role}")
    if role == "decide":
        _decide(node)
    else:
        {"bus": _bus, "network": _network}[role](node, int(sys.argv[2]))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # the usual ways to end it


if __name__ == "__main__":
    main()
