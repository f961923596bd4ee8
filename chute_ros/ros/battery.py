"""The battery of the vehicle as other ROS software knows it: sensor_msgs/BatteryState."""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time
from sensor_msgs.msg import BatteryState

from chute_ros import model
from chute_ros.ros import qos

#: One reading has the same time in each picture but for what floating point makes of its age, s.
_ROUNDING = 1e-6


class BatteryPublisher:
    """Publishes each new reading on vehicle/battery. node: a SuiteNode."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._publisher = node.create_publisher(BatteryState, "vehicle/battery", qos.STATUS)
        self._received = -1.0

    def publish(self, state: model.VehicleState, at: float) -> None:
        """A picture of the vehicle, which may have no new reading. at: when its ages were counted,
        monotonic s."""
        received = at - state.battery_age
        # Nor if the age is NaN: none was received.
        if not received > self._received + _ROUNDING:
            return
        self._received = received
        self._publisher.publish(battery_state(state, self._node.wall_at(received)))


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
