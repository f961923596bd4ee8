"""A height over time, drawn with characters."""

import pytest

from chute_ros.tools.chart import chart


def test_a_climb_and_a_fall_are_drawn_as_they_were():
    lines = chart([(0.0, 0.0), (1.0, 5.0), (2.0, 10.0), (3.0, 0.0)], [(2.0, "F")], 8, 3)
    labels = [line.split("|")[0] for line in lines[:3]]
    assert labels == ["   10 m ", "    5 m ", "    0 m "]
    rows = [line.split("|")[1] for line in lines[:3]]
    assert [row.count("*") for row in rows] == [1, 1, 2]
    assert rows[2].startswith("*")
    assert rows[0].index("*") == 5
    assert lines[4].index("F") == lines[0].index("*"), "the mark stands below its moment"


def test_marks_at_the_same_moment_stand_side_by_side():
    below = chart([(0.0, 0.0), (10.0, 1.0)], [(5.0, "K"), (5.0, "D")], 20, 3)[-1]
    assert "KD" in below


@pytest.mark.parametrize("moment", [-5.0, 0.0, 10.0, 15.0])
def test_a_mark_outside_stays_on_the_chart(moment):
    below = chart([(0.0, 0.0), (10.0, 1.0)], [(moment, "F")], 20, 3)[-1]
    assert below.count("F") == 1
    assert len(below) <= 9 + 20


@pytest.mark.parametrize("points", [[(0.0, 0.0)], [(1.0, 0.0), (1.0, 0.0)], [(0.0, 7.0)]])
def test_a_flight_of_a_moment_or_without_height_can_be_drawn(points):
    lines = chart(points, [], 10, 4)
    assert len(lines) == 6
    assert sum(line.count("*") for line in lines) >= 1
