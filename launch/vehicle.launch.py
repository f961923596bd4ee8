"""One vehicle: its device nodes and safety_supervisor, under a namespace of its own.

ros2 launch chute_ros vehicle.launch.py namespace:=drone1 connection:=udpin:0.0.0.0:14550
ros2 launch chute_ros vehicle.launch.py namespace:=drone1 parachute:=upf bus:=socketcan:can0
ros2 launch chute_ros vehicle.launch.py namespace:=rocket parachute:=umbilical
"""

import os
import sys
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from chute_ros.links.api import SUPERVISOR
from chute_ros.links.registered import links, package_of, vehicles
from chute_ros.ros.middleware import LEADS_ELSEWHERE, RANGE
from chute_ros.tools.launch_checks import (
    check_arguments,
    check_connections,
    check_file,
    check_links,
    check_vehicle,
    checked,
    place_of,
    refused_at_start,
)
from launch import LaunchContext, LaunchDescription

#: A node that dies is started again: a supervisor goes on where it stopped, and sends a device
#: node that starts anew what still holds.
LIVES_ON = {"respawn": True, "respawn_delay": 0.5}


def _nodes(context: LaunchContext) -> list:
    """The nodes with one parameter file, or what the vehicle's link has registered where there is
    none; a connection that is given overrides either."""
    parachute = LaunchConfiguration("parachute").perform(context)
    namespace = LaunchConfiguration("namespace").perform(context)
    # An enclave has the name of its node, with the namespace.
    place = place_of(context, namespace)
    kinds = [links()[link] for link in vehicles()[parachute].links]
    given = {
        link: LaunchConfiguration(kind.argument.name).perform(context)
        for link, kind in links().items()
    }
    checked("vehicle.launch.py", lambda: check_links(context, parachute, given))
    connections = {kind.name: given[kind.name] for kind in kinds if given[kind.name]}
    checked("vehicle.launch.py", lambda: check_connections(connections))
    config = LaunchConfiguration("config").perform(context) or _own_file(parachute)
    parameters = checked(
        "vehicle.launch.py", lambda: _parameters(parachute, config, place, connections)
    )
    # Of these nodes alone: an including file may start others, which somebody else must receive.
    environment = {RANGE: LaunchConfiguration("range").perform(context)}
    secured = LaunchConfiguration("enclaves").perform(context) == "true"
    started = [(kind.package, kind.name) for kind in kinds]
    started.append(("chute_ros", SUPERVISOR))
    if LaunchConfiguration("deploy_action").perform(context) == "true":
        # It has no parameters.
        started.append(("chute_ros", "deploy_action"))
    return [
        Node(
            package=package,
            executable=name,
            namespace=namespace,
            parameters=parameters.get(name, []),
            ros_arguments=["--enclave", f"{place}/{name}"] if secured else [],
            additional_env=environment,
            output="screen",
            on_exit=refused_at_start(name),
            **LIVES_ON,
        )
        for package, name in started
    ]


def _own_file(parachute: str) -> str:
    """The parameter file that the package of this parachute has; empty: it has none."""
    try:
        share = get_package_share_directory(package_of(parachute))
    except PackageNotFoundError:
        return ""
    file = Path(share, "config", f"{parachute}_vehicle.yaml")
    return str(file) if file.is_file() else ""


def _parameters(
    parachute: str, config: str, place: str, connections: dict[str, str]
) -> dict[str, list]:
    """Node -> its parameters: of the file config; empty: as its link registers the vehicle."""
    vehicle = vehicles()[parachute]
    if not config:
        given = check_vehicle(vehicle, connections)
        print(
            f"vehicle.launch.py: {package_of(parachute)} has no config/{parachute}_vehicle.yaml: "
            f"parachute:={parachute} gets the parameters of its link's entry (or config:=FILE)",
            file=sys.stderr,
        )
        return {name: [own] if own else [] for name, own in given.items()}
    names = (*vehicle.links, SUPERVISOR)
    check_file(Path(config), place, names, connections)
    overrides = {name: [{"connection": given}] for name, given in connections.items()}
    return {name: [config, *overrides.get(name, [])] for name in names}


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
            choices=list(checked("vehicle.launch.py", vehicles)),
            description="kind of parachute",
        ),
        DeclareLaunchArgument(
            "config",
            default_value="",
            description=(
                "parameter file of all nodes; empty: the one of this parachute, in the package "
                "of its link"
            ),
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
            OpaqueFunction(function=_nodes),
        ]
    )
