"""What the ground station reads: given a block or an order, at t+..., then these texts."""

import pytest
from link_bench import ASLEEP, Bench, ack, copter, heartbeat, landed, status

from chute_ros.links.mavlink.protocol.announcements import (
    REASON_AGAIN,
    REASON_INTERVAL,
    Announcements,
)
from chute_ros.links.mavlink.protocol.config import KillMethod
from chute_ros.protocol.mavlink.dialect import dialect as d

PILOT, CHUTE = (1, 1), (1, 161)
KILL, RELEASE = 400, 208
LONG = (
    "parachute 1/161: heartbeat LOST: 12.3 s old; battery 13.9 V, need 14.0 V; mavlink link lost"
)


def flying():
    bench = Bench(**ASLEEP, kill_method=KillMethod.FLIGHT_TERMINATION)
    bench.hear(PILOT, copter(armed=True), landed(2)).hear(CHUTE, heartbeat(), status())
    bench.clear()
    return bench


def block(bench, reason):
    bench.call("flight_block", reason)
    return bench


def test_the_whole_reason_comes_first_in_as_many_chunks_as_it_takes():
    # The whole reason comes first in as many chunks as it takes.
    bench = block(flying(), LONG)
    assert bench.texts() == [f"{LONG}: flight blocked"]
    first, *_ = [m for _, m in bench.sent if m.get_type() == "STATUSTEXT"]
    assert first.text == LONG[:50]
    assert first.id != 0
    # Two long texts have different ids.
    bench = block(block(flying(), LONG).at(3.0), LONG[::-1])
    ids = [m.id for _, m in bench.sent if m.get_type() == "STATUSTEXT"]
    assert len(set(ids)) == 2


def test_a_reason_that_changes_is_said_anew_at_a_pace_and_the_newest_wins():
    bench = flying()
    for step in range(19):
        block(bench.at(step / 10), f"reason {step}")
    assert bench.texts() == ["reason 0: flight blocked"]
    bench.at(REASON_INTERVAL)
    assert bench.texts() == ["reason 0: flight blocked", "reason 18: flight blocked"]
    bench.at(60.0)
    assert len(bench.texts()) == 2


def test_a_reason_is_said_again_only_if_it_changes_and_stays():
    # A reason that is told again is not said again.
    bench = block(flying(), "x")
    for second in range(1, 20):
        block(bench.at(second), "x")
    assert bench.texts() == ["x: flight blocked"]
    block(bench.at(30.0), "")
    assert bench.texts() == ["x: flight blocked", "flight block released"]
    # One that comes and goes within the pace says nothing.
    bench = block(flying(), "x")
    block(bench.at(0.5), "y")
    block(bench.at(1.0), "x")
    bench.at(10.0)
    assert bench.texts() == ["x: flight blocked"]


def test_a_reason_said_before_the_autopilot_was_there_is_said_again_as_it_comes():
    bench = block(Bench(**ASLEEP), "x").at(5.0)
    told = ["x: flight blocked"]
    assert bench.texts() == told
    bench.stream(8.0, 0.5, PILOT, copter, landed)
    assert bench.texts() == told * 2
    # Lost, and back: it may have missed what was said meanwhile.
    block(bench.at(18.0), "y")
    bench.stream(22.0, 0.5, PILOT, copter, landed)
    assert bench.texts() == told * 2 + ["y: flight blocked"] * 2


def test_a_reason_that_stands_is_said_again_on_the_ground_and_not_in_flight():
    bench = block(Bench(**ASLEEP), "x")
    bench.stream(3.5 * REASON_AGAIN, 1.0, PILOT, copter, landed)
    # To nobody, as the autopilot came, and three times.
    assert bench.texts().count("x: flight blocked") == 5
    bench.clear()
    block(bench, "")
    bench.stream(5.5 * REASON_AGAIN, 1.0, PILOT, copter, landed)
    assert bench.texts() == ["flight block released"]
    bench = block(flying(), "x")
    bench.stream(3.5 * REASON_AGAIN, 1.0, PILOT, lambda: copter(armed=True), lambda: landed(2))
    assert bench.texts().count("x: flight blocked") == 1


def test_a_kill_is_said_when_it_is_ordered_and_when_it_is_confirmed():
    bench = flying().call("kill", 1)
    bench.at(0.1).hear(PILOT, ack(KILL), copter(armed=False)).at(0.2)
    ordered, confirmed = bench.texts()
    assert ordered == "KILL ordered"
    assert confirmed.startswith("KILL confirmed: ")


def test_a_kill_that_is_refused_and_one_that_fails_are_said():
    bench = flying().call("kill", 1)
    bench.at(0.1).hear(PILOT, ack(KILL, d.MAV_RESULT_TEMPORARILY_REJECTED))
    bench.stream(20.0, 0.5, PILOT, lambda: copter(armed=True))
    texts = bench.texts()
    assert texts[0] == "KILL ordered"
    assert texts[1].startswith("KILL refused, still trying: ")
    assert texts[-1].startswith("KILL FAILED: ")
    assert len(texts) == 3


def test_a_deploy_names_the_parachute():
    bench = flying().call("deploy", 1, True)
    bench.at(0.1).hear(CHUTE, ack(225), status(armed=4), ack(RELEASE))
    bench.hear(CHUTE, status(deployed=4)).at(0.5)
    texts = bench.texts()
    assert texts[0] == "DEPLOY of 1/161 ordered"
    assert texts[-1].startswith("DEPLOY of 1/161 confirmed: ")


def test_texts_and_orders_without_end_do_not_grow_us():
    announcements = Announcements()
    for token in range(1000):
        announcements.ordered(token, "KILL")
    assert len(announcements.take(0.0)) <= 8
    assert announcements.take(0.0) == []


@pytest.mark.parametrize("reason", ["", "x" * 1000, "ä" * 60])
def test_any_reason_can_be_said(reason):
    assert all(len(text) < 310 for text in block(flying(), reason).texts())
