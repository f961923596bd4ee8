"""Requests under way: each ends exactly once, and what is not wanted any more is not sent."""

import math
import random

from hypothesis import given, settings
from hypothesis import strategies as st
from link_bench import Bench, heartbeat
from link_bench import ack as ack_message

from chute_ros.links.mavlink.protocol import results
from chute_ros.links.mavlink.protocol.commands import (
    Acknowledgement,
    CommandTransactions,
    MavCommand,
)
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.goals import MessageWatch
from chute_ros.model import Outcome
from chute_ros.protocol.effect import ConfirmedCommand
from chute_ros.protocol.events import RequestFinished, RequestReport
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.requests import Requests

ORDER = MavCommand(1, 161, 208, (2.0, *[0.0] * 6))
SET = MavCommand(1, 161, 511, (430.0, 500000.0, *[0.0] * 5))
ASK = MavCommand(1, 161, 512, (244.0, 430.0, *[0.0] * 5))


def fresh():
    config = MavlinkConfig()
    return Requests(CommandTransactions(config.commands), config.effect)


def goal(name="release", command=ORDER, **options):
    return ConfirmedCommand(name, (command,), "shown", **options)


def ack(requests, command, now, result=results.ACCEPTED):
    requests.commands.acknowledged(Acknowledgement(1, 161, command.number, result), now)
    return requests.drive(now)


def ends(requests):
    return [e for e in requests.take_events() if isinstance(e, RequestFinished)]


def test_a_request_is_sent_acknowledged_and_ends_once():
    requests = fresh()
    requests.begin(5, goal(), 0.0)
    assert [send.command for send in requests.drive(0.0)] == [ORDER]
    assert 5 in requests
    assert requests.under_way("release")
    ack(requests, ORDER, 0.1)
    (end,) = ends(requests)
    assert (end.finished.token, end.finished.success) == (5, True)
    assert 5 not in requests
    assert requests.next_deadline() == math.inf


def test_a_refused_request_reports_and_ends_without_anything_sent():
    requests = fresh()
    requests.refuse(5, "no parachute")
    report, end = requests.take_events()
    assert isinstance(report, RequestReport)
    assert report.report.outcome is Outcome.FAILED
    assert end.finished.message == "no parachute"
    assert requests.drive(0.0) == []


def interval(requests):
    message = d.MAVLINK_MSG_ID_MESSAGE_INTERVAL
    watch = MessageWatch(1, 161, message, "message_id", 430)
    read_back = (goal("read", ASK, shown=watch.seen), watch)
    requests.begin(5, goal("set", SET), 0.0, follow_up=read_back)
    requests.drive(0.0)
    ack(requests, SET, 0.1)


def test_a_follow_up_is_asked_after_success_and_its_message_handed_over():
    requests = fresh()
    interval(requests)
    assert ends(requests) == []
    requests.heard(1, 161, d.MAVLink_message_interval_message(33, 1))
    requests.heard(1, 162, d.MAVLink_message_interval_message(430, 2))
    requests.heard(1, 161, d.MAVLink_message_interval_message(430, 500000))
    requests.effects_may_show(0.2)
    requests.drive(0.2)
    (end,) = ends(requests)
    assert end.finished.success
    assert end.data.interval_us == 500000


def test_a_follow_up_that_fails_cannot_turn_success_into_failure():
    requests = fresh()
    interval(requests)
    ack(requests, ASK, 0.2, results.DENIED)
    (end,) = ends(requests)
    assert end.finished.success
    assert end.data is None
    assert "set acknowledged" in end.finished.message
    assert "denied" in end.finished.message


def test_a_release_makes_way_for_itself():
    requests = fresh()
    requests.begin(5, goal("disable", hinders_release=True), 0.0)
    requests.drive(0.0)
    requests.make_way_for_release(0.1)
    requests.drive(0.1)
    (end,) = ends(requests)
    assert "a release was ordered" in end.finished.message
    requests.update(10.0)
    assert requests.drive(10.0) == []


def test_two_callers_of_the_same_urgent_goal_are_both_answered():
    requests = fresh()
    requests.begin(5, goal(urgent=True), 0.0)
    requests.drive(0.0)
    requests.begin(6, goal(urgent=True), 0.1)
    requests.drive(0.1)
    ack(requests, ORDER, 0.2)
    assert sorted(end.finished.token for end in ends(requests)) == [5, 6]


GOALS = st.builds(
    goal,
    st.sampled_from(["release", "disable", "ask"]),
    st.sampled_from([ORDER, SET, ASK, MavCommand(1, 162, 208)]),
    insist=st.booleans(),
    urgent=st.booleans(),
    hinders_release=st.booleans(),
    refresh=st.sampled_from([None, ASK]),
)
STEPS = st.one_of(
    st.tuples(st.just("begin"), GOALS),
    st.tuples(st.just("begin all"), st.lists(GOALS, min_size=1, max_size=3)),
    st.tuples(st.just("ack"), st.sampled_from([ORDER, SET, ASK]), st.integers(0, 12)),
    st.tuples(st.just("release")),
    st.tuples(st.just("abandon")),
)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.sampled_from([0.0, 0.01, 0.3, 1.0, 7.0]), STEPS), max_size=30))
def test_each_request_ends_exactly_once_and_the_next_deadline_is_never_in_the_past(steps):
    requests, now, begun, ended = fresh(), 1000.0, [], []
    for wait, step in steps:
        now += wait
        requests.update(now)
        if step[0] == "begin":
            begun.append(len(begun) + 1)
            requests.begin(begun[-1], step[1], now)
        elif step[0] == "begin all":
            begun.append(len(begun) + 1)
            requests.begin_all(begun[-1], {str(n): one for n, one in enumerate(step[1])}, now)
        elif step[0] == "ack":
            ack(requests, step[1], now, step[2])
        elif step[0] == "release":
            requests.make_way_for_release(now)
        elif begun:
            requests.abandon(begun[-1], "not wanted", now)
        requests.drive(now)
        ended += [end.finished.token for end in ends(requests)]
        assert requests.next_deadline() > now
    while (deadline := requests.next_deadline()) < math.inf:
        now = deadline
        requests.update(now)
        requests.drive(now)
        ended += [end.finished.token for end in ends(requests)]
        assert now < 2000.0
    assert sorted(ended) == begun


def test_what_prepares_a_goal_leaves_right_before_it_and_its_answer_ends_nothing():
    requests, prepare = fresh(), MavCommand(1, 161, 225)
    requests.begin(5, ConfirmedCommand("release", (prepare, ORDER), "shown", urgent=True), 0.0)
    requests.drive(0.0)
    ack(requests, prepare, 0.1, results.DENIED)
    ack(requests, prepare, 0.1)
    assert ends(requests) == []
    requests.update(0.2)
    assert [send.command for send in requests.drive(0.2)] == [prepare, ORDER]


def test_goals_side_by_side_end_together_and_one_that_fails_is_named_first():
    requests, other = fresh(), MavCommand(1, 162, 208)
    requests.begin_all(5, {"a": goal(), "b": goal(command=other)}, 0.0)
    assert [send.command for send in requests.drive(0.0)] == [ORDER, other]
    ack(requests, ORDER, 0.1)
    assert ends(requests) == []
    requests.commands.acknowledged(Acknowledgement(1, 162, 208, results.DENIED), 0.2)
    requests.drive(0.2)
    (end,) = ends(requests)
    assert (end.finished.success, end.finished.result) == (False, results.DENIED)
    assert end.finished.message.startswith("b: release denied")
    assert end.finished.message.endswith("; a: release acknowledged after 0.10 s")
    assert requests.next_deadline() == math.inf


def test_what_prepared_a_goal_is_not_sent_again_once_it_is_reached():
    requests, prepare = fresh(), MavCommand(1, 161, 225)
    requests.begin(5, ConfirmedCommand("release", (prepare, ORDER), "shown"), 0.0)
    assert [send.command for send in requests.drive(0.0)] == [prepare, ORDER]
    ack(requests, ORDER, 0.1)
    assert ends(requests)[0].finished.success
    assert requests.next_deadline() == math.inf


def test_a_request_that_is_abandoned_while_it_waits_for_its_turn_is_never_sent():
    requests = fresh()
    requests.begin(5, goal("first", ORDER), 0.0)
    requests.drive(0.0)
    requests.begin(6, goal("second", MavCommand(1, 161, 208)), 0.1)
    requests.abandon(6, "not wanted", 0.1)
    assert requests.drive(0.1) == []
    assert ack(requests, ORDER, 0.2) == []
    assert {end.finished.token: end.finished.success for end in ends(requests)} == {
        5: True,
        6: False,
    }


CHUTE = (1, 161)
ANSWERS = {0: results.DENIED, 1: results.ACCEPTED}


@settings(max_examples=150)
@given(st.integers(0, 2**32), st.floats(0, 0.8), st.floats(0.001, 4.9), st.booleans())
def test_copies_of_acknowledgements_settle_no_later_request(seed, loss, slowest, talks):
    """The device denies 0 and accepts 1; the network loses, delays, swaps and copies answers."""
    chance, bench, wire, seen = random.Random(seed), Bench(), [], 0
    bench.hear(CHUTE, heartbeat()).hear(CHUTE, heartbeat())
    actions = {token: chance.choice([0, 1]) for token in range(1, 9)}
    for token, action in actions.items():
        bench.call("parachute_action", token, action, "")
        until = bench.t + chance.choice([0.05, 0.3, 1.0, 6.0])
        while bench.t < until:
            for _, order in bench.sent[seen:]:
                if order.command == 208 and chance.random() >= loss:
                    answer = ack_message(208, ANSWERS[int(order.param1)])
                    raw = bench.encoder(CHUTE).encode(answer, bench.now)
                    copies = chance.choice([0, 1, 1, 2, 3])
                    wire += [(bench.t + chance.random() * slowest, raw) for _ in range(copies)]
            seen = len(bench.sent)
            wire.sort()
            arrival = wire[0][0] if wire else math.inf
            bench.at(max(bench.t, min(arrival, bench.link.next_deadline() - 1000.0, until)))
            if bench.t >= arrival:
                bench.link.receive(wire.pop(0)[1], bench.now)
                bench.collect()
            if talks and chance.random() < 0.2:
                bench.hear(CHUTE, heartbeat())
    bench.at(bench.t + 30.0)
    for token, action in actions.items():
        result = bench.end(token).finished.result
        assert result in (results.NO_ACKNOWLEDGEMENT, ANSWERS[action])
