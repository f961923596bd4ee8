"""The black box as its node sees it: opened by the parameters, reported in log and diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from chute_ros.ros import diagnostics
from chute_ros.ros.black_box import BlackBox
from chute_ros.ros.box_folder import BoxFolder
from chute_ros.ros.recorded_topics import BESIDES, recorded_topics


class FlightRecorder:
    """values: the node's parameters. Without black_box it records nothing and says nothing."""

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        self._node = node
        self._name = node.get_fully_qualified_name()
        self.box: BlackBox | None = None
        self._told = ""
        #: Keep a message on a topic of the contract (relative name), and keep a turn of the core:
        #: those of the black box itself, as nothing else must be in the decision loop's way.
        self.message = self.turn = _nothing
        if values["black_box"]:
            folder = BoxFolder(
                values["black_box_folder"], self._name, values["black_box_most_files"]
            )
            limit = values["black_box_file_limit"] * 1_000_000
            self.box = BlackBox(folder, recorded_topics(node), limit)
            self.message, self.turn = self.box.message, self.box.turn
            for topic, (kind, profile) in BESIDES.items():
                keep = partial(self.box.message, topic)
                # As it comes from the wire: it is only kept, so nothing is taken apart.
                node.create_subscription(kind, topic, keep, profile, raw=True)

    def tasks(self) -> list[DiagnosticStatus]:
        """For /diagnostics, each second. What is missing in the files stays a warning. A trouble
        that begins or ends goes to the log, too."""
        box = self.box
        if box is None:
            return []
        trouble = box.trouble
        level, text = diagnostics.OK, "recording"
        if trouble:
            level, text = diagnostics.ERROR, trouble
        elif box.dropped:
            level, text = diagnostics.WARN, f"recording, {box.dropped} entries are missing"
        if trouble and not self._told:
            self._node.get_logger().error(trouble)
        elif self._told and not trouble:
            self._node.get_logger().warning(f"the black box writes again: {text}")
        self._told = trouble
        name = self._name.lstrip("/")
        return [diagnostics.status(name, "black box", level, text, box.counts(), "")]

    def close(self) -> None:
        """Write what waits and end the file."""
        if self.box is not None:
            self.box.close()


def _nothing(*_: Any) -> None:
    """There is no black box."""
