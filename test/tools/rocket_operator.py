"""The operator of a rocket, for tests: sends commands to its flight computer."""

from __future__ import annotations

from chute_msgs.srv import UmbilicalCommand
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

#: How long an answer may take on a busy machine, s.
_PATIENCE = 30.0


def commands_to(namespace):
    """A generator for a fixture; yields command(name, force): the answer of the umbilical."""
    executor, node = SingleThreadedExecutor(), Node("operator", namespace=namespace)
    executor.add_node(node)
    client = node.create_client(UmbilicalCommand, "umbilical/command")

    def send(name, force=False):
        assert client.wait_for_service(timeout_sec=_PATIENCE)
        request = UmbilicalCommand.Request(command=name, force=force, reason="test")
        future = client.call_async(request)
        executor.spin_until_future_complete(future, timeout_sec=_PATIENCE)
        return future.result()

    yield send
    executor.shutdown()
    node.destroy_node()
