"""Two devices with the same ids: found by their clocks; one that restarts, or is late, is one."""

import random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from chute_ros.links.mavlink.protocol.twins import OVER_AFTER, Twins
from chute_ros.protocol.boot_clock import Age, BootClock

KINDS = ("ATTITUDE", "GLOBAL_POSITION_INT", "SCALED_IMU")


def said(booted, start, end, rate=10.0, phase=0.0, kinds=KINDS):
    """(time, kind, boot ms) of a device that booted then, in order."""
    steps = range(round((end - start) * rate))
    times = [start + phase + step / rate for step in steps]
    return [(at, kind, round((at - booted) * 1000)) for at in times for kind in kinds]


def received(messages, latency=lambda: 0.0):
    """As they arrive."""
    return sorted((at + latency(), kind, boot) for at, kind, boot in messages)


def run(messages, twins=None):
    """The times at which there were two, and the boot times that were taken for ours."""
    twins, found, ours = twins or Twins(), [], []
    for at, kind, boot in messages:
        if twins.observe(kind, boot, at):
            ours.append((at, boot))
        if twins.found(at):
            found.append(at)
    return found, ours


@given(
    apart=st.integers(1, 5000).map(lambda whole: whole + 0.033),
    rates=st.tuples(st.sampled_from([4.0, 10.0, 20.0]), st.sampled_from([4.0, 10.0, 20.0])),
    phase=st.floats(0.0, 0.01),
    kinds=st.sampled_from([KINDS, KINDS[:1], KINDS[1:]]),
    seed=st.integers(0, 1000),
)
@settings(max_examples=25, deadline=None)
def test_two_are_found_within_seconds_and_kept_apart(apart, rates, phase, kinds, seed):
    chance = random.Random(seed)
    first = said(-100.0, 0.0, 6.0, rates[0])
    second = said(-100.0 - apart, 0.0, 6.0, rates[1], phase, kinds)
    found, ours = run(received([*first, *second], lambda: chance.uniform(0.0, 0.02)))
    if apart < 6.0 and max(rates) / min(rates) > 2.0:
        return  # what comes seldom may be messages of the other one that are late
    assert found
    assert found[0] <= 5.0
    offsets = [at - boot / 1000 for at, boot in ours if at > found[0]]
    assert max(offsets) - min(offsets) < 0.5


@given(
    restarts=st.lists(st.floats(1.0, 10.0), max_size=4),
    latency=st.floats(0.0, 0.4),
    loss=st.floats(0.0, 0.5),
    copies=st.sampled_from([0.0, 0.3, 1.0]),
    way=st.floats(0.0, 3.0),
    rate=st.sampled_from([1.0, 4.0, 10.0]),
    seed=st.integers(0, 1000),
)
@example([], 0.335, 0.0, 0.0, 0.0, 10.0, 1)
@settings(max_examples=50, deadline=None)
def test_one_that_restarts_or_whose_messages_are_lost_late_or_doubled_is_one(
    restarts, latency, loss, copies, way, rate, seed
):
    chance = random.Random(seed)
    messages, start, booted = [], 0.0, -50.0
    for pause in [*restarts, 15.0]:
        messages += said(booted, start, start + pause, rate)
        start = booted = start + pause
    arrived = received(messages, lambda: chance.uniform(0.0, latency))
    doubled = [(at + way, *rest) for at, *rest in arrived if chance.random() < copies]
    kept = [one for one in arrived if chance.random() >= (loss if copies < 1.0 else 0.0)]
    found, _ = run(sorted([*kept, *(one for one in doubled if copies in (0.0, 1.0))]))
    assert found == []


def test_a_restart_with_messages_of_before_still_under_way_is_one():
    before, after = said(-100.0, 0.0, 10.0), said(9.0, 10.0, 30.0)
    late = [(at + 1.0, kind, boot) for at, kind, boot in before if at > 9.0]
    early = [one for one in before if one[0] <= 9.0]
    assert run(sorted([*early, *late, *after]))[0] == []


def test_it_is_over_when_one_of_them_is_gone():
    twins = Twins()
    found, _ = run(sorted([*said(-100.0, 0, 10), *said(-30.0, 0, 10, phase=0.05)]), twins)
    assert found
    assert "(their clocks are 70.0 s apart)" in twins.doubt("two", 10.0)
    found, ours = run(said(-30.0, 10.05, 60.0), twins)
    assert found[-1] <= 25.0 + OVER_AFTER
    assert ours[-1][0] == pytest.approx(60.0, abs=0.2)


def test_a_device_without_a_clock_says_nothing_of_it():
    found, ours = run([(n / 10, "ATTITUDE", 0) for n in range(100)])
    assert found == []
    assert len(ours) == 100


@pytest.mark.parametrize("seed", range(3))
def test_a_restart_is_none_of_two_clocks_however_much_comes_out_of_order(seed):
    """Given a way that holds each message back for up to 0.4 s, and a restart at t+10."""
    chance, twins = random.Random(seed), Twins()
    messages = [*said(-50.0, 0.0, 10.0), *said(10.5, 10.5, 20.0)]
    by_turns = []
    for at, kind, boot in received(messages, lambda: chance.uniform(0.0, 0.4)):
        twins.observe(kind, boot, at)
        by_turns += [at] if twins.by_turns(at) else []
    # Then only what was still under way as it started anew could be another's.
    assert all(10.5 <= at <= 14.0 for at in by_turns)


@pytest.mark.parametrize("slower", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("rate", [4.0, 20.0])
def test_a_way_that_is_slow_for_a_while_is_no_second_device(slower, rate):
    """Given two routes to one device: from t+10 to t+16 all comes by the slower one."""
    messages = [
        (at + slower * (10.0 <= at < 16.0), *rest) for at, *rest in said(-50.0, 0, 40, rate)
    ]
    assert run(sorted(messages))[0] == []


@pytest.mark.parametrize("seed", range(4))
def test_messages_that_are_held_back_for_more_than_a_second_are_no_restart(seed):
    chance, twins, clock = random.Random(seed), Twins(), BootClock()
    restarts = []
    for at, kind, boot in received(said(-50.0, 0.0, 40.0), lambda: chance.uniform(0.0, 1.3)):
        twins.observe(kind, boot, at)
        anew = clock.observe(boot) is Age.RESTARTED
        restarts += [at] if anew and not twins.by_turns(at) else []
    assert restarts == []
