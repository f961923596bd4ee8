"""The battery of the vehicle as other ROS software knows it: sensor_msgs/BatteryState."""

from __future__ import annotations

import time

from builtin_interfaces.msg import Time
from rclpy.node import Node
from sensor_msgs.msg import BatteryState

from chute_ros import model
from chute_ros.ros import messages, qos

#: The age of one reading is read a little later each time, by as much as a busy processor takes;
#: autopilots report batteries no more often than this, s.
_APART = 0.05


class BatteryPublisher:
    """Publishes each new reading on vehicle/battery."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(BatteryState, "vehicle/battery", qos.STATUS)
        self._measured_at = -1.0

    def publish(self, state: model.VehicleState, stamp: Time) -> None:
        """A picture of the vehicle, which may have no new reading. stamp: when it was made."""
        measured_at = time.monotonic() - state.battery_age
        # Nor if the age is NaN: none was received.
        if not measured_at > self._measured_at + _APART:
            return
        self._measured_at = measured_at
        received = messages.nanoseconds(stamp) - round(state.battery_age * 1e9)
        self._publisher.publish(battery_state(state, messages.stamp_of(received)))


def battery_state(state: model.VehicleState, stamp: Time) -> BatteryState:
    """What is not known is NaN or UNKNOWN, as the message wants it. stamp: of the reading."""
    message = BatteryState(
        voltage=state.battery_voltage,
        percentage=state.battery_remaining,
        temperature=model.NAN,
        current=model.NAN,
        charge=model.NAN,
        capacity=model.NAN,
        design_capacity=model.NAN,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_UNKNOWN,
        power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
        present=True,
    )
    message.header.stamp = stamp
    return message
