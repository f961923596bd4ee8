"""Calls that order something of a device node are published, and that keeps none from its work."""

import inspect
from typing import Any

import chute_msgs.srv
import pytest
from chute_msgs.msg import PersonRequest
from chute_msgs.srv import Arm, GetInfo, SetTriggers
from mavlink_bench import Network
from rcl_interfaces.srv import SetParameters

from chute_ros.ros.person_requests import orders


def test_every_service_orders_but_those_that_only_read():
    services = inspect.getmembers(chute_msgs.srv, lambda one: hasattr(one, "Request"))
    reading = {name for name, kind in services if not orders(kind)}
    assert reading == {
        "GetInfo",
        "GetNodeInfo",
        "GetParam",
        "ListParams",
        "RequestMessage",
        "TransportStats",
    }


def test_ros_own_services_order_nothing_of_a_device():
    assert not orders(SetParameters)


@pytest.fixture
def told(bench: Any) -> list[PersonRequest]:
    """What mavlink_parachute without any device publishes."""
    Network(bench)
    heard: list[PersonRequest] = bench.follow(PersonRequest, "safety/person")
    bench.until(lambda: bench.client.count_publishers("safety/person"), "the node is there")
    return heard


def test_what_only_reads_is_not_published_and_what_is_refused_is(bench, told):
    bench.call(GetInfo, "mavlink_parachute/get_info")
    bench.call(SetTriggers, "mavlink_parachute/set_triggers", arm=1, select=0)
    bench.until(lambda: len(told) == 2, "the second is published")
    assert [(one.service, one.answered) for one in told] == [
        ("~/set_triggers", False),
        ("~/set_triggers", True),
    ]
    assert told[0].request == "arm=1, select=0, device=''"
    assert not told[1].success
    assert "select from 1 to 255" in told[1].message


def test_hostile_words_are_published_plainly_and_cut(bench, told):
    hostile = "\x1b[2J\n" + "x" * 3000
    bench.call(SetTriggers, "mavlink_parachute/set_triggers", arm=1, select=0, device=hostile)
    bench.until(lambda: told, "it is published")
    assert told[0].request.isprintable()
    assert len(told[0].request) < 250


def test_a_record_that_fails_keeps_no_service_from_its_work(bench, told, monkeypatch):
    log = bench.follow_log()
    node = next(one for one in bench.nodes if one.get_name() == "mavlink_parachute")

    def broken(_: Any) -> None:
        raise RuntimeError("no more memory")

    monkeypatch.setattr(node._person_requests._publisher, "publish", broken)
    answer = bench.call(Arm, "mavlink_parachute/arm", arm=True)
    assert "received" in answer.message, "the answer of a node without a device"
    line = "~/arm is not in the record: no more memory"
    bench.until(lambda: any(one.msg == line for one in log), "it is logged")
