"""Two supervisors, each a process of its own: one leads, the other takes over, no shot is lost."""

import signal
import time

from chute_msgs.msg import SafetyState, SupervisorLease
from chute_msgs.srv import Deploy, Kill
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from chute_ros.model import Action, Outcome


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
    # To both: a process that dies between two sends tells one of them.
    pair.await_word_to("b")
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
    pair.bench.until(lambda: pair.offers("b") and not pair.offers("a"), "b's services are there")
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
    said = pair.bench.follow(DiagnosticArray, "/diagnostics")

    def both_say():
        every = [one for array in said for one in array.status if one.name.endswith(": itself")]
        wrong = [one for one in every if one.level == DiagnosticStatus.ERROR]
        return {one.message.partition(":")[0] for one in wrong} >= {
            "a runs as well",
            "b runs as well",
        }

    pair.bench.until(both_say, "each says that the other is there")


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
