"""Two supervisors, each a process of its own: one leads, the other takes over, no shot is lost."""

import signal
import time

import pytest
from chute_msgs.msg import SafetyDecision, SafetyState, SupervisorLease
from chute_msgs.srv import Deploy, Kill
from supervisor_bench import StubLink

from chute_ros.model import Action, Outcome
from chute_ros.nodes import qos
from chute_ros.tools.processes import Processes

QUICK = {
    "startup_grace": 0.3,
    "hot_standby": True,
    "lease_timeout": 0.5,
    "lease_listen": 3.0,
    "profile": "by_hand",
    "deploy_timeout": 20.0,
    "kill_timeout": 20.0,
}


class Pair:
    """Supervisors a (rank 0) and b (rank 1), one stub link, a vehicle."""

    def __init__(self, bench):
        self.bench = bench
        self.processes = Processes(bench.folder)
        self.claims, self.started = {}, []
        self.states = bench.follow(SafetyState, "safety/state", qos.LATCHED)
        self.decisions = bench.follow(SafetyDecision, "safety/decision", qos.DECISION)
        bench.client.create_subscription(
            SupervisorLease,
            f"{bench.namespace}/safety/lease",
            lambda message: self.claims.update({message.name: (time.monotonic(), message)}),
            qos.STATUS,
        )
        self.link = bench.add(lambda **options: StubLink("mavlink_parachute", **options))
        self.link.offer_arming()

    def start(self, name, rank, **parameters):
        self.started.append(name)
        told = [
            part
            for key, value in (QUICK | {"rank": rank} | parameters).items()
            for part in ("-p", f"{key}:={str(value).lower()}")
        ]
        self.processes.start(
            name,
            "chute_ros.nodes.safety_supervisor",
            "--ros-args",
            *("-r", f"__ns:={self.bench.namespace}", "-r", f"__node:={name}"),
            *told,
        )

    def send_signal(self, name, number):
        self.processes.send_signal(name, number)

    def leads(self, name):
        return name in self.claims and self.claims[name][1].leading

    def await_leader(self, name):
        self.bench.until(lambda: self.leads(name), f"{name} leads")

    def await_stage(self, stage):
        self.bench.until(
            lambda: self.states and self.states[-1].state == stage, f"the stage is {stage}"
        )

    def both(self):
        """a leads, b follows it, the vehicle is in the air."""
        self.start("a", 0)
        self.await_leader("a")
        self.start("b", 1)
        self.bench.until(
            lambda: "b" in self.claims and self.claims["b"][1].leader == "a", "b follows a"
        )
        assert not self.leads("b")
        self.await_stage(SafetyState.READY)
        self.link.flying = True
        self.await_stage(SafetyState.IN_FLIGHT)
        # What b has been told by a since, it knows.
        heard = self.claims["b"][0]
        self.bench.until(lambda: self.claims["b"][0] > heard + 0.3, "b has heard of it")
        return self

    def acted(self, action):
        return [(epoch, number) for epoch, number, one in self.link.acted if one is action]

    def epoch(self, name):
        return self.claims[name][1].epoch


@pytest.fixture
def pair(bench):
    pair = Pair(bench)
    yield pair
    pair.processes.end()
    for name in pair.started:
        print(pair.processes.tail(name, 40))


def test_the_second_follows_and_takes_over_in_flight_when_the_first_is_killed(pair):
    pair.both()
    first, alarms = pair.epoch("a"), pair.states[-1].alarms
    pair.send_signal("a", signal.SIGKILL)
    killed_at = time.monotonic()
    pair.await_leader("b")
    # The lease's time for the second in rank, and what a busy machine adds.
    assert time.monotonic() - killed_at < 5.0
    assert pair.epoch("b") > first
    pair.bench.until(lambda: pair.states[-1].epoch == pair.epoch("b"), "b tells the state")
    assert pair.states[-1].state == SafetyState.IN_FLIGHT, "the flight goes on"
    assert pair.states[-1].alarms == alarms
    answer = pair.bench.call(Deploy, "safety/deploy", reason="it falls")
    assert answer.success, answer.message
    assert len(pair.acted(Action.KILL)) == 1
    assert len(pair.acted(Action.DEPLOY)) == 1
    assert pair.acted(Action.DEPLOY)[0][0] == pair.epoch("b")


def test_a_deploy_that_the_first_began_is_ended_by_the_second_without_a_second_shot(pair):
    pair.both()
    pair.link.outcomes = [Outcome.SENT]  # nothing is confirmed: the deploy stays under way
    answer = pair.bench.ask(Deploy, "safety/deploy", reason="it falls")
    pair.bench.until(lambda: pair.acted(Action.DEPLOY), "the deploy is sent")
    pair.send_signal("a", signal.SIGKILL)
    pair.await_leader("b")
    pair.bench.until(
        lambda: (
            pair.states[-1].epoch == pair.epoch("b")
            and pair.states[-1].state == SafetyState.DEPLOYING
        ),
        "b goes on with the deploy",
    )
    pair.link.report_newest(Action.DEPLOY, Outcome.CONFIRMED)
    pair.await_stage(SafetyState.DEPLOYED)
    assert len(pair.acted(Action.DEPLOY)) == 1, "begun by the first, not shot again"
    assert not answer.done(), "the one that was asked is gone"


def test_a_kill_that_the_first_did_not_get_out_is_sent_by_the_second(pair):
    pair.both()
    pair.link.deaf = True  # as if the network ate what the first sends
    pair.bench.ask(Kill, "safety/kill", reason="stop")
    pair.bench.until(
        lambda: any(d.action == Action.KILL for d in pair.decisions), "the kill is decided"
    )
    pair.send_signal("a", signal.SIGKILL)
    pair.await_leader("b")
    pair.link.deaf = False
    pair.bench.until(lambda: pair.acted(Action.KILL), "the kill arrives")
    assert pair.acted(Action.KILL)[0][0] == pair.epoch("b")


def test_one_that_was_stopped_comes_back_as_a_follower_and_orders_nothing(pair):
    pair.both()
    first = pair.epoch("a")
    pair.send_signal("a", signal.SIGSTOP)
    pair.await_leader("b")
    seen = len(pair.decisions)
    pair.send_signal("a", signal.SIGCONT)
    pair.bench.until(lambda: "a" in pair.claims and not pair.claims["a"][1].leading, "a looks on")
    answer = pair.bench.call(Kill, "safety/kill", reason="stop")
    assert answer.success, answer.message
    assert {d.epoch for d in pair.decisions[seen:] if d.action == Action.KILL} == {pair.epoch("b")}
    assert not [d for d in pair.decisions[seen:] if d.epoch == first]


def test_two_that_set_no_standby_do_not_both_decide(pair):
    pair.start("a", 0, hot_standby=False)
    pair.await_leader("a")
    pair.start("b", 1, hot_standby=False)
    pair.bench.until(
        lambda: {"a", "b"} <= set(pair.claims) and pair.leads("a") != pair.leads("b"),
        "one of them yields",
    )


def test_a_claim_with_a_number_that_leaves_none_is_not_listened_to(pair):
    liar = SupervisorLease(name="liar", rank=3, epoch=2**32 - 1, leading=True)
    pair.start("a", 0)
    pair.bench.until(lambda: "a" in pair.claims, "a is heard")
    pair.bench.publish(liar, "safety/lease")
    pair.await_leader("a")
    assert 0 < pair.epoch("a") < 2**32 - 4
    pair.await_stage(SafetyState.READY)
    answer = pair.bench.call(Kill, "safety/kill", reason="stop")
    assert answer.success, answer.message
