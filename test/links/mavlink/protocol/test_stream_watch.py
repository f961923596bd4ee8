"""Which messages are asked for: given what comes and how often, at t+..., then."""

import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.links.mavlink.protocol.stream_watch import (
    ASK_AGAIN,
    ASKED_FOR,
    NEVER_AFTER,
    STORE,
    STORE_FILLS,
    StreamWatch,
)

ALL = tuple(ASKED_FOR.values())
#: The battery is asked for once a second, whatever the others are.
BATTERY = ASKED_FOR["battery_voltage"]
FAST = tuple(message for message in ALL if message != BATTERY)
#: What the node asks for, 10 Hz, and what the rules need of it.
INTERVAL, NEEDED = 0.1, 5.0


def due(watch, interval, now):
    """The messages that are asked for."""
    return tuple(one.message_id for one in watch.due(interval, now))


def watched(rate, seconds, loss=0.0, seed=1):
    """All parts came at this rate since t = 0, but for those that were lost; and the time."""
    watch, chance = StreamWatch(NEEDED), random.Random(seed)
    count = round(rate * seconds)
    for number in range(1, count + 1):
        for part in ASKED_FOR:
            if chance.random() >= loss:
                watch.heard(part, number / rate)
    return watch, count / rate


def test_an_autopilot_that_says_nothing_is_asked_often_for_a_while_and_then_now_and_then():
    watch = StreamWatch(NEEDED)
    asked = [t for t in (100.0 + n * 0.1 for n in range(400)) if due(watch, INTERVAL, t)]
    gaps = [after - before for before, after in itertools.pairwise(asked)]
    assert gaps[: STORE - 1] == pytest.approx([ASK_AGAIN] * (STORE - 1), abs=0.11)
    assert gaps[STORE + 1 :] == pytest.approx([STORE_FILLS] * len(gaps[STORE + 1 :]), abs=0.11)
    assert len(gaps) > STORE + 3


def test_what_comes_at_its_rate_is_not_asked_for():
    watch, now = watched(10.0, 3.0)
    assert due(watch, INTERVAL, now) == ()


@pytest.mark.parametrize("rate", [0.4, 1.0, 2.0, 4.0])
def test_what_an_autopilot_sends_by_itself_more_slowly_is_asked_for(rate):
    watch, now = watched(rate, 20.0)
    assert due(watch, INTERVAL, now) == (FAST if rate > 0.4 else ALL)


@pytest.mark.parametrize("rate", [5.0, 8.0, 10.0, 50.0])
def test_half_of_the_rate_is_enough(rate):
    watch, now = watched(rate, 20.0)
    assert due(watch, INTERVAL, now) == ()


def test_a_message_that_stops_is_asked_for_after_five_of_its_intervals():
    watch, now = watched(10.0, 20.0)
    for number in range(1, 10):
        for part in ASKED_FOR:
            if part != "acceleration":
                watch.heard(part, now + number / 10)
        asked = due(watch, INTERVAL, now + number / 10)
        assert asked == ((ASKED_FOR["acceleration"],) if number == 5 else ())


def test_a_network_that_loses_a_third_has_nothing_asked_for_again_and_again():
    watch, now = watched(10.0, 10.0, loss=0.3)
    asked = 0
    for number in range(1, 601):
        for part in ASKED_FOR:
            if random.Random(f"{part} {number}").random() >= 0.3:
                watch.heard(part, now + number / 10)
        asked += len(due(watch, INTERVAL, now + number / 10))
    assert asked <= 60 / STORE_FILLS * len(ALL)


def test_a_message_that_stops_does_not_wait_for_one_that_never_came():
    watch = StreamWatch(NEEDED)
    asked = {}
    for tenth in range(300):
        now = tenth / 10
        for part in ASKED_FOR:
            if part != "battery_voltage" and (part != "tilt" or now < 20.0):
                watch.heard(part, now)
        asked.update({message: now for message in due(watch, INTERVAL, now) if now < 20.6})
    assert asked[ASKED_FOR["tilt"]] == pytest.approx(20.4, abs=0.11)


@pytest.mark.parametrize(
    ("interval", "seconds"), [(0.02, 0.1), (0.1, 0.5), (0.5, 2.5), (1.0, 2.5), (2.0, 3.0)]
)
def test_nobody_waits_long_for_what_stopped_however_long_its_interval(interval, seconds):
    watch, now = watched(1.0 / interval, 20.0)
    assert due(watch, interval, now + seconds - 0.01) == ()
    assert due(watch, interval, now + seconds + 0.01) == (ALL if seconds >= 2.5 else FAST)


def test_a_request_that_was_lost_is_made_again_soon_also_where_nobody_saw_a_restart():
    watch, now = watched(10.0, 60.0)
    asked = [t for t in (now + n * 0.1 for n in range(25)) if due(watch, INTERVAL, t)]
    assert asked == pytest.approx([now + 0.5, now + 1.0, now + 1.5, now + 2.0], abs=0.11)


@pytest.mark.parametrize("every", [0.5, 1.0, 2.6, 4.9])
def test_one_that_comes_and_goes_or_restarts_without_end_is_not_asked_without_end(every):
    watch, asked = StreamWatch(NEEDED), 0
    for tenth in range(3000):
        if tenth % round(every * 10) == 0:
            watch.begin()
        asked += len(due(watch, INTERVAL, tenth / 10))
    assert asked <= (STORE + 300.0 / STORE_FILLS) * len(ALL)


def test_who_wants_another_rate_has_all_asked_for_at_once():
    watch, now = watched(10.0, 60.0)
    assert due(watch, INTERVAL, now) == ()
    watch.fill_stores()
    watch.begin()
    assert due(watch, 0.02, now) == ALL
    assert [one.interval for one in watch.due(0.02, now + 0.5)] == [0.02] * 4 + [1.0]


@given(
    st.lists(st.tuples(st.floats(0.0, 3.0), st.sampled_from([*ASKED_FOR, "begin", "due"]))),
    st.sampled_from([0.02, 0.1, 1.0]),
)
def test_what_has_not_come_is_always_asked_for_in_time(steps, interval):
    """Whatever comes in whichever order: nothing is left out for longer than it may."""
    watch, now = StreamWatch(NEEDED), 0.0
    for passed, what in steps:
        now += passed
        if what == "begin":
            watch.begin()
        elif what == "due":
            due(watch, interval, now)
        else:
            watch.heard(what, now)
    # Nothing comes any more.
    end = now + STORE_FILLS + 5.0 * interval + 0.01
    asked = set()
    while now < end:
        asked |= set(due(watch, interval, now))
        now += 0.05
    asked |= set(due(watch, interval, end))
    assert asked == set(ALL)


# -- too slow for the rules -----------------------------------------------------------------------


@pytest.mark.parametrize("rate", [5.5, 10.0])
def test_a_rate_that_suffices_is_not_asked_for_and_nothing_is_said_of_it(rate):
    """5.5 Hz is what 2880 B/s leave of 10 Hz."""
    watch, now = watched(rate, 20.0)
    assert watch.faults(now) == []
    assert due(watch, 0.02, now) == (ASKED_FOR["landed_state"],)


def test_a_line_that_is_too_slow_is_said_with_each_stream_and_what_to_do():
    """2.1 Hz is what 1200 B/s leave of 10 Hz."""
    watch, now = watched(2.1, 20.0)
    assert watch.line_is_slow(now)
    assert [text.partition(":")[0] for text in watch.faults(now)] == [
        "GLOBAL_POSITION_INT comes at 2.1 Hz (need 5 Hz)",
        "ATTITUDE comes at 2.1 Hz (need 5 Hz)",
        "SCALED_IMU comes at 2.1 Hz (need 5 Hz)",
    ]
    assert "raise its baud rate" in watch.faults(now)[0]


def test_one_stream_that_somebody_slows_down_is_not_a_slow_line():
    watch, now = watched(10.0, 20.0)
    for step in range(1, 400):
        for part in ASKED_FOR:
            if part != "tilt" or step % 10 == 0:
                watch.heard(part, now + step / 10)
    (text,) = watch.faults(now + 40.0)
    assert text.startswith("ATTITUDE comes at 1.0 Hz (need 5 Hz): another program sets its rate")


def test_it_is_said_after_two_seconds_and_not_any_more_when_it_is_over():
    watch, now = watched(10.0, 20.0)
    said = []
    for step in range(1, 200):
        at = now + step / 10
        if step % 5 == 0 or step > 100:
            for part in ASKED_FOR:
                watch.heard(part, at)
        if watch.faults(at):
            said.append(step / 10)
    assert 2.0 <= said[0] <= 4.5
    assert 10.0 <= said[-1] <= 11.5


def test_what_never_comes_is_said_once_it_had_its_time():
    """4 Hz forbid a take-off: so do 0 Hz. Each message is named alone."""
    watch = StreamWatch(NEEDED)
    assert watch.faults(100.0) == []
    for step in range(100):
        watch.heard("tilt", 100.0 + step / 10)
    assert watch.faults(100.0 + NEVER_AFTER - 0.1) == []
    told = watch.faults(100.0 + NEVER_AFTER)
    assert [text.partition(" has never come: ")[0] for text in told] == [
        "GLOBAL_POSITION_INT",
        "SCALED_IMU",
    ]
    watch.begin()
    assert watch.faults(109.0) == [], "after a restart it has its time again"


def test_nothing_is_said_where_nothing_is_needed():
    watch = StreamWatch(0.0)
    for second in range(20):
        watch.heard("tilt", float(second))
    assert watch.faults(20.0) == []


def fought_over(size, seconds=300):
    """A ground station slows ATTITUDE down to 1 Hz each second; each request of ours brings 10 Hz
    back. size: bytes that the line carries each tenth of a second. Requests, and messages."""
    watch, interval, last, came, asked = StreamWatch(NEEDED), 0.1, 0.0, 0, 0
    for tenth in range(seconds * 10):
        now = tenth / 10
        watch.received(size)
        if tenth % 10 == 0:
            interval = 1.0
        for part in ASKED_FOR:
            if part != "tilt":
                watch.heard(part, now)
        if now - last >= interval - 1e-6:
            watch.heard("tilt", now)
            last, came = now, came + 1
        if ASKED_FOR["tilt"] in due(watch, INTERVAL, now):
            interval, asked = 0.1, asked + 1
    return asked, came


def test_a_ground_station_that_fights_is_answered_for_as_long_as_the_rules_need_it():
    asked, came = fought_over(size=1000)
    assert came >= 300 * NEEDED * 0.85
    assert asked <= 300 / ASK_AGAIN


def test_answers_to_a_ground_station_take_a_fiftieth_of_the_line_at_most():
    asked, _ = fought_over(size=120)
    assert asked * 45 <= 0.02 * 1200 * 300 + (STORE + 10 + 300 / STORE_FILLS) * 45
