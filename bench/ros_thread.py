"""A ROS node of the measuring process, in a thread of its own."""

from __future__ import annotations

import threading

from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node


class RosThread:
    """name, namespace: of the node. Its subclass adds to it before it is started."""

    def __init__(self, name: str, namespace: str = "") -> None:
        self._context = Context()
        self._context.init()
        self.node = Node(name, namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def start(self) -> None:
        """From now on it listens."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._context.try_shutdown()
        if self._thread.is_alive():
            self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass
