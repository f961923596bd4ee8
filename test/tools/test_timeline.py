"""The timeline is a picture that any program can draw, and says nothing that is not so."""

import math
import xml.etree.ElementTree as ElementTree

import pytest

from chute_ros.tools.timeline import LEFT, RIGHT, WIDTH, close_up, draw
from chute_ros.tools.timeline_axis import label_of, nice_steps, thinned, time_steps, within
from chute_ros.tools.timeline_rows import Band, Curve, Level, Mark, Marks, Segment, Window

WHOLE = Window("everything", 0.0, 10.0)
SPACE = "{http://www.w3.org/2000/svg}"


def drawn(*rows, windows=(WHOLE,)):
    return ElementTree.fromstring(draw(rows, windows, "a flight"))


def texts(root):
    return [one.text for one in root.iter(f"{SPACE}text")]


def test_a_band_is_as_long_as_its_states():
    root = drawn(
        Band("state", [Segment(0.0, 5.0, "READY", "good"), Segment(5.0, 10.0, "", "bad")])
    )
    first, second = root.iter(f"{SPACE}rect")
    wide = WIDTH - LEFT - RIGHT
    assert float(first.get("x")) == LEFT
    assert float(first.get("width")) == pytest.approx(wide / 2, abs=0.1)
    assert float(second.get("x")) == pytest.approx(LEFT + wide / 2, abs=0.1)
    assert {"state", "READY"} <= set(texts(root))


def test_a_state_that_is_too_short_for_its_name_says_it_when_pointed_at():
    root = drawn(Band("state", [Segment(5.0, 5.0, "KILLING", "bad")]))
    assert "KILLING" not in texts(root)
    (rect,) = root.iter(f"{SPACE}rect")
    assert float(rect.get("width")) > 1.0, "a moment can be seen"
    assert "KILLING" in rect.find(f"{SPACE}title").text


def test_axes_have_units():
    root = drawn(Curve("height", "m", [(0.0, 0.0), (4.0, 60.0)]))
    assert {"height", "m", "60", "0", "time from the start, s"} <= set(texts(root))


def test_a_long_recording_has_minutes():
    root = drawn(windows=[Window("all", 0.0, 3600.0)])
    assert {"10:00", "time from the start, min:s"} <= set(texts(root))


def test_what_is_not_known_leaves_a_gap():
    points = [(0.0, 1.0), (1.0, 1.0), (2.0, math.nan), (3.0, 1.0), (4.0, 1.0), (9.5, 1.0)]
    (path,) = drawn(Curve("speed", "m/s", points)).iter(f"{SPACE}path")
    assert path.get("d").count("M") == 3, "before it, after it, and after a long silence"


def test_nothing_known_is_said():
    assert "nothing" in texts(drawn(Curve("height", "m", []), Marks("alarms", [])))


def test_marks_in_one_place_stand_below_one_another_and_none_outside():
    marks = [Mark(0.0, "KILL", "x", "bad"), Mark(0.01, "DEPLOY", "y", "act")]
    rects = list(
        drawn(Marks("decisions", [*marks, Mark(11.0, "late", "z", "bad")])).iter(f"{SPACE}rect")
    )
    assert len(rects) == 2
    assert rects[0].get("y") != rects[1].get("y")
    assert min(float(one.get("x")) for one in rects) >= LEFT


def test_a_counter_that_is_full_touches_its_limit():
    (path,) = drawn(Level("rule", [(0.0, 0.0), (5.0, 1.0), (10.0, 1.0)])).iter(f"{SPACE}path")
    tops = {float(step.split("H")[0].rstrip("Z")) for step in path.get("d").split("V")[1:]}
    limit = min(tops)
    lines = [float(one.get("y1")) for one in drawn(Level("rule", [])).iter(f"{SPACE}line")]
    assert limit in lines


def test_what_came_over_a_wire_is_only_text():
    nasty = '<script>alert("1")</script>&\x00\x1b'
    root = drawn(
        Band(nasty, [Segment(0.0, 10.0, nasty, "good")]),
        Marks(nasty, [Mark(1.0, "1", nasty, "bad")]),
        windows=[Window(nasty, 0.0, 10.0)],
    )
    assert list(root.iter(f"{SPACE}script")) == []
    assert all(one.text is None or "\x1b" not in one.text for one in root.iter())


def test_a_close_up_is_made_where_it_shows_more():
    (window,) = close_up([50.0, 50.4], 100.0)
    assert window.start < 50.0
    assert window.end > 50.4
    assert close_up([1.0, 99.0], 100.0) == []
    assert close_up([], 100.0) == []


@pytest.mark.parametrize(
    ("low", "high", "steps"),
    [
        (0.0, 60.0, [0.0, 20.0, 40.0, 60.0]),
        (-22.0, 4.0, [-30.0, -20.0, -10.0, 0.0, 10.0]),
        (0.0, 0.0, [0.0, 0.5]),
        (0.0, 0.003, [0.0, 0.001, 0.002, 0.003]),
    ],
)
def test_steps_of_an_axis_are_round(low, high, steps):
    assert nice_steps(low, high, 4) == pytest.approx(steps)


def test_numbers_of_an_axis_have_the_digits_that_they_need():
    assert [label_of(one, [0.0, 0.05]) for one in (0.0, 0.05, -0.05)] == ["0", "0.05", "-0.05"]
    assert label_of(20.0, [0.0, 20.0]) == "20"


@pytest.mark.parametrize("span", [0.2, 3.0, 119.0, 121.0, 4000.0, 90000.0, 10**7])
def test_an_axis_of_time_is_never_crowded(span):
    steps = time_steps(5.0, 5.0 + span)
    assert all(5.0 <= one <= 5.0 + span for one in steps)
    assert 1 <= len(steps) <= 125


def test_of_many_points_the_extremes_are_kept():
    points = [(number / 1000, 0.0) for number in range(10_000)]
    points[5003] = (5.003, -7.0)
    points[5004] = (5.004, 9.0)
    kept = thinned(points, 0.0, 10.0)
    assert len(kept) < 4000
    assert {(5.003, -7.0), (5.004, 9.0)} <= set(kept)
    assert kept == sorted(kept)


def test_what_crosses_the_edge_of_a_window_is_drawn_up_to_it():
    points = [(0.0, 0.0), (10.0, 10.0)]
    assert within(points, 4.0, 6.0) == [(4.0, 4.0), (6.0, 6.0)]
    assert within(points, 4.0, 6.0, steps=True) == [(4.0, 0.0), (6.0, 0.0)]
