"""Service calls: sent, sent again, answered or given up; an answer never meets another call."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.calls import MOST_AT_ONCE, Call, CallLimits, ServiceCalls
from chute_ros.protocol.dronecan.scripts import Scripts

SERVICE = "flyfire.ParachuteService"
DEPLOY = Call(33, SERVICE, {"type": 5}, 0)
OTHER = Call(33, "uavcan.protocol.GetNodeInfo", {})
LIMITS = CallLimits(0.25, 3)


def ids(calls):
    return [send.transfer_id for send in calls.take_output()]


def answer(calls, transfer_id, now, server=33, service=SERVICE, **values):
    calls.response(server, service, transfer_id, values, now)
    return calls.take_finished()


def calling(*tokens, call=DEPLOY):
    """These calls were started at t+0."""
    calls = ServiceCalls(LIMITS)
    for token in tokens:
        calls.start(token, call, 0.0)
    return calls


def tokens(calls):
    return [send.token for send in calls.take_output()]


def test_limits_that_make_no_sense_are_refused():
    for timeout, tries in ((0.0, 3), (math.inf, 3), (math.nan, 3), (0.25, 0), (0.25, 8)):
        with pytest.raises(ParameterError, match="need"):
            CallLimits(timeout, tries)


def test_a_call_is_sent_and_answered():
    calls = calling(1)
    (send,) = calls.take_output()
    assert (send.command, send.transfer_id, send.token) == (DEPLOY, 0, 1)
    assert calls.next_deadline() == 0.25
    (end,) = answer(calls, 0, 0.1, result=0)
    assert (end.token, end.values, end.sends, end.seconds) == (1, {"result": 0}, 1, 0.1)
    assert end.accepted
    assert end.text() == "answered (after 0.10 s)"
    assert calls.next_deadline() == math.inf


def test_a_call_that_nobody_answers_is_sent_again_and_given_up():
    calls = ServiceCalls(LIMITS)
    calls.start(1, DEPLOY, 10.0)
    sent = []
    while (now := calls.next_deadline()) < math.inf:
        sent += ids(calls)
        calls.update(now)
    assert sent == [0, 1, 2]
    (end,) = calls.take_finished()
    assert now == math.inf
    assert (end.values, end.sends, end.seconds) == (None, 3, 0.75)
    assert (end.accepted, end.not_now) == (False, True)
    assert end.text() == "no acknowledgement after 3 sends in 0.75 s"
    assert calls.counts == {"calls without an answer": 1}


def test_a_late_answer_to_an_earlier_try_counts_and_the_next_is_nobodys():
    calls = calling(1)
    calls.update(0.25)
    assert ids(calls) == [0, 1]
    (end,) = answer(calls, 0, 0.3, result=0)
    assert (end.token, end.sends) == (1, 2)
    assert answer(calls, 1, 0.31, result=0) == []
    assert calls.counts == {"unexpected responses": 1}
    # So is one of another server, service or id.
    calls = calling(1)
    assert answer(calls, 0, 0.1, server=34) == []
    assert answer(calls, 0, 0.1, service=OTHER.service) == []
    assert answer(calls, 9, 0.1) == []
    assert calls.counts == {"unexpected responses": 3}


def test_each_server_and_service_counts_its_own_ids():
    calls = ServiceCalls(LIMITS)
    for token, call in enumerate((DEPLOY, OTHER, DEPLOY, Call(34, SERVICE, {}), OTHER)):
        calls.start(token, call, 0.0)
    assert ids(calls) == [0, 0, 1, 0, 1]


def test_the_reader_says_what_an_answer_means_and_is_not_asked_without_one():
    asked = []

    def read(finished):
        asked.append(finished.token)
        return finished.__class__(**{**finished.__dict__, "accepted": False, "words": "rejected"})

    calls = ServiceCalls(CallLimits(0.25, 1), read)
    calls.start(1, DEPLOY, 0.0)
    (end,) = answer(calls, 0, 0.1, result=1)
    assert (end.accepted, end.text()) == (False, "rejected (after 0.10 s)")
    calls.start(2, DEPLOY, 1.0)
    calls.update(1.25)
    assert len(calls.take_finished()) == 1
    assert asked == [1]


def test_more_calls_than_may_wait_at_once_follow_in_their_order_but_an_urgent_one():
    calls = calling(*range(MOST_AT_ONCE + 2))
    calls.start(100, OTHER, 0.0)
    assert tokens(calls) == [0, 1, 2, 3, 100]
    (end,) = answer(calls, 2, 0.1)
    assert end.token == 2
    assert tokens(calls) == [4]
    calls.start(6, DEPLOY, 0.1)
    assert calls.take_output() == []
    answer(calls, 0, 0.1)
    assert tokens(calls) == [5]
    calls = calling(*range(10))
    calls.take_output()
    calls.start(99, DEPLOY, 0.0, urgent=True)
    assert tokens(calls) == [99]


def test_a_request_whose_answer_does_not_matter_is_sent_once():
    calls = calling()
    calls.send_once(DEPLOY, 0.0)
    (send,) = calls.take_output()
    assert (send.command, send.token) == (DEPLOY, None)
    assert calls.next_deadline() == math.inf


def test_a_cancelled_call_is_neither_sent_nor_told_of():
    calls = calling(*range(MOST_AT_ONCE + 2))
    for token in (0, MOST_AT_ONCE + 1, 77):
        calls.cancel(token, 0.0)
    assert tokens(calls) == [1, 2, 3, 4]
    assert answer(calls, 0, 0.1) == []
    for now in (0.25, 0.5, 0.75):
        calls.update(now)
    assert sorted(end.token for end in calls.take_finished()) == [1, 2, 3, 4]


def test_a_call_that_cannot_be_put_on_the_bus_ends_in_words():
    calls = calling(1)
    (send,) = calls.take_output()
    calls.unsendable(send, "type is 300", 0.0)
    (end,) = calls.take_finished()
    assert (end.values, end.accepted, end.text()) == (None, False, "not sent: type is 300")
    calls.unsendable(send, "again", 0.0)
    calls.send_once(DEPLOY, 0.0)
    calls.unsendable(calls.take_output()[0], "nobody waits for it", 0.0)
    assert calls.take_finished() == []
    assert calls.next_deadline() == math.inf


def test_an_unanswered_id_is_not_used_again_while_its_answer_may_still_come():
    calls = ServiceCalls(LIMITS)
    calls.start(0, DEPLOY, 0.0)
    calls.update(0.25)
    assert ids(calls) == [0, 1]
    answer(calls, 1, 0.26)
    used = []
    for token in range(1, 40):
        calls.start(token, DEPLOY, 0.3)
        used += ids(calls)
        assert [end.token for end in answer(calls, used[-1], 0.3)] == [token]
    assert used == [*range(2, 32), *range(1, 10)]
    # Id 0 was never answered; its answer, late by now, meets nobody.
    assert answer(calls, 0, 0.3) == []
    calls.start(50, DEPLOY, 2.1)
    assert ids(calls) == [10]


def test_with_all_ids_under_way_the_newest_urgent_call_gets_the_id_sent_first():
    calls = ServiceCalls(CallLimits(10.0, 1))
    for token in range(33):
        calls.start(token, DEPLOY, token / 100, urgent=True)
    assert ids(calls) == [*range(32), 0]
    assert [end.token for end in answer(calls, 0, 1.0)] == [32]


@settings(max_examples=60)
@given(st.integers(0, 2**32), st.integers(33, 120), st.floats(0, 0.6), st.integers(1, 7))
def test_many_calls_in_a_row_never_mix_up_their_answers_nor_wait_too_many(
    seed, count, trouble, tries
):
    """Answers are lost, doubled, and late by up to 1.9 s."""
    chance = random.Random(seed)
    calls = ServiceCalls(CallLimits(0.25, tries))
    now, started, ended, on_the_way, sends = 0.0, 0, {}, [], {}
    while len(ended) < count:
        assert calls.next_deadline() > now or now == 0.0
        if started < count and chance.random() < 0.7:
            calls.start(started, Call(33, SERVICE, {"number": started}), now)
            started += 1
        for send in calls.take_output():
            sends[send.token] = sends.get(send.token, 0) + 1
            late = 1.9 * chance.random() if chance.random() < trouble else 0.01
            said = {"number": send.command.values["number"]}
            if chance.random() >= trouble / 2:
                answers = [(now + late, send.transfer_id, said)] * chance.choice([1, 1, 2])
                on_the_way += answers
        now += chance.choice([0.0, 0.001, 0.02, 0.3])
        for _, number, values in [one for one in on_the_way if one[0] <= now]:
            calls.response(33, SERVICE, number, values, now)
        on_the_way = [one for one in on_the_way if one[0] > now]
        calls.update(now)
        for end in calls.take_finished():
            assert end.token not in ended
            ended[end.token] = end
            if end.values is not None:
                assert end.values["number"] == end.token
        waiting = [token for token in sends if token not in ended]
        assert len(waiting) <= MOST_AT_ONCE
        assert max(sends.values(), default=0) <= tries
    assert calls.next_deadline() == math.inf


def script(*numbers):
    """Asks one after the other; its result is what was answered."""
    answers = []
    for number in numbers:
        finished = yield Call(33, SERVICE, {"number": number})
        answers.append(finished.values)
    return answers


def drive(scripts, now=0.0):
    """Answer what is sent with its own fields, until nothing is."""
    while sends := scripts.take_output():
        for send in sends:
            call = send.command
            scripts.calls.response(call.server, call.service, send.transfer_id, call.values, now)
        scripts.drive(now)


def test_scripts_run_side_by_side_and_each_ends_with_its_result():
    scripts = Scripts(LIMITS)
    scripts.begin("a", script(1, 2), 0.0)
    scripts.begin(("b", 7), script(3), 0.0)
    drive(scripts)
    assert scripts.take_ended() == [
        (("b", 7), [{"number": 3}]),
        ("a", [{"number": 1}, {"number": 2}]),
    ]
    assert scripts.take_ended() == []


def test_a_script_without_a_call_ends_at_once():
    scripts = Scripts(LIMITS)
    scripts.begin("a", script(), 0.0)
    assert scripts.take_ended() == [("a", [])]
    assert scripts.take_output() == []


def test_a_script_is_told_that_nobody_answered_and_goes_on():
    scripts = Scripts(LIMITS)
    scripts.begin("a", script(1, 2), 0.0)
    for now in (0.25, 0.5, 0.75):
        scripts.update(now)
    # The first has been given up, the second was sent.
    assert [send.command.values["number"] for send in scripts.take_output()] == [1, 1, 1, 2]
    for now in (1.0, 1.25, 1.5):
        scripts.update(now)
    assert scripts.take_ended() == [("a", [None, None])]
    assert scripts.calls.next_deadline() == math.inf


def test_forty_scripts_of_three_calls_each():
    scripts = Scripts(LIMITS)
    for token in range(40):
        scripts.begin(token, script(*range(token, token + 3)), 0.0)
    drive(scripts)
    ended = dict(scripts.take_ended())
    assert ended == {
        token: [{"number": number} for number in range(token, token + 3)] for token in range(40)
    }
