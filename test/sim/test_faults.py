"""Faults on demand: as many as asked for, the same for the same seed, none where none is asked."""

import math

import pytest

from chute_ros.errors import ParameterError
from chute_ros.sim.faults import FaultKnobs, FaultyLink

COUNT = 4000
FRAME = bytes(range(64))


class Echo:
    """A device that keeps what comes and sends what it is given."""

    def __init__(self):
        self.received, self.output, self.ended, self.deadline = [], [], [], math.inf

    def receive(self, data, now, stream=None):
        self.received.append((now, data, stream))

    def stream_ended(self, stream):
        self.ended.append(stream)

    def update(self, now):
        pass

    def next_deadline(self):
        return self.deadline

    def take_output(self):
        output, self.output = self.output, []
        return output

    def take_events(self):
        return ["event"]


def pass_in(knobs, seed=1, count=COUNT):
    """What a device hears of count frames."""
    device = Echo()
    link = FaultyLink(device, knobs, seed)
    for number in range(count):
        link.receive(number.to_bytes(4, "little") + FRAME, 0.0)
    link.update(1000.0)
    return [data for _, data, _ in device.received]


def pass_out(knobs, seed=1, count=COUNT):
    """What the wire gets of count frames."""
    device = Echo()
    link = FaultyLink(device, knobs, seed)
    device.output = [number.to_bytes(4, "little") + FRAME for number in range(count)]
    link.update(0.0)
    link.update(1000.0)
    return link.take_output()


BOTH_WAYS = pytest.mark.parametrize("way", [pass_in, pass_out])
ALL_SENT = [number.to_bytes(4, "little") + FRAME for number in range(COUNT)]


@BOTH_WAYS
def test_nothing_is_spoiled_where_nothing_is_asked(way):
    assert way(FaultKnobs()) == ALL_SENT


@BOTH_WAYS
def test_packets_are_lost_at_the_rate_asked_for(way):
    arrived = way(FaultKnobs(loss=0.3))
    assert 1 - len(arrived) / COUNT == pytest.approx(0.3, abs=0.04)
    assert set(arrived) <= set(ALL_SENT)


@BOTH_WAYS
def test_packets_come_twice_at_the_rate_asked_for(way):
    arrived = way(FaultKnobs(duplicate=0.2))
    assert len(arrived) / COUNT - 1 == pytest.approx(0.2, abs=0.04)
    assert set(arrived) == set(ALL_SENT)


@BOTH_WAYS
def test_one_byte_is_wrong_at_the_rate_asked_for(way):
    arrived = way(FaultKnobs(corrupt=0.5))
    differing = [
        sum(a != b for a, b in zip(got, sent, strict=True))
        for got, sent in zip(arrived, ALL_SENT, strict=True)
    ]
    assert set(differing) == {0, 1}
    assert sum(differing) / COUNT == pytest.approx(0.5, abs=0.04)


@BOTH_WAYS
def test_all_is_lost_where_all_is_to_be_lost(way):
    assert way(FaultKnobs(loss=1.0)) == []


def test_each_copy_of_a_packet_is_spoiled_by_itself():
    arrived = pass_in(FaultKnobs(duplicate=1.0, corrupt=1.0), count=50)
    assert len(arrived) == 100
    for first, second, sent in zip(arrived[::2], arrived[1::2], ALL_SENT, strict=False):
        for copy in (first, second):
            assert sum(a != b for a, b in zip(copy, sent, strict=True)) == 1


@BOTH_WAYS
def test_the_same_seed_spoils_the_same_packets(way):
    knobs = FaultKnobs(loss=0.3, duplicate=0.2, corrupt=0.2, delay=0.1)
    assert way(knobs, seed=7, count=300) == way(knobs, seed=7, count=300)
    assert way(knobs, seed=7, count=300) != way(knobs, seed=8, count=300)


def test_a_delayed_packet_comes_in_its_time_and_the_loop_knows_when():
    device = Echo()
    link = FaultyLink(device, FaultKnobs(delay=0.5), seed=1)
    for _ in range(100):
        link.receive(b"x", 10.0)
    while link.next_deadline() < math.inf:
        link.update(link.next_deadline())
    times = [when for when, _, _ in device.received]
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


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("loss", 1.1, "need 0 to 1"),
        ("loss", -0.1, "need 0 to 1"),
        ("duplicate", 30.0, "need 0 to 1"),
        ("corrupt", math.nan, "need 0 to 1"),
        ("delay", -1.0, "need 0 to 60 s"),
        ("delay", 61.0, "need 0 to 60 s"),
    ],
)
def test_what_is_no_rate_is_named(name, value, allowed):
    with pytest.raises(ParameterError, match=f"{name} is {value}: {allowed}"):
        FaultKnobs(**{name: value})
