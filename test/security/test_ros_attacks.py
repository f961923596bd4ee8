"""Somebody speaks to a device node without SROS 2: what its gate stops, and what not."""

from __future__ import annotations

import itertools

import pytest
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    SafetyDecision,
)
from mavlink_bench import Module, Network
from node_bench import stamped

from chute_ros.model import Action, Outcome
from chute_ros.ros import qos
from chute_ros.supervisor.epochs import LARGEST_EPOCH

NAME = "mavlink_parachute"


@pytest.fixture
def heard(bench):
    """A module on its node's network, and the node's reports."""
    module = Module()
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    Network(bench).plug(module)
    bench.until(lambda: beats and beats[-1].device_healthy, "the module is heard")
    return module


@pytest.fixture
def say(bench):
    """A function that publishes a deploy as the supervisor would, age s ago."""
    numbers = itertools.count(1)

    def said(age=0.0, **fields):
        values = {"epoch": 1, "id": next(numbers), "targets": [NAME], "rule": "forged"} | fields
        message = SafetyDecision(action=int(Action.DEPLOY), reasons=["forged"], **values)
        bench.publish(stamped(bench.client, message, age), "safety/decision", qos.DECISION)

    return said


def counted(bench, verdict, number):
    """The node has judged so many so."""
    (node,) = (one for one in bench.nodes if one.get_name() == NAME)
    bench.until(
        lambda: node.runtime.decisions.counts()[f"decisions: {verdict}"] == number,
        f"{number} {verdict}",
    )


def test_a_recorded_decision_fires_nothing_later(bench, heard, say):
    reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
    say(epoch=5, id=3)
    bench.until(
        lambda: [one for one in reports if one.outcome == Outcome.CONFIRMED], "the true deploy"
    )
    fired = len(heard.releases)
    say(epoch=5, id=3)
    counted(bench, "the same as one already acted on", 1)
    say(epoch=5, id=2)
    counted(bench, "older than one already seen", 1)
    say(epoch=5, id=4, age=5.0)
    say(epoch=5, id=4, age=-5.0)
    counted(bench, "came too late", 2)
    say(epoch=5, id=4, targets=["upf_can"])
    counted(bench, "addressed to others", 1)
    say(epoch=5, id=4, shadow=True)
    counted(bench, "shadow: only reported, not done", 1)
    assert len(heard.releases) == fired


def test_without_sros_a_decision_that_is_forged_well_is_carried_out(bench, heard, say):
    """What SROS 2 is for: the limit of an open ROS network, written down."""
    say(epoch=LARGEST_EPOCH, id=1)
    bench.until(lambda: heard.deployment, "the parachute is out")
