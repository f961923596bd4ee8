"""A node that was restarted in the middle of a deploy, or as the motors must stop, has heard no
device yet: the decision waits for one, and fails only when none comes."""

import pytest
from chute_msgs.msg import ActionReport, SafetyDecision
from mavlink_bench import Autopilot, Module
from mavlink_bench import Network as MavlinkNetwork
from node_bench import stamped
from upf_bench import Network as UpfNetwork

from chute_ros.model import Action, Outcome
from chute_ros.ros import qos

PATIENT, HASTY = 5.0, 0.8


class DeployOnMavlink:
    name, action = "mavlink_parachute", Action.DEPLOY

    def __init__(self, bench, give_up_after):
        self.network = MavlinkNetwork(bench, give_up_after=give_up_after)
        self.module = Module()

    def plug_in(self):
        self.network.plug(self.module)

    @property
    def done(self):
        return bool(self.module.deployment)


class DeployOnCan:
    name, action = "upf_can", Action.DEPLOY

    def __init__(self, bench, give_up_after):
        self.network = UpfNetwork(bench, give_up_after=give_up_after, decided_deploy_forces=True)
        self.trigger = self.network.trigger()

    def plug_in(self):
        self.network.plug(self.network.controller(), self.trigger)

    @property
    def done(self):
        return self.trigger.fired


class KillOnMavlink:
    name, action = "mavlink_parachute", Action.KILL

    def __init__(self, bench, give_up_after):
        self.network = MavlinkNetwork(bench, give_up_after=give_up_after)
        self.autopilot = Autopilot()
        self.autopilot.model.armed = True

    def plug_in(self):
        self.network.plug(self.autopilot)

    @property
    def done(self):
        return not self.autopilot.model.armed


EACH = pytest.mark.parametrize("link", [DeployOnMavlink, DeployOnCan, KillOnMavlink])


def decide(bench, name, action=Action.DEPLOY):
    """Decided for a node of this name; the reports on it."""
    reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
    message = SafetyDecision(
        epoch=1, id=1, action=int(action), rule="test", reasons=["a test"], targets=[name]
    )
    bench.publish(stamped(bench.client, message), "safety/decision", qos.DECISION)
    return reports


@EACH
def test_a_decision_that_comes_before_its_device_is_heard_is_done_once_it_is(bench, link):
    vehicle = link(bench, PATIENT)
    reports = decide(bench, vehicle.name, vehicle.action)
    bench.turns(0.3)
    assert reports == [], "neither sent nor failed"
    vehicle.plug_in()
    bench.until(lambda: vehicle.done, "it is done")
    bench.until(
        lambda: any(one.outcome == Outcome.CONFIRMED for one in reports), "and it is confirmed"
    )
    assert not any(one.outcome == Outcome.FAILED for one in reports)


@EACH
def test_where_no_device_comes_it_fails_in_time_and_says_why(bench, link):
    vehicle = link(bench, HASTY)
    reports = decide(bench, vehicle.name, vehicle.action)
    report = bench.until(lambda: reports and reports[-1], "it is reported")
    assert report.outcome == Outcome.FAILED
    why = "no autopilot of ours was received yet" if vehicle.action is Action.KILL else "received"
    assert why in report.detail


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
