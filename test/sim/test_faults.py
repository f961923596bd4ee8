"""Faults on demand: as many as asked for, the same for the same seed, none where none is asked."""

import math

import pytest
from fault_bench import BOTH_WAYS, Echo, differing, flat, pass_in

from chute_ros.sim.faults import FaultKnobs, FaultyLink

COUNT = 4000
PACKETS = [[number.to_bytes(4, "little") + bytes(range(64))] for number in range(COUNT)]
SENT = flat(PACKETS)


@BOTH_WAYS
def test_nothing_is_spoiled_where_nothing_is_asked_and_all_is_lost_where_all_is_to_be(way):
    assert way(FaultyLink, FaultKnobs(), PACKETS) == SENT
    assert way(FaultyLink, FaultKnobs(loss=1.0), PACKETS) == []


@BOTH_WAYS
def test_packets_are_lost_and_come_twice_at_the_rate_asked_for(way):
    lossy = way(FaultyLink, FaultKnobs(loss=0.3), PACKETS)
    assert 1 - len(lossy) / COUNT == pytest.approx(0.3, abs=0.04)
    assert set(lossy) <= set(SENT)
    doubled = way(FaultyLink, FaultKnobs(duplicate=0.2), PACKETS)
    assert len(doubled) / COUNT - 1 == pytest.approx(0.2, abs=0.04)
    assert set(doubled) == set(SENT)


@BOTH_WAYS
def test_one_byte_is_wrong_at_the_rate_asked_for(way):
    arrived = way(FaultyLink, FaultKnobs(corrupt=0.5), PACKETS)
    wrong = [differing(got, sent) for got, sent in zip(arrived, SENT, strict=True)]
    assert set(wrong) == {0, 1}
    assert sum(wrong) / COUNT == pytest.approx(0.5, abs=0.04)


def test_each_copy_of_a_packet_is_spoiled_by_itself():
    arrived = pass_in(FaultyLink, FaultKnobs(duplicate=1.0, corrupt=1.0), PACKETS[:50])
    assert len(arrived) == 100
    for first, second, sent in zip(arrived[::2], arrived[1::2], SENT, strict=False):
        assert differing(first, sent) == differing(second, sent) == 1


@BOTH_WAYS
def test_the_same_seed_spoils_the_same_packets(way):
    knobs = FaultKnobs(loss=0.3, duplicate=0.2, corrupt=0.2, delay=0.1)
    once, again, other = (way(FaultyLink, knobs, PACKETS[:300], seed) for seed in (7, 7, 8))
    assert once == again != other


def test_a_delayed_packet_comes_in_its_time_and_the_loop_knows_when():
    device = Echo()
    link = FaultyLink(device, FaultKnobs(delay=0.5), seed=1)
    for _ in range(100):
        link.receive(b"x", 10.0)
    while link.next_deadline() < math.inf:
        link.update(link.next_deadline())
    times = [when for when, _ in device.received]
    assert len(times) == 100
    assert times == sorted(times)
    assert times[0] < 10.1
    assert 10.4 < times[-1] <= 10.5


def test_a_delayed_answer_leaves_in_its_time():
    device = Echo()
    link = FaultyLink(device, FaultKnobs(delay=0.5), seed=1)
    device.output = [b"answer"]
    link.update(10.0)
    assert link.take_output() == []
    due = link.next_deadline()
    assert 10.0 < due <= 10.5
    link.update(due)
    assert link.take_output() == [b"answer"]


def test_the_rest_passes_untouched():
    device = Echo()
    link = FaultyLink(device, FaultKnobs(loss=1.0), seed=1)
    link.stream_ended("stream")
    assert device.ended == ["stream"]
    assert link.take_events() == ["event"]
    device.deadline = 12.5
    assert link.next_deadline() == 12.5
