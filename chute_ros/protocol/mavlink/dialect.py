"""The one place that imports the generated MAVLink dialect.

It is made from msg_defs/mavlink/parachute.xml when the package chute_msgs is built.
"""

from chute_ros.errors import NotBuiltError

try:
    from chute_msgs.mavlink import parachute as dialect
except ImportError as error:
    raise NotBuiltError(
        "the MAVLink dialect of chute_msgs is not built or not sourced: "
        "colcon build --base-paths src src/chute_ros/msg_defs, then source install/setup.bash "
        f"({error})"
    ) from error

__all__ = ["FORCE_DISARM", "dialect"]

#: param2 of MAV_CMD_COMPONENT_ARM_DISARM that makes the autopilot disarm in flight.
FORCE_DISARM = 21196.0
