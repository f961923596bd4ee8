"""Control characters and line ends pass no border of a node: neither from ROS nor from a wire."""

import inspect
from types import ModuleType
from typing import Any

import chute_msgs.msg
import chute_msgs.srv
import pytest
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyRequest,
    SafetyState,
    VehicleState,
)
from chute_msgs.srv import Deploy, GetNodeInfo, Kill
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import given, settings
from hypothesis import strategies as st
from node_bench import stamped
from rclpy.node import Node
from upf_bench import Network

from chute_ros.protocol.dronecan.bus_node import GET_NODE_INFO, NODE_STATUS
from chute_ros.ros import qos
from chute_ros.ros.plain_border import with_plain_texts
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

HOSTILE = "\x1b[2J\x07\r\nERROR\x9b31m\x7f"
FORBIDDEN = {chr(code) for code in (*range(0x20), *range(0x7F, 0xA0))}


def classes_of(module: ModuleType) -> list[type]:
    return [one for _, one in inspect.getmembers(module, inspect.isclass)]


MESSAGES = [
    *classes_of(chute_msgs.msg),
    *(one.Request for one in classes_of(chute_msgs.srv) if hasattr(one, "Request")),
    *(one.Response for one in classes_of(chute_msgs.srv) if hasattr(one, "Response")),
    DiagnosticArray,
]


def filled(message: Any, text: str) -> Any:
    """message with this text wherever there is room for one."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if isinstance(value, str):
            setattr(message, name, text)
        elif kind.startswith("sequence<string"):
            setattr(message, name, ["good", text])
        elif hasattr(value, "get_fields_and_field_types"):
            filled(value, text)
    return message


def texts_of(message: Any) -> list[str]:
    """Every text in message."""
    found: list[str] = []
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        for one in value if isinstance(value, (list, tuple)) else [value]:
            if isinstance(one, str):
                found.append(one)
            elif hasattr(one, "get_fields_and_field_types"):
                found += texts_of(one)
    return found


def is_plain(message: Any) -> bool:
    return not any(set(text) & FORBIDDEN for text in texts_of(message))


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
@settings(max_examples=20)
@given(text=st.text(max_size=20) | st.text(st.sampled_from(sorted(FORBIDDEN)), min_size=1))
def test_no_message_of_ours_keeps_any_control_character(kind, text):
    assert is_plain(with_plain_texts(filled(kind(), text)))


def test_texts_in_lists_of_messages_are_found():
    status = DiagnosticStatus(name=HOSTILE, values=[KeyValue(key=HOSTILE, value=HOSTILE)])
    assert is_plain(with_plain_texts(DiagnosticArray(status=[status])))
    rule = chute_msgs.msg.RuleState(name=HOSTILE, conditions=[HOSTILE])
    assert is_plain(with_plain_texts(SafetyState(rules=[rule])))


def hostile_supervisor(bench: Any) -> Any:
    """A supervisor in whose ears everybody is hostile; what it says, by topic, and its log."""
    heard = {
        "state": bench.follow(SafetyState, "safety/state", qos.LATCHED),
        "diagnostics": bench.follow(DiagnosticArray, "/diagnostics"),
        "log": bench.follow_log(),
    }
    node = bench.add(SafetySupervisorNode, links=["here"], hot_standby=False)
    bench.until(lambda: heard["state"], "it is there")
    for message, topic in (
        (LinkHeartbeat(link="here", link_state=1, reasons=[HOSTILE]), "safety/heartbeat"),
        (LinkHeartbeat(link=HOSTILE, link_state=1), "safety/heartbeat"),
        (ParachuteStatus(link="here", device=HOSTILE, faults=[HOSTILE]), "parachute/status"),
        (VehicleState(source=HOSTILE, faults=[HOSTILE]), "vehicle/state"),
        (ActionReport(link=HOSTILE, detail=HOSTILE), "safety/action"),
        (SafetyRequest(link=HOSTILE, device=HOSTILE, reason=HOSTILE), "safety/request"),
        (
            SafetyRequest(link="here", device=HOSTILE, request=2, reason=HOSTILE),
            "safety/request",
        ),
    ):
        for _ in range(3):
            bench.publish(stamped(bench.client, message), topic)
    return node, heard


def test_a_supervisor_among_hostile_ones_says_nothing_raw(bench, capfd):
    _, heard = hostile_supervisor(bench)
    answers = [
        bench.call(Deploy, "safety/deploy", reason=HOSTILE),
        bench.call(Kill, "safety/kill", reason=HOSTILE),
    ]
    written = r"\x1b[2J\x07\r\nERROR\x9b31m\x7f"
    bench.until(lambda: any(written in one.msg for one in heard["log"]), "it is logged, plainly")
    before = len(heard["diagnostics"])
    bench.until(lambda: len(heard["diagnostics"]) > before + 1, "it is in diagnostics")
    said = [*answers, *heard["state"], *heard["diagnostics"], *heard["log"]]
    assert all(is_plain(one) for one in said)
    shown = "".join(capfd.readouterr())
    assert not set(shown) & (FORBIDDEN - {"\n"})
    assert "\nERROR" not in shown


def test_a_hostile_node_on_the_can_bus_says_nothing_raw_through_us(bench, capfd):
    log, diagnostics = bench.follow_log(), bench.follow(DiagnosticArray, "/diagnostics")
    network = Network(bench)
    party = network.party(77)
    information = {"name": HOSTILE.encode("latin-1"), "hardware_version": {"unique_id": bytes(16)}}

    def is_known() -> bool:
        party.say(NODE_STATUS, uptime_sec=5)
        for one in [one for one in party.heard if one.name == GET_NODE_INFO]:
            party.heard.remove(one)
            party.loop.call(lambda link, now, one=one: link.endpoint.respond(one, information))
        return any("ERROR" in text for one in diagnostics for text in texts_of(one))

    bench.until(is_known, "its name is in diagnostics")
    future = bench.ask(GetNodeInfo, "upf_can/get_node_info", node_id=77)
    bench.until(lambda: is_known() and future.done(), "it is told")
    assert "ERROR" in " ".join(texts_of(future.result()))
    assert all(is_plain(one) for one in [future.result(), *log, *diagnostics])
    assert not set("".join(capfd.readouterr())) & (FORBIDDEN - {"\n"})


def test_each_line_of_a_log_is_one_place_in_the_source(bench):
    """Given lines at two levels and with a throttle, which ROS tells apart by their place."""
    log = bench.follow_log()
    network = Network(bench)
    node: Node = network.node
    for _ in range(3):
        node.get_logger().info("once in a while\n", throttle_duration_sec=60.0)
        node.get_logger().error("always\x1b")
    node.get_logger().get_child("its own").warning("child\x07")

    def lines(text: str) -> list[Any]:
        return [one for one in log if one.msg == text]

    bench.until(lambda: lines(r"child\x07"), "all came")
    assert len(lines(r"once in a while\n")) == 1
    assert len(lines(r"always\x1b")) == 3
    assert lines(r"always\x1b")[0].function == "test_each_line_of_a_log_is_one_place_in_the_source"
