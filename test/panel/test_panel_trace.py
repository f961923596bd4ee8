"""Height over time: bounded, with every peak, and honest when a clock is set. Pure."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from chute_ros.tools.panel.trace import (
    LANES,
    MOST_DRAWN,
    SPAN,
    STEP,
    DecisionMark,
    MotionPoint,
    Trace,
    placed,
)


def traced(heights, start=1000.0, step=STEP):
    trace = Trace()
    for number, height in enumerate(heights):
        trace.add(MotionPoint(start + number * step, height, 0.0))
    return trace


def test_points_that_come_too_soon_are_left_out():
    trace = traced([1.0, 2.0, 3.0], step=STEP / 2)
    assert [one.height for one in trace.points] == [1.0, 3.0]


def test_it_goes_back_so_far_and_no_further():
    trace = traced([float(n) for n in range(int(SPAN / STEP) + 100)])
    assert trace.points[-1].at - trace.points[0].at <= SPAN
    assert len(trace.drawn()) <= MOST_DRAWN


@given(st.lists(st.floats(0.0, 500.0) | st.just(math.nan), min_size=1, max_size=1600))
def test_what_is_drawn_has_the_highest_and_the_lowest(heights):
    trace = traced(heights)
    known = [one.height for one in trace.points if not math.isnan(one.height)]
    drawn = trace.drawn()
    assert len(drawn) <= MOST_DRAWN
    assert [one.at for one in drawn] == sorted(one.at for one in drawn)
    if known:
        seen = [one.height for one in drawn if not math.isnan(one.height)]
        assert (min(seen), max(seen)) == (min(known), max(known))


def test_a_clock_that_is_set_back_begins_a_new_curve():
    trace = traced([1.0, 2.0])
    trace.mark(1000.1, "KILL")
    trace.add(MotionPoint(500.0, 3.0, 0.0))
    assert [one.height for one in trace.points] == [3.0]
    assert not trace.marks


def test_what_nobody_received_is_a_gap_and_no_straight_line():
    trace = traced([10.0, 11.0])
    trace.add(MotionPoint(1000.0 + 30.0, 5.0, 0.0))
    heights = [one.height for one in trace.points]
    assert heights[:2] == [10.0, 11.0]
    assert math.isnan(heights[2])
    assert heights[3] == 5.0


def test_a_gap_is_still_there_when_most_points_are_left_out():
    heights = [float(n % 50) for n in range(1400)]
    heights[700:720] = [math.nan] * 20
    drawn = traced(heights).drawn()
    assert len(drawn) <= MOST_DRAWN
    gaps = [one.at for one in drawn if math.isnan(one.height)]
    assert any(1000.0 + 700 * STEP <= at < 1000.0 + 720 * STEP for at in gaps)


# The decisions on the curves


def marks(*those):
    return [DecisionMark(at, text) for at, text in those]


def test_the_names_of_decisions_of_one_moment_stand_below_each_other():
    those = marks((10.0, "KILL"), (10.05, "DEPLOY"), (10.1, "BLOCK"), (60.0, "UNBLOCK"))
    found = placed(those, 0.0, 100.0)
    assert [(one.mark.text, one.lane) for one in found] == [
        ("KILL", 0),
        ("DEPLOY", 1),
        ("BLOCK", 2),
        ("UNBLOCK", 0),
    ]
    assert not any(one.leftwards for one in found)


def test_a_name_does_not_run_past_the_end():
    (one,) = placed(marks((99.0, "UNBLOCK")), 0.0, 100.0)
    assert one.leftwards


def test_more_names_than_there_is_room_for_are_left_out_and_their_lines_stay():
    found = placed(marks(*((50.0 + n / 10.0, "KILL") for n in range(LANES + 2))), 0.0, 100.0)
    assert [one.lane for one in found] == [*range(LANES), -1, -1]


def test_decisions_of_before_are_not_on_the_curves():
    assert placed(marks((5.0, "KILL")), 10.0, 20.0) == []
