"""One vehicle: mavlink_parachute and safety_supervisor, under a namespace of its own.

ros2 launch chute_ros vehicle.launch.py namespace:=drone1 connection:=udpin:0.0.0.0:14550
"""

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Both nodes with one parameter file; connection overrides the file's."""
    share = get_package_share_directory("chute_ros")
    config = LaunchConfiguration("config")
    namespace = LaunchConfiguration("namespace")
    connection = {"connection": LaunchConfiguration("connection")}
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
                default_value="udppair:127.0.0.1:14541:127.0.0.1:14540",
                description="where the MAVLink network is (see the parameter's description)",
            ),
            Node(
                package="chute_ros",
                executable="mavlink_parachute",
                namespace=namespace,
                parameters=[config, connection],
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
    )
