"""One simulated vehicle: the nodes of vehicle.launch.py and what they speak to.

ros2 launch chute_ros simulation.launch.py namespace:=drone1 port:=14600 parachute:=upf
ros2 launch chute_ros simulation.launch.py fly:=60 wind:=5 fail:=refuse@0,motor@15
ros2 launch chute_ros simulation.launch.py parachute:=umbilical launch:=12 fail:=drogue@0

While it runs sim_bench offers what can be done to the vehicle as services, sim/NAME
(docs/guide/simulation.md).

Only on this host: the simulators speak over loopback. Two vehicles need two namespaces and two
ports; port + 1 and port + 2 are used as well.
"""

import os
import tempfile
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    GroupAction,
    IncludeLaunchDescription,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
    UnsetEnvironmentVariable,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

from chute_ros.links.api import Sockets
from chute_ros.links.registered import links, vehicles
from chute_ros.ros.middleware import LEADS_ELSEWHERE
from chute_ros.tools.launch_checks import (
    FAILURES,
    FlightArguments,
    check_arguments,
    check_port,
    checked,
)
from chute_ros.tools.simulated_vehicle import (
    SimulatedVehicle,
    new_home,
    own_folder,
    simulators_of,
)
from launch import LaunchContext, LaunchDescription


def _vehicle(context: LaunchContext) -> list:
    share = get_package_share_directory("chute_ros")
    namespace = LaunchConfiguration("namespace").perform(context)
    text = LaunchConfiguration("port").perform(context)
    port = checked("simulation.launch.py", lambda: check_port(text))
    parachute = LaunchConfiguration("parachute").perform(context)
    flight = _flight(context, parachute)
    folder = Path(tempfile.gettempdir()) / f"chute_ros_sim_{os.getuid()}_{port}"
    vehicle = SimulatedVehicle(
        parachute,
        Sockets(
            network=f"127.0.0.1:{port}",
            air=f"127.0.0.1:{port + 1}",
            bus=f"mcast:0:{port + 2}",
            terminal=f"/tmp/chute_ros_terminal_{port}",
        ),
        checked("simulation.launch.py", lambda: own_folder(folder)),
    )
    home = checked("simulation.launch.py", new_home)
    started = [
        SetEnvironmentVariable("ROS_HOME", str(home)),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(f"{share}/launch/vehicle.launch.py"),
            launch_arguments={
                "namespace": namespace,
                "range": "LOCALHOST",
                "parachute": parachute,
                "config": LaunchConfiguration("config").perform(context),
                **{links()[one].argument.name: at for one, at in vehicle.connections().items()},
            }.items(),
        ),
        *(
            _simulator(package, *command, *flight.get(command[0], ()))
            for package, command in vehicle.simulators()
        ),
        Node(
            package="chute_ros",
            executable="sim_bench",
            namespace=namespace,
            parameters=[{"vehicle": parachute, "folder": str(folder)}],
            output="screen",
        ),
    ]
    # A group: what an including file starts after it has its own ROS_HOME and arguments.
    return [
        LogInfo(msg=f"what the nodes keep, such as the black box, is in {home}/chute_ros"),
        GroupAction(started),
    ]


def _flight(context: LaunchContext, vehicle: str) -> dict:
    """What its simulators are told to do: each one's options."""
    flight = FlightArguments(
        fly=LaunchConfiguration("fly").perform(context),
        launch=LaunchConfiguration("launch").perform(context),
        fail=LaunchConfiguration("fail").perform(context),
        wind=LaunchConfiguration("wind").perform(context),
    )
    return checked("simulation.launch.py", lambda: flight.options(simulators_of(vehicle)))


def _simulator(package: str, executable: str, *arguments: str) -> ExecuteProcess:
    # Not a Node: launch_ros would add --ros-args, and a simulator knows nothing of ROS.
    command = [ExecutableInPackage(executable, package), *arguments]
    return ExecuteProcess(cmd=command, name=executable, output="screen")


def _look(context: LaunchContext) -> list:
    """Before the defaults are set: what is there was given."""
    known = [one.name for one in _arguments()]
    checked("simulation.launch.py", lambda: check_arguments(context, known))
    return []


def _arguments() -> list:
    return [
        DeclareLaunchArgument("namespace", default_value="sim", description="of the vehicle"),
        DeclareLaunchArgument(
            "parachute",
            default_value="mavlink",
            choices=list(checked("simulation.launch.py", vehicles)),
            description="kind of parachute",
        ),
        DeclareLaunchArgument(
            "config",
            default_value="",
            description="parameter file of all nodes; empty: as of vehicle.launch.py",
        ),
        DeclareLaunchArgument("port", default_value="14600", description="of loopback UDP"),
        DeclareLaunchArgument(
            "fly",
            default_value="",
            description="height to which it takes off after 11 s, m; empty: it stands",
        ),
        DeclareLaunchArgument(
            "launch",
            default_value="",
            description="how long after its start a rocket launches, s; empty: it stands",
        ),
        DeclareLaunchArgument(
            "fail",
            default_value="",
            description=(
                "what fails, each with @ and how long after the take-off or launch, s, for "
                f"example refuse@0,motor@15; empty: nothing; one of {', '.join(FAILURES)}"
            ),
        ),
        DeclareLaunchArgument(
            "wind",
            default_value="",
            description="m/s, whose gusts move the vehicle; empty: light air",
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
