"""The time of the bus: one master, the lowest node id, the others silent until it is."""

import itertools
import math

from dronecan_bench import OWN, START, TIME, Bench, shown
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.protocol.dronecan.time_sync import INTERVAL, MASTER_TIMEOUT, TimeMaster

STAMP = "previous_transmission_timestamp_usec"
OFFSET = 1.7e9


def stamps(bench):
    return [(t, values[STAMP]) for t, values in bench.said(TIME)]


def test_golden_each_message_tells_when_the_one_before_was_sent():
    bench = Bench(time_master=True, utc_offset=OFFSET).at(2.0)
    microseconds = [0, *(round((OFFSET + START + t) * 1e6) for t in (0.0, 1.0))]
    assert stamps(bench) == list(zip((0.0, 1.0, 2.0), microseconds, strict=True))
    golden = [frame for frame in shown(bench.frames) if frame.startswith("0800040a")]
    assert golden == [
        "0800040a#00000000000000c0",
        # 1 700 001 000 000 000 and 1 700 001 001 000 000, little endian.
        "0800040a#" + (1_700_001_000_000_000).to_bytes(7, "little").hex() + "c1",
        "0800040a#" + (1_700_001_001_000_000).to_bytes(7, "little").hex() + "c2",
    ]


def test_a_node_with_a_lower_id_is_the_master_and_we_take_over_after_its_silence():
    bench = Bench(time_master=True, utc_offset=OFFSET).at(0.5)
    bench.hear(5, TIME).clear().at(1.5).hear(5, TIME).at(2.5).hear(5, TIME)
    bench.at(4.6)
    assert stamps(bench) == []
    bench.at(7.0)
    # The first of ours does not refer to what we sent before the other.
    (first, zero), (second, stamp), *_ = stamps(bench)
    assert 2.5 + MASTER_TIMEOUT <= first <= 2.5 + MASTER_TIMEOUT + INTERVAL
    assert (zero, stamp) == (0, round((OFFSET + START + first) * 1e6))
    assert second == first + 1.0


def test_a_node_with_a_higher_id_should_yield_to_us():
    bench = Bench(time_master=True).hear(20, TIME).at(1.0)
    assert len(stamps(bench)) == 2
    (trouble,) = bench.node.troubles()
    assert trouble.startswith("node 20 is a time master as well and should yield to us (10)")
    bench.at(3.0)
    assert bench.node.troubles() == []
    assert bench.notices()[-1].startswith("resolved: node 20 is a time master")


def test_of_two_others_the_lower_one_counts_until_it_is_silent():
    master = TimeMaster(OWN, 0.0)
    master.heard(5, 0.0)
    master.heard(20, 0.5)
    assert not master.is_master(0.5)
    assert not master.contested(0.5)
    master.heard(20, 2.2)
    assert master.is_master(2.2)
    assert master.contested(2.2)
    master.heard(3, 2.3)
    assert not master.is_master(2.3)


def test_an_anonymous_time_is_nobodys():
    master = TimeMaster(OWN, 0.0)
    master.heard(0, 0.0)
    assert master.is_master(0.0)
    assert master.other == 0


def test_who_is_not_to_be_master_sends_no_time():
    assert stamps(Bench(time_master=False).at(5.0)) == []


@given(
    st.floats(0, 1e6),
    st.lists(st.tuples(st.floats(0, 3), st.sampled_from([0, 0, 5, 20])), max_size=40),
)
def test_the_time_never_runs_back_and_refers_to_the_message_before(now, steps):
    master, sent = TimeMaster(OWN, OFFSET), []
    lower_heard = -math.inf
    for pause, source in steps:
        now += pause
        if source:
            master.heard(source, now)
        lower_heard = now if source == 5 else lower_heard
        message = master.update(now)
        assert master.next_deadline() > now
        if message is None:
            continue
        assert now - lower_heard >= MASTER_TIMEOUT
        stamp = message[STAMP]
        assert stamp == 0 or stamp == round((sent[-1] + OFFSET) * 1e6)
        sent.append(now)
    assert all(b - a >= INTERVAL - 1e-6 for a, b in itertools.pairwise(sent))
