"""Height over time: bounded, with every peak, and honest when a clock is set. Pure."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from chute_ros.tools.panel.trace import MOST_DRAWN, SPAN, STEP, MotionPoint, Trace


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
