"""A node that was restarted in the middle of a deploy has heard no parachute yet: the decision
waits for one, and fails only when none comes."""

import pytest
from chute_msgs.msg import ActionReport, SafetyDecision
from mavlink_bench import Module
from mavlink_bench import Network as MavlinkNetwork
from node_bench import stamped
from upf_bench import Network as UpfNetwork

from chute_ros.model import Action, Outcome
from chute_ros.ros import qos


class OnMavlink:
    name = "mavlink_parachute"

    def __init__(self, bench):
        self.network = MavlinkNetwork(bench, give_up_after=5.0)
        self.module = Module()

    def plug_in(self):
        self.network.plug(self.module)

    @property
    def deployed(self):
        return bool(self.module.deployment)


class OnCan:
    name = "upf_can"

    def __init__(self, bench):
        self.network = UpfNetwork(bench, give_up_after=5.0, decided_deploy_forces=True)
        self.trigger = self.network.trigger()

    def plug_in(self):
        self.network.plug(self.network.controller(), self.trigger)

    @property
    def deployed(self):
        return self.trigger.fired


def decide(bench, name):
    message = SafetyDecision(
        epoch=1, id=1, action=int(Action.DEPLOY), rule="test", reasons=["a test"], targets=[name]
    )
    bench.publish(stamped(bench.client, message), "safety/decision", qos.DECISION)


@pytest.mark.parametrize("link", [OnMavlink, OnCan])
def test_a_deploy_that_comes_before_the_parachute_is_heard_is_done_once_it_is(bench, link):
    vehicle = link(bench)
    reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
    decide(bench, vehicle.name)
    bench.turns(0.3)
    assert reports == [], "neither sent nor failed"
    vehicle.plug_in()
    bench.until(lambda: vehicle.deployed, "it is deployed")
    bench.until(
        lambda: any(one.outcome == Outcome.CONFIRMED for one in reports), "and it is confirmed"
    )
    assert not any(one.outcome == Outcome.FAILED for one in reports)


@pytest.mark.parametrize("link", [OnMavlink, OnCan])
def test_where_no_parachute_comes_it_fails_in_time_and_says_why(bench, link):
    vehicle = link(bench)
    reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
    decide(bench, vehicle.name)
    report = bench.until(lambda: reports and reports[-1], "it is reported")
    assert report.outcome == Outcome.FAILED
    assert "received" in report.detail


def test_a_controller_does_not_wait_for_the_kill_that_the_decision_has_waited_for(bench):
    """Given a kill that nobody confirms, and a controller that would wait for it for a minute."""
    network = UpfNetwork(bench, vehicle_service_timeout=60.0, decided_deploy_forces=True)
    trigger = network.trigger()
    controller = network.controller(kill_wait=60.0)
    network.plug(controller, trigger)
    bench.until(lambda: controller.vehicle_connected, "the controller knows its vehicle")
    decide(bench, "upf_can")
    bench.until(lambda: trigger.fired, "it is deployed")
    assert "TYPE_KILLSWITCH" in network.link.vehicle_service.newest_answer
    assert "FAILED" in network.link.vehicle_service.newest_answer
