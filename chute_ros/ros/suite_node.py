"""Base of every node of the suite: parameters, clocks, a heartbeat, diagnostics, and an end."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from chute_msgs.msg import LinkHeartbeat
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from chute_ros.ros import diagnostics, messages, qos, two_clocks
from chute_ros.ros.parameters import declare, settings_taken
from chute_ros.ros.plain_border import (
    PlainLogger,
    PlainPublisher,
    hearing_plainly,
    is_exempt,
    serving_plainly,
)
from chute_ros.settings import Parameter


class SuiteNode(Node):
    """Base of all nodes. The subclass closes at_end when it is destroyed. started_with: the
    arguments of its process, where it has one of its own."""

    def __init__(
        self,
        name: str,
        parameters: tuple[Parameter, ...],
        started_with: Sequence[str] = (),
        **options: Any,
    ) -> None:
        #: What is done at its end. Before ROS knows the node: Kilted destroys what it knows, also
        #: one that a parameter keeps from being built.
        self.at_end = ExitStack()
        super().__init__(name, **options)
        self._logger = PlainLogger(self.get_logger().name)
        #: What it took from where, in words.
        self.settings_taken = settings_taken(self, [one.name for one in parameters], started_with)
        self.values = declare(self, parameters)
        if profile := self.values.get("profile"):
            self.settings_taken += f"; profile {profile}"
        # The wall clock only stamps, whatever use_sim_time says.
        self.wall = Clock(clock_type=ClockType.SYSTEM_TIME)
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        #: With the namespace, so that the diagnostics of several vehicles can be told apart.
        self.diagnostic_name = self.get_fully_qualified_name().lstrip("/")
        self.heartbeat_publisher = self.create_publisher(
            LinkHeartbeat, "safety/heartbeat", qos.STATUS
        )
        self.diagnostics_publisher = diagnostics.DiagnosticsPublisher(self)

    # -- the border: texts that pass it are plain ------------------------------------------------

    def create_publisher(self, kind: Any, topic: str, profile: Any, **options: Any) -> Any:
        """As of every node; what is published has plain texts."""
        options.setdefault("publisher_class", PlainPublisher)
        return super().create_publisher(kind, topic, profile, **options)

    def create_subscription(
        self, kind: Any, topic: str, callback: Any, profile: Any, **options: Any
    ) -> Any:
        """As of every node; what is heard has plain texts, unless it is raw."""
        as_it_is = options.get("raw", False) or is_exempt(kind)
        heard = callback if as_it_is else hearing_plainly(callback)
        return super().create_subscription(kind, topic, heard, profile, **options)

    def create_service(self, kind: Any, name: str, callback: Any, **options: Any) -> Any:
        """As of every node; requests and responses have plain texts."""
        served = callback if is_exempt(kind) else serving_plainly(callback)
        return super().create_service(kind, name, served, **options)

    # -- what all nodes do -----------------------------------------------------------------------

    def stamp(self) -> Any:
        """The wall clock, for headers."""
        return self.wall.now().to_msg()

    def wall_at(self, instant: float) -> Any:
        """The wall clock at an instant of the monotonic clock (s); NaN, never: 0."""
        return messages.stamp_of(two_clocks.wall_at(instant))

    def difference(self, stamp: Any) -> float:
        """The wall clock here less a stamp, s."""
        return messages.seconds(self.stamp()) - messages.seconds(stamp)
