"""Somebody on the ROS network without SROS 2: what the gates stop all the same, and what not."""

from __future__ import annotations

import itertools

import pytest
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    SafetyDecision,
    SafetyState,
    SupervisorLease,
    VehicleState,
)
from mavlink_bench import Module, Network
from node_bench import stamped
from supervisor_bench import Scene

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.nodes import qos
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
        lambda: node.decisions.counts()[f"decisions: {verdict}"] == number, f"{number} {verdict}"
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
    counted(bench, "shadow: only said, not done", 1)
    assert len(heard.releases) == fired


def test_without_sros_a_decision_that_is_forged_well_is_carried_out(bench, heard, say):
    """What SROS 2 is for: the limit of an open ROS network, written down."""
    say(epoch=LARGEST_EPOCH, id=1)
    bench.until(lambda: heard.deployment, "the parachute is out")


def test_a_lease_claimed_with_a_huge_epoch_takes_nothing_over(bench):
    scene = Scene(bench, profile="by_hand", hot_standby=True, rank=0, lease_listen=0.3)
    scene.await_stage(SafetyState.READY)
    epoch = scene.supervisor.state.epoch
    for rank in (0, 1, 2, 3, 9):
        claim = SupervisorLease(name="liar", rank=rank, epoch=LARGEST_EPOCH, leading=True)
        for _ in range(3):
            bench.publish(stamped(bench.client, claim), "safety/lease")
    bench.turns(1.0)
    assert scene.supervisor.lease.leading
    assert scene.supervisor.state.epoch == epoch


def test_requests_and_pictures_alone_fire_no_parachute_on_the_ground(bench):
    scene = Scene(bench, profile="multirotor")
    scene.await_stage(SafetyState.READY)
    falling = VehicleState(
        source="9/9",
        link_state=int(LinkState.OK),
        armed=VehicleState.DISARMED,
        armed_age=0.0,
        landed_state=VehicleState.ON_GROUND,
        landed_state_age=0.0,
        height=100.0,
        vertical_speed=-40.0,
    )
    for _ in range(100):
        bench.publish(stamped(bench.client, falling), "vehicle/state")
        bench.turns(0.02)
    assert scene.decided(Action.DEPLOY) == []
    assert scene.decided(Action.KILL) == []
