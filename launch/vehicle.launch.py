"""One vehicle: mavlink_parachute and safety_supervisor, under a namespace of its own.

ros2 launch chute_ros vehicle.launch.py namespace:=drone1 connection:=udpin:0.0.0.0:14550
"""

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription


def _nodes(context: LaunchContext) -> list:
    """Both nodes with one parameter file; a connection that is given overrides the file's."""
    config = LaunchConfiguration("config").perform(context)
    namespace = LaunchConfiguration("namespace").perform(context)
    connection = LaunchConfiguration("connection").perform(context)
    return [
        Node(
            package="chute_ros",
            executable="mavlink_parachute",
            namespace=namespace,
            parameters=[config, *([{"connection": connection}] if connection else [])],
            output="screen",
        ),
        Node(
            package="chute_ros",
            executable="safety_supervisor",
            namespace=namespace,
            parameters=[config],
            output="screen",
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """The arguments, and the nodes that they describe."""
    share = get_package_share_directory("chute_ros")
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="of the vehicle"),
            DeclareLaunchArgument(
                "config",
                default_value=f"{share}/config/mavlink_vehicle.yaml",
                description="parameter file of both nodes",
            ),
            DeclareLaunchArgument(
                "connection",
                default_value="",
                description="where the MAVLink network is; empty: as the parameter file says",
            ),
            OpaqueFunction(function=_nodes),
        ]
    )
