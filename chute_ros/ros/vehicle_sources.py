"""Sources of the vehicle's picture: topics, merged into one.

With vehicle/state alone, the default, each message is passed on as it came. With other sources
(nav_msgs/Odometry, sensor_msgs/Imu, MAVROS's topics) or several, they are merged by part.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from chute_msgs.msg import VehicleState
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import BatteryState, Imu, NavSatFix
from std_msgs.msg import Float64

from chute_ros import model
from chute_ros.errors import ParameterError
from chute_ros.protocol import vehicle_readings as readings
from chute_ros.protocol.vehicle_merge import (
    IMU,
    MAVROS,
    ODOMETRY,
    TELL_INTERVAL,
    VEHICLE_STATE,
)
from chute_ros.ros import messages, qos
from chute_ros.runtime.vehicle_hearing import VehicleHearing
from chute_ros.settings import Settings, parameter, settings_from
from chute_ros.supervisor.inputs import VehicleReport

SOURCES = (VEHICLE_STATE, ODOMETRY, IMU, MAVROS)


@dataclass(frozen=True)
class VehicleSettings(Settings):
    """The sources of the vehicle's state, and their topics."""

    vehicle_sources: tuple[str, ...] = parameter(
        (VEHICLE_STATE,),
        f"sources of the vehicle's state, the preferred first: {', '.join(SOURCES)}",
    )
    odometry_topic: str = parameter(
        "odometry",
        "nav_msgs/Odometry of source odometry: height above its origin, vertical speed, attitude",
    )
    imu_topic: str = parameter(
        "imu", "sensor_msgs/Imu of source imu: attitude, magnitude of the acceleration"
    )
    mavros_state_topic: str = parameter(
        "mavros/state", "mavros_msgs/State of source mavros: armed, link"
    )
    mavros_extended_state_topic: str = parameter(
        "mavros/extended_state", "mavros_msgs/ExtendedState of source mavros: landed state"
    )
    mavros_battery_topic: str = parameter(
        "mavros/battery",
        "sensor_msgs/BatteryState of source mavros: voltage, remaining charge",
    )
    mavros_position_topic: str = parameter(
        "mavros/global_position/global",
        "sensor_msgs/NavSatFix of source mavros: position, altitude",
    )
    mavros_height_topic: str = parameter(
        "mavros/global_position/rel_alt",
        "std_msgs/Float64 of source mavros: height above home, m",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        sources = list(self.vehicle_sources)
        wrong = [name for name in sources if name not in SOURCES or sources.count(name) > 1]
        if wrong or not sources:
            raise ParameterError(
                f"parameter vehicle_sources is {sources!r}: need one or more of "
                f"{', '.join(SOURCES)}, each once; "
                f"{f'{wrong[0]!r} is wrong' if wrong else 'it is empty'}"
            )


Reader = Callable[[Any], readings.Parts]


class VehicleSources:
    """Subscribes to what the parameters name and tells what the vehicle is by then.

    values: the node's parameters, VehicleSettings' among them, vehicle_state_age (s): a source of
    the autopilot that is silent for longer has lost it, and vehicle_source_rate (Hz).
    tell(report, now) is called by the node's executor. clock: monotonic seconds. before: how the
    autopilot was heard before a restart (NEVER_SEEN: not, or nobody knows).
    """

    def __init__(
        self,
        node: Node,
        values: Mapping[str, Any],
        tell: Callable[[VehicleReport, float], object],
        clock: Callable[[], float] = time.monotonic,
        before: model.LinkState = model.LinkState.NEVER_SEEN,
    ) -> None:
        self._node, self._values, self._tell, self._clock = node, values, tell, clock
        sources = list(settings_from(VehicleSettings, values).vehicle_sources)
        limits = values["vehicle_state_age"], values["vehicle_source_rate"]
        self._hearing = VehicleHearing(sources, *limits, self._told, before, clock())
        self._refused: set[str] = set()
        self._disputed: frozenset[str] = frozenset()
        inputs = {source: self._inputs(source) for source in sources if source != VEHICLE_STATE}
        # Runs only while something waits for the end of the interval.
        self._timer = node.create_timer(
            TELL_INTERVAL, self._tell_now, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._timer.cancel()
        if VEHICLE_STATE in sources:
            newest = qos.newest(qos.STATUS)
            node.create_subscription(VehicleState, VEHICLE_STATE, self._vehicle_state, newest)
        for source, kinds in inputs.items():
            for kind, name, read in kinds:
                self._subscribe(kind, name, partial(self._heard, source, name, read))

    def _inputs(self, source: str) -> list[tuple[Any, str, Reader]]:
        """Type, parameter with the topic, and reader of each topic of a source."""
        if source == ODOMETRY:
            return [(Odometry, "odometry_topic", readings.odometry)]
        if source == IMU:
            return [(Imu, "imu_topic", readings.imu)]
        state, extended_state = _mavros_messages()
        return [
            (state, "mavros_state_topic", readings.mavros_state),
            (extended_state, "mavros_extended_state_topic", readings.mavros_extended_state),
            (BatteryState, "mavros_battery_topic", readings.battery),
            (NavSatFix, "mavros_position_topic", readings.position),
            (Float64, "mavros_height_topic", readings.relative_altitude),
        ]

    def _subscribe(self, kind: Any, parameter: str, callback: Callable[[Any], None]) -> None:
        topic = self._values[parameter]
        # Best effort matches every publisher, and volatile brings nothing of before. The newest
        # alone: words that waited would all be dated by now, and the vehicle seem to leap.
        profile = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        try:
            self._node.create_subscription(kind, topic, callback, profile)
        except (InvalidTopicNameException, ValueError) as error:
            raise ParameterError(
                f"parameter {parameter} is {topic!r}: need the name of a topic "
                f"({str(error).splitlines()[0]})"
            ) from error

    # -- messages -------------------------------------------------------------------------------

    def _vehicle_state(self, message: VehicleState) -> None:
        self._hearing.hear_state(messages.vehicle_state_from(message), self._clock())
        self._wait()

    def _heard(self, source: str, parameter: str, read: Reader, message: Any) -> None:
        header = getattr(message, "header", None)
        child = getattr(message, "child_frame_id", "")
        wrong = readings.wrong_frame(header.frame_id if header else "", child)
        if wrong:
            self._hearing.refuse(source, wrong, self._clock())
            self._refuse(parameter, wrong)
            return
        self._hearing.hear(source, read(message), self._clock())
        self._wait()

    def _refuse(self, parameter: str, why: str) -> None:
        if parameter not in self._refused:
            self._refused.add(parameter)
            self._node.get_logger().error(
                f"{self._values[parameter]}: {why}: not used; set {parameter} to a topic in the "
                "frames of REP 103 and REP 105 (reported once)"
            )

    # -- telling --------------------------------------------------------------------------------

    def _wait(self) -> None:
        """Something may wait for the end of the interval."""
        if math.isinf(self._hearing.due):
            self._timer.cancel()
        elif self._timer.is_canceled():
            self._timer.reset()

    def _tell_now(self) -> None:
        self._timer.cancel()
        self._hearing.tell_now(self._clock())

    def _told(self, report: VehicleReport, now: float) -> None:
        if new := sorted(report.disputed - self._disputed):
            self._node.get_logger().warning(
                f"vehicle_sources: {', '.join(new)} in doubt: another source differs, or the "
                "value jumped; it counts as half a sign in rules that one sign would fulfil "
                "(docs/reference/rules.md)"
            )
        self._disputed = report.disputed
        self._tell(report, now)


def _mavros_messages() -> tuple[Any, Any]:
    # Not at the top: few have MAVROS, and nobody else needs its messages.
    try:
        from mavros_msgs.msg import ExtendedState, State
    except ImportError as error:
        distribution = os.environ.get("ROS_DISTRO", "<distro>")
        raise ParameterError(
            f"parameter vehicle_sources names {MAVROS!r}, but mavros_msgs cannot be imported: "
            f"install ros-{distribution}-mavros-msgs, or take {MAVROS!r} out ({error})"
        ) from error
    return State, ExtendedState
