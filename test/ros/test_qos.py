"""What `ros2 doctor` looks for: publishers and subscriptions of a topic that do not fit."""

import itertools

import pytest
from rclpy.qos import QoSCompatibility, QoSProfile, ReliabilityPolicy, qos_check_compatible
from std_msgs.msg import String
from whole_vehicle import NODES, start_whole_vehicle

from chute_ros.ros import qos
from chute_ros.ros.deploy_action_node import DeployActionNode
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode


def ends(bench):
    """Topic -> (its publishers, its subscriptions), as the graph has them."""
    client = bench.client
    return {
        topic: (
            client.get_publishers_info_by_topic(topic),
            client.get_subscriptions_info_by_topic(topic),
        )
        for topic, _ in client.get_topic_names_and_types()
    }


def misfits(found):
    """What ros2 doctor would print, a line each."""
    lines = []
    for topic, (publishers, subscriptions) in found.items():
        for one, other in itertools.product(publishers, subscriptions):
            how, why = qos_check_compatible(one.qos_profile, other.qos_profile)
            if how != QoSCompatibility.OK:
                lines.append(f"{topic}: {one.node_name} to {other.node_name}: {why}")
    return lines


@pytest.fixture
def vehicle(bench):
    """Everything that runs on a vehicle, a second supervisor and the action with it."""
    start_whole_vehicle(bench)
    bench.add(
        lambda **options: SafetySupervisorNode(cli_args=["-r", "__node:=standby"], **options),
        hot_standby=True,
        rank=1,
        black_box_folder=str(bench.folder / "standbys_box"),
    )
    bench.add(DeployActionNode)
    everybody = NODES | {"standby", "deploy_action"}

    def all_there():
        speak = {one.node_name for each, _ in ends(bench).values() for one in each}
        return everybody <= speak

    bench.until(all_there, "all are in the graph")
    return bench


def test_every_publisher_fits_every_subscription_on_its_topic(vehicle):
    found = ends(vehicle)
    met = {topic for topic, (publishers, heard) in found.items() if publishers and heard}
    names = {topic.removeprefix(f"{vehicle.namespace}/") for topic in met}
    expected = {"heartbeat", "decision", "state", "action", "request", "person", "lease"}
    assert {f"safety/{name}" for name in expected} <= names
    assert {"vehicle/state", "parachute/status", "upf/trigger_status", "diagnostics"} <= names
    assert misfits(found) == []


def test_every_usual_listener_fits_every_topic(vehicle):
    """Given listeners as ros2 topic echo and bridges are: volatile, either reliability."""
    topics = {
        end.topic_name: end.msg_type
        for node in vehicle.nodes
        for end in node.publishers
        if end.topic_name.startswith(vehicle.namespace)
    }
    assert len(topics) > 12
    for topic, kind in topics.items():
        for reliability in ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE:
            profile = QoSProfile(depth=1, reliability=reliability)
            vehicle.client.create_subscription(kind, topic, lambda message: None, profile)

    def listens():
        heard = [each for _, each in ends(vehicle).values()]
        return sum(one.node_name == "client" for each in heard for one in each) >= 2 * len(topics)

    vehicle.until(listens, "the listeners are in the graph")
    assert misfits(ends(vehicle)) == []


def test_a_misfit_is_found(bench):
    """Given a volatile publisher and a latched subscription."""
    bench.client.create_publisher(String, "odd", qos.STATUS)
    bench.client.create_subscription(String, "odd", lambda message: None, qos.LATCHED)
    odd = f"{bench.namespace}/odd"
    bench.until(lambda: all(ends(bench).get(odd, ((), ()))), "both are in the graph")
    (line,) = misfits({odd: ends(bench)[odd]})
    assert line.startswith(f"{odd}: client to client: ERROR: ")
