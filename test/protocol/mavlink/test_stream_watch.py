"""Which messages are asked for: given what comes and how often, at t+..., then."""

from __future__ import annotations

import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.protocol.mavlink.stream_watch import (
    ASK_AGAIN,
    ASKED_FOR,
    STORE,
    STORE_FILLS,
    StreamWatch,
)

ALL = tuple(ASKED_FOR.values())
#: What the node asks for: 10 Hz.
INTERVAL = 0.1


def watched(rate, seconds, loss=0.0, seed=1):
    """All parts came at this rate since t = 0, but for those that were lost; and the time."""
    watch, chance = StreamWatch(), random.Random(seed)
    count = round(rate * seconds)
    for number in range(1, count + 1):
        for part in ASKED_FOR:
            if chance.random() >= loss:
                watch.heard(part, number / rate)
    return watch, count / rate


def test_an_autopilot_that_says_nothing_is_asked_often_for_a_while_and_then_now_and_then():
    watch = StreamWatch()
    asked = [t for t in (100.0 + n * 0.1 for n in range(400)) if watch.due(INTERVAL, t)]
    gaps = [after - before for before, after in itertools.pairwise(asked)]
    assert gaps[: STORE - 1] == pytest.approx([ASK_AGAIN] * (STORE - 1), abs=0.11)
    assert gaps[STORE + 1 :] == pytest.approx([STORE_FILLS] * len(gaps[STORE + 1 :]), abs=0.11)
    assert len(gaps) > STORE + 3


def test_what_comes_at_its_rate_is_not_asked_for():
    watch, now = watched(10.0, 3.0)
    assert watch.due(INTERVAL, now) == ()


@pytest.mark.parametrize("rate", [0.5, 1.0, 2.0, 4.0])
def test_what_an_autopilot_sends_by_itself_more_slowly_is_asked_for(rate):
    watch, now = watched(rate, 20.0)
    assert watch.due(INTERVAL, now) == ALL


@pytest.mark.parametrize("rate", [5.0, 8.0, 10.0, 50.0])
def test_half_of_the_rate_is_enough(rate):
    watch, now = watched(rate, 20.0)
    assert watch.due(INTERVAL, now) == ()


def test_a_message_that_stops_is_asked_for_after_five_of_its_intervals():
    watch, now = watched(10.0, 20.0)
    for number in range(1, 10):
        for part in ASKED_FOR:
            if part != "acceleration":
                watch.heard(part, now + number / 10)
        due = watch.due(INTERVAL, now + number / 10)
        assert due == ((ASKED_FOR["acceleration"],) if number == 5 else ())


def test_a_network_that_loses_a_third_has_nothing_asked_for_again_and_again():
    watch, now = watched(10.0, 10.0, loss=0.3)
    asked = 0
    for number in range(1, 601):
        for part in ASKED_FOR:
            if random.Random(f"{part} {number}").random() >= 0.3:
                watch.heard(part, now + number / 10)
        asked += len(watch.due(INTERVAL, now + number / 10))
    assert asked <= 60 / STORE_FILLS * len(ALL)


def test_a_message_that_stops_does_not_wait_for_one_that_never_came():
    watch = StreamWatch()
    asked = {}
    for tenth in range(300):
        now = tenth / 10
        for part in ASKED_FOR:
            if part != "battery_voltage" and (part != "tilt" or now < 20.0):
                watch.heard(part, now)
        asked.update({message: now for message in watch.due(INTERVAL, now) if now < 20.6})
    assert asked[ASKED_FOR["tilt"]] == pytest.approx(20.4, abs=0.11)


@pytest.mark.parametrize(
    ("interval", "seconds"), [(0.02, 0.1), (0.1, 0.5), (0.5, 2.5), (1.0, 2.5), (2.0, 3.0)]
)
def test_nobody_waits_long_for_what_stopped_however_long_its_interval(interval, seconds):
    watch, now = watched(1.0 / interval, 20.0)
    assert watch.due(interval, now + seconds - 0.01) == ()
    assert watch.due(interval, now + seconds + 0.01) == ALL


def test_a_request_that_was_lost_is_made_again_soon_also_where_nobody_saw_a_restart():
    watch, now = watched(10.0, 60.0)
    asked = [t for t in (now + n * 0.1 for n in range(25)) if watch.due(INTERVAL, t)]
    assert asked == pytest.approx([now + 0.5, now + 1.0, now + 1.5, now + 2.0], abs=0.11)


@pytest.mark.parametrize("every", [0.5, 1.0, 2.6, 4.9])
def test_one_that_comes_and_goes_or_restarts_without_end_is_not_asked_without_end(every):
    watch, asked = StreamWatch(), 0
    for tenth in range(3000):
        if tenth % round(every * 10) == 0:
            watch.begin()
        asked += len(watch.due(INTERVAL, tenth / 10))
    assert asked <= (STORE + 300.0 / STORE_FILLS) * len(ALL)


def test_who_wants_another_rate_has_all_asked_for_at_once():
    watch, now = watched(10.0, 60.0)
    assert watch.due(INTERVAL, now) == ()
    assert watch.due(0.02, now) == ALL
    assert StreamWatch().due(0.5, now) == ALL


@given(
    st.lists(st.tuples(st.floats(0.0, 3.0), st.sampled_from([*ASKED_FOR, "begin", "due"]))),
    st.sampled_from([0.02, 0.1, 1.0]),
)
def test_what_has_not_come_is_always_asked_for_in_time(steps, interval):
    """Whatever comes in whichever order: nothing is left out for longer than it may."""
    watch, now = StreamWatch(), 0.0
    for passed, what in steps:
        now += passed
        if what == "begin":
            watch.begin()
        elif what == "due":
            watch.due(interval, now)
        else:
            watch.heard(what, now)
    # Nothing comes any more.
    end = now + STORE_FILLS + 5.0 * interval + 0.01
    asked = set()
    while now < end:
        asked |= set(watch.due(interval, now))
        now += 0.05
    asked |= set(watch.due(interval, end))
    assert asked == set(ALL)
