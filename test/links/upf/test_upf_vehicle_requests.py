"""What a UPF asks of the vehicle; the trigger alone as the parachute."""

import pytest
from chute_msgs.msg import ActionReport, LinkHeartbeat, ParachuteStatus, SafetyRequest, SafetyState
from chute_msgs.srv import Deploy
from node_bench import newest, stamped
from rclpy.node import Node
from upf_bench import Network

from chute_ros.links.upf.protocol.config import NODE_ID
from chute_ros.links.upf.protocol.definitions import VEHICLE_SERVICE
from chute_ros.model import Action, Outcome, ParachuteState
from chute_ros.protocol.events import AskSupervisor, SafetyAsk
from chute_ros.ros import qos
from chute_ros.ros.node_executor import NodeExecutor

KILL, BLOCK, RELEASE = "TYPE_KILLSWITCH", "TYPE_FLIGHT_BLOCK", "TYPE_FLIGHT_BLOCK_RELEASE"
LONG = {"vehicle_service_timeout": 60.0}


class Asking:
    """A device, and the rest of the vehicle, by hand."""

    def __init__(self, bench, **parameters):
        self.bench = bench
        self.network = Network(bench, **parameters)
        self.party = self.network.party(33)
        self.asked = bench.follow(SafetyRequest, "safety/request")
        self.number = 0

    def ask(self, name):
        self.number += 1
        values = self.network.definitions.request(VEHICLE_SERVICE, name)
        self.party.ask(NODE_ID, VEHICLE_SERVICE, self.number, **values)

    def await_request(self, request):
        self.bench.until(
            lambda: [one for one in self.asked if one.request == request],
            "the supervisor is asked",
        )
        one = self.asked[-1]
        assert (one.link, one.device) == ("upf_can", "33")
        assert one.reason

    def answers(self):
        """Results so far, each with the transfer id of its request."""
        heard = [one for one in self.party.heard if one.name == VEHICLE_SERVICE]
        name = self.network.definitions.result_name
        return [(one.transfer_id, name(VEHICLE_SERVICE, one.values)) for one in heard]

    def await_answer(self, result):
        self.bench.until(self.answers, "it is answered")
        assert self.answers() == [(self.number, result)]

    def report(self, action, outcome):
        message = ActionReport(
            action=int(action), outcome=int(outcome), link="mavlink_parachute", epoch=1, id=1
        )
        self.bench.publish(stamped(self.bench.client, message), "safety/action", qos.DECISION)

    def supervisor_says(self, blocked, *devices):
        message = SafetyState(flight_blocked=blocked, device_blocks=list(devices))
        self.bench.publish(message, "safety/state", qos.LATCHED)
        kept = self.network.link.vehicle_service
        ours = {one.removeprefix("upf_can ") for one in devices if one.startswith("upf_can ")}
        self.bench.until(
            lambda: (kept._blocked, kept._standing) == (blocked, ours), "the node has heard it"
        )


# The kill switch


def test_the_kill_switch_is_answered_once_the_motors_are_seen_to_stop(bench):
    asking = Asking(bench, **LONG)
    asking.ask(KILL)
    asking.await_request(SafetyRequest.KILL)
    for action, outcome in (
        (Action.KILL, Outcome.SENT),
        (Action.KILL, Outcome.ACCEPTED),
        (Action.KILL, Outcome.FAILED),
        (Action.DEPLOY, Outcome.CONFIRMED),
        (Action.FLIGHT_BLOCK, Outcome.CONFIRMED),
    ):
        asking.report(action, outcome)
    bench.turns(0.2)
    assert asking.answers() == [], "none of these stops a motor"
    asking.report(Action.KILL, Outcome.CONFIRMED)
    asking.await_answer("SUCCESS")


def test_the_supervisor_is_asked_although_the_executor_is_busy(bench, await_until):
    asking = Asking(bench, **LONG)
    listener, executor, heard = Node("listener", namespace=bench.namespace), NodeExecutor(), []
    listener.create_subscription(SafetyRequest, "safety/request", heard.append, qos.STATUS)
    executor.add_node(listener)
    publisher = asking.network.node._request_publisher
    await_until(lambda: publisher.get_subscription_count() == 2, "it is known who listens")
    asking.ask(KILL)

    def asked():
        executor.spin_once(timeout_sec=0.01)
        return heard

    # The executor of the node itself does not turn meanwhile.
    await_until(asked, "the supervisor is asked")
    asking.report(Action.KILL, Outcome.CONFIRMED)
    asking.await_answer("SUCCESS")
    asked()
    assert [one.request for one in heard] == [SafetyRequest.KILL], "once"
    executor.remove_node(listener)
    listener.destroy_node()
    executor.shutdown()


def test_one_request_that_cannot_be_published_keeps_no_other_back(bench):
    asking = Asking(bench)
    node = asking.network.node
    asks = [
        AskSupervisor(ask, "33", "a test")
        for ask in (SafetyAsk.FLIGHT_BLOCK, SafetyAsk.KILL, SafetyAsk.FLIGHT_BLOCK_RELEASE)
    ]
    published = node.publish

    def broken(one):
        if one.ask is not SafetyAsk.KILL:
            raise RuntimeError("the middleware takes none")
        return published(one)

    node.publish = broken
    with pytest.raises(RuntimeError):
        node.deliver(asks)
    asking.await_request(SafetyRequest.KILL)


def test_by_the_policy_reject_nobody_is_asked(bench):
    """And by accept, which another parameter sets, it is asked and answered at once."""
    asking = Asking(bench, killswitch_policy="reject", flight_block_policy="accept", **LONG)
    for number, name in enumerate((KILL, BLOCK, RELEASE), 1):
        asking.ask(name)
        bench.until(lambda n=number: len(asking.answers()) == n, f"{name} is answered")
    assert asking.answers() == [(1, "REJECTED"), (2, "SUCCESS"), (3, "SUCCESS")]
    asking.await_request(SafetyRequest.FLIGHT_BLOCK_RELEASE)
    bench.turns(0.2)
    asked = [one.request for one in asking.asked]
    assert asked == [SafetyRequest.FLIGHT_BLOCK, SafetyRequest.FLIGHT_BLOCK_RELEASE]


# Flight block


def test_a_flight_block_is_answered_once_it_stands_for_this_device(bench):
    asking = Asking(bench, **LONG)
    asking.ask(BLOCK)
    asking.await_request(SafetyRequest.FLIGHT_BLOCK)
    asking.supervisor_says(True)
    asking.supervisor_says(True, "upf_can 34", "another 33")
    asking.supervisor_says(False, "upf_can 33")
    bench.turns(0.2)
    assert asking.answers() == []
    asking.supervisor_says(True, "upf_can 34", "upf_can 33")
    asking.await_answer("SUCCESS")


def test_a_release_is_answered_once_the_block_of_this_device_is_gone(bench):
    asking = Asking(bench, **LONG)
    asking.supervisor_says(True, "upf_can 33")
    asking.ask(RELEASE)
    asking.await_request(SafetyRequest.FLIGHT_BLOCK_RELEASE)
    bench.turns(0.2)
    assert asking.answers() == []
    asking.supervisor_says(True, "upf_can 34")
    asking.await_answer("SUCCESS")


# The trigger alone


def test_in_the_architecture_without_a_controller_the_trigger_is_the_parachute(bench):
    network = Network(bench, without_controller=True, give_up_after=10.0)
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    trigger = network.trigger()
    network.plug(trigger)
    bench.until(newest(beats, device_healthy=True), "all is well")
    bench.until(lambda: statuses, "it is told")
    one = statuses[-1]
    assert (one.device, one.state) == ("34", ParachuteState.READY)
    assert one.backup_voltage == 12.0
    assert one.height != one.height, "a trigger tells none"
    # TriggerLaunch and the TriggerService call leave together: the status that the first one
    # causes may come before the answer to the second.
    answer = bench.call(Deploy, "upf_can/deploy", reason="a test")
    assert answer.success, answer.message
    assert "TriggerStatus of 34 reports launched" in answer.message
    assert trigger.fired
    bench.until(lambda: statuses[-1].state == ParachuteState.LAUNCHED, "it is told")
