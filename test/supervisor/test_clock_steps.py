"""A wall clock that is set makes no decision older; a decision that comes late stays late."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.supervisor.clock_steps import ClockSteps

MARGIN = 0.25
BEAT = 0.1  # s, the supervisor's heartbeats


def heard_so_far(difference: float = 0.002, beats: int = 5) -> tuple[ClockSteps, float]:
    """Clocks that differ by so much, heartbeats as they come; and when the last came."""
    clocks, now = ClockSteps(MARGIN), 1000.0
    for _ in range(beats):
        now += BEAT
        assert clocks.heard(difference, now) == 0.0
    return clocks, now


@pytest.mark.parametrize("step", [3600.0, -3600.0, 0.5, -0.5])
def test_a_clock_that_is_set_shows_with_the_next_heartbeat(step):
    clocks, now = heard_so_far()
    assert clocks.heard(0.002 + step, now + BEAT) == pytest.approx(step)
    assert clocks.offset == pytest.approx(step)
    assert clocks.age(0.003 + step) == pytest.approx(0.003), "a decision sent now is young"
    assert clocks.age(0.703 + step) == pytest.approx(0.703), "one that comes late is late"


@pytest.mark.parametrize("ahead", [0.3, 49.4, 1e6])
def test_a_first_heartbeat_from_the_future_tells_of_a_clock_that_is_ahead(ahead):
    """Of two hosts whose clocks differ one was started anew: nothing arrives before it is sent."""
    clocks = ClockSteps(MARGIN)
    assert clocks.heard(0.002 - ahead, 5.0) == pytest.approx(-ahead, abs=0.01)
    assert clocks.age(0.003 - ahead) == pytest.approx(0.0, abs=0.01), "a decision sent now"
    assert clocks.age(0.703 - ahead) == pytest.approx(0.7, abs=0.01), "one that comes late is late"


def test_one_that_was_late_itself_is_put_right_by_the_next():
    clocks = ClockSteps(MARGIN)
    clocks.heard(-46.0, 5.0)
    assert clocks.heard(-49.0, 5.1) == pytest.approx(-3.0), "it had taken 3 s"
    assert clocks.age(-48.3) == pytest.approx(0.7)


@pytest.mark.parametrize("step", [3.0, 5.999, -5.0, 3600.0])
def test_of_what_waited_while_this_host_hung_the_first_was_not_sent_just_now(step):
    """The clock was set while we hung for 3 s; the last ten heartbeats come at once."""
    clocks, now = heard_so_far()
    now += 3.0
    for late in range(9, -1, -1):
        clocks.heard(0.002 + step + late * BEAT, now)
    assert clocks.age(0.003 + step) == pytest.approx(0.0, abs=MARGIN), "a decision sent now"
    assert clocks.heard(0.002 + step, now + BEAT) == 0.0
    assert clocks.age(0.703 + step) == pytest.approx(0.7, abs=MARGIN), "one that comes late"


@given(
    hangs=st.lists(
        st.tuples(
            st.floats(0.0, 20.0), st.floats(-100.0, 100.0), st.integers(1, 10), st.floats(0.0, 1.0)
        ),
        max_size=6,
    )
)
def test_nothing_seems_to_come_from_the_future(hangs):
    """Hangs, steps of the clock meanwhile, and heartbeats that waited, on ways of any length."""
    clocks, now = heard_so_far()
    clock = 0.0
    for hang, step, waited, way in hangs:
        now += hang
        clock += step
        for late in range(waited - 1, -1, -1):
            clocks.heard(clock + way + late * BEAT, now)
        assert clocks.age(clock + way) >= -MARGIN - 1e-6


@pytest.mark.parametrize("first", [49.4, 3600.0, 7.0, -MARGIN])
def test_clocks_that_differ_from_the_start_are_no_step(first):
    """Decisions are refused, and pre-flight says why: a way may take so long."""
    clocks = ClockSteps(MARGIN)
    assert clocks.age(0.4) == 0.4, "before the first heartbeat the wall clock counts"
    assert clocks.heard(first, 5.0) == 0.0
    assert clocks.offset == 0.0
    assert clocks.age(first) == first


def test_an_answer_within_the_margin_or_overtaken_by_heartbeats_shows_nothing():
    fresh, (clocks, now) = ClockSteps(MARGIN), heard_so_far()
    assert fresh.answered(0.1 + MARGIN, 0.1, 5.0) == 0.0
    assert clocks.answered(1.5, 1.6, now + 0.01) == 0.0
    assert clocks.heard(0.002, now + BEAT) == 0.0
    assert fresh.offset == clocks.offset == 0.0


@pytest.mark.parametrize(
    ("told", "age"),
    [
        # It is set back again.
        ([(3600.002, BEAT, 3600.0), (0.002, 2 * BEAT, -3600.0)], 0.002),
        # It is seen after a gap as well.
        ([(3600.0, 5.0, 3599.998)], 0.002),
        # Nonsense.
        ([(math.nan, BEAT, 0.0), (0.002, 2 * BEAT, 0.0)], 0.002),
        # A node that hung for 9 s reads what came meanwhile within a millisecond: it is old.
        ([(9.0 - n / 10, 9.0 + n * 1e-4, 0.0) for n in range(90)], 9.0),
    ],
)
def test_what_heartbeats_show(told, age):
    """Each: its difference, how long after the last of five good ones, the step that it shows."""
    clocks, now = heard_so_far()
    for difference, later, step in told:
        assert clocks.heard(difference, now + later) == pytest.approx(step)
    assert clocks.age(age + clocks.offset) == pytest.approx(age)


@pytest.mark.parametrize("behind", [0.6, 49.4, 18809.379])
def test_an_answer_tells_of_a_clock_that_is_behind(behind):
    """Its way took 0.02 s; it answers what left 0.05 s ago."""
    clocks = ClockSteps(MARGIN)
    clocks.heard(behind + 0.002, 5.0)
    assert clocks.answered(behind + 0.02, 0.05, 5.05) == pytest.approx(behind - 0.03)
    assert clocks.age(behind + 0.002) == pytest.approx(0.032), "a decision sent now is young"
    assert clocks.age(behind + 0.702) == pytest.approx(0.732), "one that comes late is late"
    assert clocks.heard(behind + 0.002, 5.1) == 0.0


def test_an_answer_that_was_long_on_its_way_makes_nothing_younger():
    clocks = ClockSteps(MARGIN)
    clocks.heard(3.0, 5.0)
    assert clocks.answered(3.0, 3.01, 5.1) == 0.0, "a way that takes 3 s each time"
    assert clocks.age(3.0) == 3.0
    clocks = ClockSteps(MARGIN)
    clocks.heard(3600.0, 5.0)
    assert clocks.answered(3600.0, 3.0, 5.1) == pytest.approx(3597.0)
    assert clocks.age(3600.0) == pytest.approx(3.0), "it may be that old"
    assert clocks.answered(3600.0, 0.1, 5.2) == pytest.approx(2.9), "a quicker one tells more"


@given(
    st.floats(-1e5, 1e5),
    st.lists(st.tuples(st.booleans(), st.floats(0.0, 2.0), st.floats(0.0, 1.0)), min_size=1),
)
def test_no_answer_makes_anything_younger_than_it_is(behind, told):
    """Heartbeats on a way that takes no time, answers on one that takes up to 2 s; the clock of
    who sends them is behind from the start, or ahead."""
    clocks, now = ClockSteps(MARGIN), 0.0
    for is_answer, took, before in told:
        now += BEAT
        if is_answer:
            clocks.answered(behind + took, took + before, now)
        else:
            clocks.heard(behind, now)
        assert clocks.age(behind + 0.7) >= 0.7 - 1e-6 or behind < 0.0


@pytest.mark.parametrize("step", [26.4, -26.4])
@pytest.mark.parametrize("answer_first", [False, True])
def test_a_step_counts_once_whichever_message_shows_it(step, answer_first):
    clocks, now = heard_so_far()
    shows = [
        lambda at: clocks.answered(0.002 + step, 0.01, at),
        lambda at: clocks.heard(0.002 + step, at),
    ]
    for number, show in enumerate(shows if answer_first else reversed(shows)):
        show(now + 0.05 + number * 0.05)
    assert clocks.age(0.002 + step) == pytest.approx(0.002, abs=0.01)


@pytest.mark.parametrize(
    ("change", "passed", "seen"),
    [
        # Slower by what has passed and the margin is a way that got slower.
        (0.35, 0.1, False),
        (0.36, 0.1, True),
        (5.25, 5.0, False),
        (5.26, 5.0, True),
        # Faster by what it took (0.125 s) and the margin.
        (-0.375, 0.1, False),
        (-0.38, 0.1, True),
    ],
)
def test_the_bounds_of_a_step(change, passed, seen):
    clocks = ClockSteps(MARGIN)
    clocks.heard(0.125, 16.0)
    assert bool(clocks.heard(0.125 + change, 16.0 + passed)) is seen


DELAYS = st.lists(st.floats(0.0, 20.0), min_size=2, max_size=40)


@given(DELAYS, st.floats(-0.2, 0.2))
def test_delays_alone_are_never_a_step(delays, difference):
    """However slow or jerky the way is, as long as it keeps the order."""
    clocks, arrived = ClockSteps(MARGIN), 0.0
    for number, delay in enumerate(delays):
        arrived = max(arrived, BEAT * number + delay)
        clocks.heard(arrived - BEAT * number + difference, arrived)
    assert clocks.offset == 0.0


@given(DELAYS, st.floats(30.0, 1e6), st.booleans(), st.integers(1, 39))
def test_after_a_step_no_age_is_off_by_more_than_the_way_takes(delays, step, back, at):
    clocks, arrived, set_by = ClockSteps(MARGIN), 0.0, 0.0
    for number, delay in enumerate(delays):
        if number == min(at, len(delays) - 1):
            set_by = -step if back else step
        arrived = max(arrived, BEAT * number + min(delay, 5.0))
        took = arrived - BEAT * number
        clocks.heard(took + set_by, arrived)
    assert abs(clocks.age(took + set_by) - took) <= 5.0 + MARGIN
