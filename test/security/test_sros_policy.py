"""The SROS 2 policy allows each node exactly what it does, and nobody else to decide."""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path
from unittest.mock import Mock
from xml.etree import ElementTree

import pytest
import yaml
from chute_msgs.msg import ParachuteStatus
from node_bench import LOCAL, stamped
from rclpy.action import graph as actions
from rclpy.node import Node

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.links.relay.node import RelayNode
from chute_ros.links.umbilical.node import UmbilicalNode
from chute_ros.links.upf.node import UpfCanNode
from chute_ros.ros import qos
from chute_ros.ros.deploy_action_node import DeployActionNode
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode
from chute_ros.tools.chute.calling import OrderCall
from chute_ros.tools.chute.gathering import gather
from chute_ros.tools.chute.listening import Listening
from chute_ros.tools.chute.node_parameters import parameters_of_node
from chute_ros.tools.chute.options import parse
from chute_ros.tools.chute.order import order_of
from chute_ros.tools.chute.session import ChuteSession
from chute_ros.tools.chute.surroundings import surroundings
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.tools.panel import node as panel
from chute_ros.tools.panel.access import Operator

CONFIG = Path(__file__).parents[2] / "config"
POLICY = CONFIG / "security" / "policy.xml"
NODES = {
    "mavlink_parachute": (MavlinkParachuteNode, lambda: f"udpin:{LOCAL}:0"),
    "upf_can": (UpfCanNode, lambda: f"mcast:0:{free_udp_ports(1)[0]}"),
    "umbilical": (UmbilicalNode, lambda: "serial:/nowhere/ttyACM0"),
    "relay": (RelayNode, lambda: "serial:/nowhere/ttyUSB0"),
    "safety_supervisor": (SafetySupervisorNode, None),
    "deploy_action": (DeployActionNode, None),
}
#: Nodes without a parameter.
PLAIN = {"deploy_action"}
LINKS = sorted(set(NODES) - {"safety_supervisor"} - PLAIN)
ORDERS = [
    *(["arm"], ["disarm"], ["deploy"], ["kill"], ["reset"], ["mode", "active"]),
    *([name, "--link", link] for name in ("arm", "deploy") for link in LINKS),
]
#: What ROS itself gives every node: topics, and services of its own.
EVERY_NODE = {"/rosout", "/parameter_events"}
OF_ROS = {
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "get_type_description",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
}
#: What each node of the ros2 command line offers.
COMMAND_LINE = {f"/_ros2cli_*/{name}" for name in OF_ROS}
#: Right in the policy -> what has it in the graph, asked of (node that asks, name, namespace).
RIGHTS = {
    "publish": Node.get_publisher_names_and_types_by_node,
    "subscribe": Node.get_subscriber_names_and_types_by_node,
    "reply": Node.get_service_names_and_types_by_node,
    "request": Node.get_client_names_and_types_by_node,
    "execute": actions.get_action_server_names_and_types_by_node,
    "call": actions.get_action_client_names_and_types_by_node,
}
#: In the names of the topics and services that an action is made of.
OF_ACTION = "/_action/"


def allowed():
    """Enclave -> right -> names, relative to the profile's namespace."""
    found = {}
    for enclave in ElementTree.parse(POLICY).getroot().iter("enclave"):
        (profile,) = enclave.iter("profile")
        assert profile.get("ns") == "/"
        node = profile.get("node")
        assert enclave.get("path") == f"/{node}"
        rights = found[node] = defaultdict(set)
        for group in profile:
            ((right, verdict),) = group.items()
            assert verdict == "ALLOW"
            for one in group:
                name = one.text.replace("~", node)
                assert name not in rights[right], f"{name} is there twice"
                rights[right].add(name)
    return found


def in_graph(bench, name, namespace=None):
    """Right -> names of what this node does now, as the policy writes it. namespace: of the node;
    None: that of the bench."""
    prefix = f"{bench.namespace}/"
    found = {}
    for right, ask in RIGHTS.items():
        found[right] = {
            one.removeprefix(prefix)
            for one, _ in ask(bench.client, name, namespace or bench.namespace)
            if OF_ACTION not in one
        }
    return found


def shipped_parameters(name):
    """Of every parameter file that is shipped with this node in it."""
    if name in PLAIN:
        return [{}]
    every = (yaml.safe_load(path.read_text()) for path in sorted(CONFIG.glob("*.yaml")))
    mine = [one[f"/**/{name}"]["ros__parameters"] for one in every if f"/**/{name}" in one]
    assert mine
    return mine


def does(bench, name):
    """Right -> names of what the node does with any of its parameter files."""
    make, connection = NODES[name]
    total = defaultdict(set)
    for parameters in shipped_parameters(name):
        if connection is not None:
            parameters["connection"] = connection()
        node = bench.add(make, **parameters)
        bench.until(
            lambda: (
                in_graph(bench, name)["publish"] >= EVERY_NODE
                and f"{name}/set_parameters" in in_graph(bench, name)["reply"]
            ),
            "it is in the graph",
        )
        for right, names in in_graph(bench, name).items():
            total[right] |= names
        bench.remove(node)
        bench.until(lambda: name not in bench.client.get_node_names(), "it is gone from the graph")
    return total


@pytest.mark.parametrize("name", NODES)
def test_a_node_is_allowed_what_it_does_and_nothing_more(bench, name):
    rights = allowed()[name]
    found = does(bench, name)
    for right in RIGHTS:
        assert rights[right] == found[right], right


def everything(right):
    """What all nodes do, each of which is allowed just that."""
    return set().union(*(allowed()[name][right] for name in NODES))


def test_a_standby_is_allowed_what_the_first_is_under_its_own_name():
    first, second = allowed()["safety_supervisor"], allowed()["standby"]
    assert {
        right: {one.replace("safety_supervisor/", "standby/") for one in names}
        for right, names in first.items()
    } == second


def test_a_console_may_ask_for_everything_and_say_nothing():
    console = allowed()["console"]
    assert console["request"] == {
        name for name in everything("reply") if name.rpartition("/")[2] not in OF_ROS
    }
    assert console["call"] == everything("execute")
    assert console["publish"] == EVERY_NODE
    assert console["subscribe"] == everything("publish") - {"/parameter_events"}
    assert console["reply"] == COMMAND_LINE


def test_a_recorder_may_listen_to_everything_and_do_nothing():
    recorder = allowed()["recorder"]
    assert recorder["subscribe"] == everything("publish") - {"/parameter_events"}
    assert recorder["publish"] == EVERY_NODE
    assert recorder["reply"] == COMMAND_LINE
    assert recorder["request"] == recorder["call"] == set()


def test_the_command_is_allowed_what_it_does_and_nothing_more(bench, monkeypatch):
    session = ChuteSession(bench.namespace, surroundings({}, ()))
    bench.at_end.callback(session.close)
    # Of a subscription for a moment as well something is left to be seen.
    monkeypatch.setattr(session.node, "destroy_subscription", lambda one: None)
    Listening(session)
    gather(session, 0.0)
    for words in ORDERS:
        OrderCall(session, order_of(parse(words), "ann@ground"), "ann@ground")
    for node in (*sorted(set(NODES) - PLAIN), "standby"):
        parameters_of_node(session, node, 0.0)
    name = session.node.get_name()
    last = "standby/get_parameters"
    bench.until(lambda: last in in_graph(bench, name)["request"], "it is in the graph")
    rights = allowed()["chute"]
    for right, names in in_graph(bench, name).items():
        assert {one.replace(name, "chute_*") for one in names} == rights[right], right


def test_the_panel_is_allowed_what_it_does_and_nothing_more(bench, monkeypatch):
    monkeypatch.setattr(panel, "PanelServer", lambda node: Mock())
    page = panel.PanelNode()
    bench.executor.add_node(page)
    bench.nodes.append(page)
    bench.add(SafetySupervisorNode, black_box=False)
    # Somebody looks at the fleet and at a vehicle with a parachute of each link,
    page.look_at_all()
    page.look(bench.namespace)
    bench.until(lambda: bench.namespace in dict(page.fleet()), "the panel finds the vehicle")
    seen = bench.client.create_publisher(ParachuteStatus, "parachute/status", qos.STATUS)
    every = [stamped(bench.client, ParachuteStatus(link=link)) for link in LINKS]
    bench.client.create_timer(0.2, lambda: [seen.publish(one) for one in every])
    # and gives every order that needs no link.
    for words in ORDERS:
        if "--link" not in words:
            order = order_of(parse(words), "ann@ground")
            page.order(bench.namespace, order, Operator("ann", "192.0.2.1", math.inf))

    def done():
        return {
            right: {one.replace("/panel/", "panel/") for one in names}
            for right, names in in_graph(bench, "panel", "/").items()
        }

    rights = allowed()["panel"]
    bench.until(lambda: done()["request"] >= rights["request"], "it asks who all devices are")
    for right, names in done().items():
        assert names == rights[right], right


@pytest.mark.parametrize(
    ("topic", "who"),
    [
        ("safety/decision", {"safety_supervisor", "standby"}),
        ("safety/lease", {"safety_supervisor", "standby"}),
        ("safety/state", {"safety_supervisor", "standby"}),
        ("safety/request", {"mavlink_parachute", "upf_can", "umbilical", "relay"}),
        (
            "safety/person",
            {"mavlink_parachute", "upf_can", "umbilical", "relay", "panel", "chute"},
        ),
        ("safety/action", {"mavlink_parachute", "upf_can", "umbilical", "relay"}),
        ("parachute/status", {"mavlink_parachute", "upf_can", "umbilical", "relay"}),
        ("vehicle/state", {"mavlink_parachute", "umbilical"}),
    ],
)
def test_only_these_may_say_what_decides(topic, who):
    assert {name for name, rights in allowed().items() if topic in rights["publish"]} == who


@pytest.mark.parametrize(
    ("services", "who"),
    [
        (("safety/kill", "safety/set_mode"), {"console", "chute", "panel"}),
        (("safety/deploy",), {"console", "chute", "panel", "deploy_action"}),
        ([f"{link}/deploy" for link in LINKS], {"console", "chute"}),
        (["upf_can/command", "umbilical/command"], {"console"}),
    ],
)
def test_only_these_may_call_what_fires(services, who):
    for service in services:
        assert {name for name, one in allowed().items() if service in one["request"]} == who


def test_only_a_console_may_call_the_action():
    """Of whom deploy_action passes on what it is asked."""
    action = "safety/deploy_action"
    assert {name for name, one in allowed().items() if action in one["call"]} == {"console"}
    assert {name for name, one in allowed().items() if action in one["execute"]} == {
        "deploy_action"
    }


def test_nobody_may_change_a_nodes_parameters():
    asked = {name for rights in allowed().values() for name in rights["request"]}
    about = {name.rpartition("/")[2] for name in asked if "parameters" in name}
    assert about == {"list_parameters", "get_parameters"}
    assert not any("*" in name for name in asked)


def test_no_comment_stands_among_the_enclaves():
    """ros2 security takes one for an enclave without a path, and ends."""
    text = POLICY.read_text()
    assert "<!--" not in text[text.index("<enclaves>") :]
