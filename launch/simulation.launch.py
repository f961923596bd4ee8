"""One simulated vehicle: the nodes of vehicle.launch.py and what they speak to.

ros2 launch chute_ros simulation.launch.py namespace:=drone1 port:=14600 parachute:=upf

Only on this host: the simulators speak over loopback. Two vehicles need two namespaces and two
ports; port + 1 and port + 2 are used as well.
"""

from ament_index_python.packages import get_package_share_directory
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetEnvironmentVariable,
    UnsetEnvironmentVariable,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.substitutions import ExecutableInPackage

from chute_ros.links.upf.protocol.parameters import EXCLUDES
from chute_ros.nodes.middleware import LEADS_ELSEWHERE
from launch import LaunchContext, LaunchDescription

#: As a controller is delivered it takes off, arms, disarms and lands by itself, and refuses to be
#: told to: safety/arm would never succeed.
BY_COMMAND = [part for name in EXCLUDES.values() for part in ("--parameter", f"{name}=false")]


def _vehicle(context: LaunchContext) -> list:
    share = get_package_share_directory("chute_ros")
    namespace = LaunchConfiguration("namespace").perform(context)
    port = int(LaunchConfiguration("port").perform(context))
    network, air = f"udpout:127.0.0.1:{port}", f"127.0.0.1:{port + 1}"
    bus = f"mcast:0:{port + 2}"
    terminal = f"/tmp/chute_ros_umbilical_{port}"
    parachute = LaunchConfiguration("parachute").perform(context)
    simulators = []
    if parachute == "umbilical":
        simulators.append(_simulator("sim_flight_computer", arguments=("--link", terminal)))
    else:
        simulators.append(_simulator("sim_autopilot", network, f"udpin:{air}"))
    if parachute in ("mavlink", "both"):
        simulators.append(_simulator("sim_mavlink_parachute", network, f"udpout:{air}"))
    if parachute in ("upf", "both"):
        feel = ("--vehicle", f"udpout:{air}", *BY_COMMAND)
        simulators.append(_simulator("sim_upf", bus, arguments=feel))
    return [
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(f"{share}/launch/vehicle.launch.py"),
            launch_arguments={
                "namespace": namespace,
                "range": "LOCALHOST",
                "connection": f"udpin:127.0.0.1:{port}",
                "parachute": parachute,
                "bus": bus,
                "cable": f"serial:{terminal}",
            }.items(),
        ),
        *simulators,
    ]


def _simulator(
    executable: str, *connections: str, arguments: tuple[str, ...] = ()
) -> ExecuteProcess:
    # Not a Node: launch_ros would add --ros-args, and a simulator knows nothing of ROS.
    command: list = [ExecutableInPackage(executable, "chute_ros"), *arguments]
    for connection in connections:
        command += ["--connection", connection]
    return ExecuteProcess(cmd=command, name=executable, output="screen")


def generate_launch_description() -> LaunchDescription:
    """The vehicle and what it speaks to."""
    return LaunchDescription(
        [
            # A simulation must never meet a real vehicle on the network.
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"),
            *(UnsetEnvironmentVariable(name) for name in LEADS_ELSEWHERE),
            DeclareLaunchArgument("namespace", default_value="sim", description="of the vehicle"),
            DeclareLaunchArgument(
                "parachute",
                default_value="mavlink",
                choices=["mavlink", "upf", "both", "umbilical"],
                description="kind of parachute",
            ),
            DeclareLaunchArgument("port", default_value="14600", description="of loopback UDP"),
            OpaqueFunction(function=_vehicle),
        ]
    )
