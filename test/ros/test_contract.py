"""The public contract of docs: every topic and service with its type and quality of service."""

from importlib.metadata import entry_points

import pytest
from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, SafetyState
from mavlink_bench import Module, Network, quick
from node_bench import Bench
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.links.umbilical.node import UmbilicalNode
from chute_ros.model import LinkState
from chute_ros.ros import qos
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

VOLATILE, LATCHED = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL
STATUS, DECISION = (10, VOLATILE), (50, VOLATILE)

DIAGNOSTICS = dict.fromkeys(("/diagnostics", "diagnostics"), ("DiagnosticArray", STATUS))
#: Of every device node.
PUBLISHED_BY_DEVICES = DIAGNOSTICS | {
    "parachute/status": ("ParachuteStatus", STATUS),
    "safety/heartbeat": ("LinkHeartbeat", STATUS),
    "safety/request": ("SafetyRequest", STATUS),
    "safety/person": ("PersonRequest", STATUS),
    "safety/action": ("ActionReport", DECISION),
}
HEARD_BY_DEVICES = {
    "safety/decision": ("SafetyDecision", DECISION),
    "safety/heartbeat": ("LinkHeartbeat", STATUS),
    "safety/state": ("SafetyState", (1, LATCHED)),
}
PUBLISHED = {
    "mavlink_parachute": PUBLISHED_BY_DEVICES
    | {
        "vehicle/battery": ("BatteryState", STATUS),
        "vehicle/state": ("VehicleState", STATUS),
    },
    "umbilical": PUBLISHED_BY_DEVICES
    | {
        "umbilical/telem": ("Telem", STATUS),
        "vehicle/state": ("VehicleState", STATUS),
    },
    "safety_supervisor": DIAGNOSTICS
    | {
        "safety/heartbeat": ("LinkHeartbeat", STATUS),
        "safety/decision": ("SafetyDecision", DECISION),
        "safety/history": ("SafetyDecision", (20, LATCHED)),
        "safety/lease": ("SupervisorLease", STATUS),
        "safety/state": ("SafetyState", (1, LATCHED)),
        "safety/summary": ("SafetySummary", (1, LATCHED)),
    },
}
SUBSCRIBED = {
    "mavlink_parachute": HEARD_BY_DEVICES,
    "umbilical": HEARD_BY_DEVICES,
    "safety_supervisor": {
        "parachute/status": ("ParachuteStatus", STATUS),
        "vehicle/state": ("VehicleState", STATUS),
        "safety/heartbeat": ("LinkHeartbeat", STATUS),
        "safety/request": ("SafetyRequest", STATUS),
        "safety/action": ("ActionReport", DECISION),
        "safety/lease": ("SupervisorLease", STATUS),
    },
}
#: Name, and in chute_msgs its type.
SERVICES = {
    "mavlink_parachute": {
        "mavlink_parachute/arm": "Arm",
        "mavlink_parachute/deploy": "Deploy",
        "mavlink_parachute/set_triggers": "SetTriggers",
        "mavlink_parachute/parachute_action": "ParachuteAction",
        "mavlink_parachute/request_message": "RequestMessage",
        "mavlink_parachute/set_message_interval": "SetMessageInterval",
        "mavlink_parachute/get_info": "GetInfo",
    },
    "umbilical": {
        "umbilical/arm": "Arm",
        "umbilical/deploy": "Deploy",
        "umbilical/command": "UmbilicalCommand",
        "umbilical/set_target": "SetTarget",
        "umbilical/dump": "Dump",
    },
    "safety_supervisor": {
        "safety/arm": "Arm",
        "safety/deploy": "Deploy",
        "safety/kill": "Kill",
        "safety/reset": "std_srvs/srv/Trigger",
        "safety/set_mode": "SetMode",
    },
}
ROS_TOPICS = {"/rosout", "/parameter_events"}
NODES = {
    "mavlink_parachute": (MavlinkParachuteNode, quick()),
    "umbilical": (
        UmbilicalNode,
        {"connection": "serial:/nowhere/ttyACM0", "publish_vehicle_state": True},
    ),
    # The black box listens to more, only to keep it.
    "safety_supervisor": (SafetySupervisorNode, {"black_box": False}),
}


#: What one that was lost must not hold back.
SAID_AGAIN = ("safety/heartbeat", "safety/decision", "parachute/status", "vehicle/state")


@pytest.fixture(params=["/", "/drone1", "/fleet/drone1"])
def vehicle(request, ros):
    one = Bench(request.param)
    yield one
    one.close()


def absolute(bench, name):
    if name.startswith("/"):
        return name
    return f"{bench.namespace.rstrip('/')}/{name}"


def ends(found):
    """Topic -> (type, (depth, durability)) of publishers or subscriptions."""
    return {
        end.topic_name: (
            end.msg_type.__name__,
            (end.qos_profile.depth, end.qos_profile.durability),
        )
        for end in found
        if end.topic_name not in ROS_TOPICS
    }


@pytest.mark.parametrize("name", NODES)
def test_names_types_and_qualities_are_the_contracts_and_nothing_is_missing(vehicle, name):
    make, parameters = NODES[name]
    node = vehicle.add(make, **parameters)
    assert node.get_name() == name
    assert node.get_namespace() == vehicle.namespace
    for found, contract in ((node.publishers, PUBLISHED), (node.subscriptions, SUBSCRIBED)):
        expected = {absolute(vehicle, topic): end for topic, end in contract[name].items()}
        assert ends(found) == expected
    ours = [p for p in node.publishers if p.topic_name not in ROS_TOPICS]
    assert {p.qos_profile.reliability for p in ours} == {ReliabilityPolicy.RELIABLE}
    again = {absolute(vehicle, topic) for topic in SAID_AGAIN}
    for end in node.subscriptions:
        if end.topic_name in again:
            assert end.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT, end.topic_name
    offered = {
        service: kind
        for service, (kind,) in vehicle.client.get_service_names_and_types_by_node(
            name, vehicle.namespace
        )
        if not kind.startswith(("rcl_interfaces/", "type_description_interfaces/"))
    }
    assert offered == {
        absolute(vehicle, service): kind if "/" in kind else f"chute_msgs/srv/{kind}"
        for service, kind in SERVICES[name].items()
    }


@pytest.mark.parametrize("name", NODES)
def test_the_executable_has_the_nodes_name(name):
    (entry,) = entry_points(group="console_scripts", name=name)
    assert callable(entry.load())


@pytest.mark.parametrize("name", NODES)
def test_a_simulated_clock_that_stands_does_not_stop_the_heartbeats(bench, name):
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    make, parameters = NODES[name]
    bench.add(make, **parameters, use_sim_time=True)
    bench.until(lambda: len(beats) > 5, "it beats")
    now = bench.client.get_clock().now().nanoseconds * 1e-9
    assert abs(beats[-1].header.stamp.sec - now) < 20.0, "stamped by the wall clock"


def test_a_device_is_heard_and_told_all_the_same(bench):
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    Network(bench, use_sim_time=True).plug(Module())
    bench.until(lambda: statuses, "the status is told")
    assert statuses[-1].link_state == LinkState.OK


def test_the_state_is_latched_for_who_comes_late(bench):
    bench.add(SafetySupervisorNode)
    first = bench.follow(SafetyState, "safety/state", qos.LATCHED)
    bench.until(lambda: first, "the state is published")
    late = bench.follow(SafetyState, "safety/state", qos.LATCHED)
    bench.until(lambda: late, "who comes late is told")
    assert late[0].header.stamp.sec >= first[0].header.stamp.sec - 1
