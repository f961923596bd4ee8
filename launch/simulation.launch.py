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

from chute_ros.errors import ParameterError
from chute_ros.links.api import Sockets
from chute_ros.links.registered import links, vehicles
from chute_ros.ros.middleware import LEADS_ELSEWHERE
from chute_ros.tools.launch_checks import check_arguments, check_port, checked, flight_script
from launch import LaunchContext, LaunchDescription

AUTOPILOT = "sim_autopilot"


def _vehicle(context: LaunchContext) -> list:
    share = get_package_share_directory("chute_ros")
    namespace = LaunchConfiguration("namespace").perform(context)
    text = LaunchConfiguration("port").perform(context)
    port = checked("simulation.launch.py", lambda: check_port(text))
    sockets = Sockets(
        network=f"127.0.0.1:{port}",
        air=f"127.0.0.1:{port + 1}",
        bus=f"mcast:0:{port + 2}",
        terminal=f"/tmp/chute_ros_terminal_{port}",
    )
    parachute = LaunchConfiguration("parachute").perform(context)
    vehicle = vehicles()[parachute]
    kinds = [links()[name] for name in vehicle.links]
    commands = [
        (kind.package, command) for kind in kinds for command in kind.simulators(vehicle, sockets)
    ]
    flight = checked("simulation.launch.py", lambda: _flight(context, commands))
    return [
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(f"{share}/launch/vehicle.launch.py"),
            launch_arguments={
                "namespace": namespace,
                "range": "LOCALHOST",
                "parachute": parachute,
                **{kind.argument.name: kind.connection(sockets) for kind in kinds},
            }.items(),
        ),
        *(
            _simulator(package, *command, *(flight if command[0] == AUTOPILOT else ()))
            for package, command in commands
        ),
    ]


def _flight(context: LaunchContext, commands: list) -> list:
    """What the autopilot is told to do."""
    fly = LaunchConfiguration("fly").perform(context)
    fail = LaunchConfiguration("fail").perform(context)
    if (fly or fail) and all(command[0] != AUTOPILOT for _, command in commands):
        raise ParameterError("fly and fail need an autopilot, which this vehicle has not")
    return flight_script(fly, fail)


def _simulator(package: str, executable: str, *arguments: str) -> ExecuteProcess:
    # Not a Node: launch_ros would add --ros-args, and a simulator knows nothing of ROS.
    command = [ExecutableInPackage(executable, package), *arguments]
    return ExecuteProcess(cmd=command, name=executable, output="screen")


def _look(context: LaunchContext) -> list:
    """Before the defaults are set: what is there was given."""
    known = [one.name for one in _arguments()]
    checked("simulation.launch.py", lambda: check_arguments(context.launch_configurations, known))
    return []


def _arguments() -> list:
    return [
        DeclareLaunchArgument("namespace", default_value="sim", description="of the vehicle"),
        DeclareLaunchArgument(
            "parachute",
            default_value="mavlink",
            choices=list(vehicles()),
            description="kind of parachute",
        ),
        DeclareLaunchArgument("port", default_value="14600", description="of loopback UDP"),
        DeclareLaunchArgument(
            "fly",
            default_value="",
            description="height to which it takes off after 11 s, m; empty: it stands",
        ),
        DeclareLaunchArgument(
            "fail",
            default_value="",
            description=(
                "what fails, and how long after the take-off, s: motor@15, autopilot@15 (it "
                "starts again) or telemetry@15 (it falls silent); empty: nothing"
            ),
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """The vehicle and what it speaks to."""
    return LaunchDescription(
        [
            # A simulation must never meet a real vehicle on the network.
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"),
            *(UnsetEnvironmentVariable(name) for name in LEADS_ELSEWHERE),
            OpaqueFunction(function=_look),
            *_arguments(),
            OpaqueFunction(function=_vehicle),
        ]
    )
