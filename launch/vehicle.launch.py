"""One vehicle: its device nodes and safety_supervisor, under a namespace of its own.

ros2 launch chute_ros vehicle.launch.py namespace:=drone1 connection:=udpin:0.0.0.0:14550
ros2 launch chute_ros vehicle.launch.py namespace:=drone1 parachute:=upf bus:=socketcan:can0
ros2 launch chute_ros vehicle.launch.py namespace:=rocket parachute:=umbilical
"""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from chute_ros.links.api import SUPERVISOR
from chute_ros.links.registered import links, vehicles
from chute_ros.ros.middleware import LEADS_ELSEWHERE, RANGE
from chute_ros.tools.launch_checks import (
    check_arguments,
    check_connections,
    check_file,
    check_links,
    checked,
)
from launch import LaunchContext, LaunchDescription

#: A node that dies is started again: a supervisor goes on where it stopped, and sends a device
#: node that starts anew what still holds.
LIVES_ON = {"respawn": True, "respawn_delay": 0.5}


def _nodes(context: LaunchContext) -> list:
    """The nodes with one parameter file; a connection that is given overrides the file's."""
    share = get_package_share_directory("chute_ros")
    parachute = LaunchConfiguration("parachute").perform(context)
    config = LaunchConfiguration("config").perform(context)
    config = config or share + f"/config/{parachute}_vehicle.yaml"
    namespace = LaunchConfiguration("namespace").perform(context)
    # An enclave has the name of its node, with the namespace.
    place = "/".join(["", *filter(None, namespace.split("/"))])
    kinds = [links()[link] for link in vehicles()[parachute].links]
    given = {
        link: LaunchConfiguration(kind.argument.name).perform(context)
        for link, kind in links().items()
    }
    checked("vehicle.launch.py", lambda: check_links(context, parachute, given))
    connections = {kind.name: given[kind.name] for kind in kinds if given[kind.name]}
    checked("vehicle.launch.py", lambda: check_connections(connections))
    names = [*(kind.name for kind in kinds), SUPERVISOR]
    checked("vehicle.launch.py", lambda: check_file(Path(config), place, names, connections))
    secured = LaunchConfiguration("enclaves").perform(context) == "true"
    started = [(kind.package, kind.name, [config]) for kind in kinds]
    started.append(("chute_ros", SUPERVISOR, [config]))
    if LaunchConfiguration("deploy_action").perform(context) == "true":
        # It has no parameters, and so no section in the file.
        started.append(("chute_ros", "deploy_action", []))
    return [
        Node(
            package=package,
            executable=name,
            namespace=namespace,
            parameters=[*own_config, *_connection(connections.get(name))],
            ros_arguments=["--enclave", f"{place}/{name}"] if secured else [],
            output="screen",
            **LIVES_ON,
        )
        for package, name, own_config in started
    ]


def _connection(given: str | None) -> list[dict[str, str]]:
    return [{"connection": given}] if given else []


def _range() -> str:
    """Who may hear the nodes: as the environment says; if that says nothing, this computer alone.
    One packet of anybody else can end a node (docs/guide/security.md)."""
    elsewhere = any(os.environ.get(name) for name in LEADS_ELSEWHERE)
    return os.environ.get(RANGE) or ("SUBNET" if elsewhere else "LOCALHOST")


def _look(context: LaunchContext) -> list:
    """Before the defaults are set: what is there was given."""
    known = [one.name for one in _arguments()]
    checked("vehicle.launch.py", lambda: check_arguments(context, known))
    return []


def _arguments() -> list:
    return [
        DeclareLaunchArgument(
            "range",
            default_value=_range(),
            choices=["LOCALHOST", "SUBNET", "SYSTEM_DEFAULT", "OFF"],
            description=(
                "computers that receive the nodes: LOCALHOST, this computer alone; "
                "SUBNET, others as well, such as a ground station; docs/guide/security.md"
            ),
        ),
        DeclareLaunchArgument("namespace", default_value="", description="of the vehicle"),
        DeclareLaunchArgument(
            "parachute",
            default_value="mavlink",
            choices=list(vehicles()),
            description="kind of parachute",
        ),
        DeclareLaunchArgument(
            "config",
            default_value="",
            description="parameter file of all nodes; empty: the one of this parachute",
        ),
        *(
            DeclareLaunchArgument(
                kind.argument.name,
                default_value="",
                description=f"{kind.argument.description}; empty: from the parameter file",
            )
            for kind in links().values()
        ),
        DeclareLaunchArgument(
            "deploy_action",
            default_value="false",
            choices=["true", "false"],
            description="the action safety/deploy_action as well; docs/reference/interfaces.md",
        ),
        DeclareLaunchArgument(
            "enclaves",
            default_value="false",
            choices=["true", "false"],
            description="each node in its own SROS 2 enclave; docs/guide/security.md",
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """The arguments, and the nodes that they describe."""
    return LaunchDescription(
        [
            OpaqueFunction(function=_look),
            *_arguments(),
            SetEnvironmentVariable(RANGE, LaunchConfiguration("range")),
            OpaqueFunction(function=_nodes),
        ]
    )
