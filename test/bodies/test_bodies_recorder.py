"""What a recorded flight comes to: lost or not, since when, when it shows, how it ends."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from bodies.recorder import Recorder, Row, UnflyableError
from chute_ros.sim.tape import STEP, Label

HOVER = Row(30.0, 0.0, 0.0, 0.0, 0.0, 9.81, 0.0, 0.0, 0.0, 0.0, 30.0, 0.0, 0.5)


def label(rows: list[Row], failed_at: float = math.nan) -> Label:
    recorder = Recorder()
    for row in rows:
        recorder.add(row)
    return recorder.tape("one", "physics", "multirotor", "something", failed_at).label


def sinking(speed: float, **more: float) -> list[Row]:
    """A second of hover, then down to the ground."""
    falls, height = [], 30.0
    while height > 0.0:
        height -= speed * STEP
        falls.append(replace(HOVER, height=height, vertical_speed=-speed, **more))
    return [HOVER] * 50 + falls


def test_what_falls_after_its_failure_is_lost_from_then_on() -> None:
    # Given a failure at 1 s, and a sink of 9 m/s from 1 s on
    told = label(sinking(9.0), failed_at=0.98)
    assert (told.lost_at, told.shows_at) == (0.98, 1.0)
    assert told.ends_hard
    assert told.level
    assert told.parameters["ends"] == "touches down with 9.0 m/s, 0 degrees over"


def test_what_tumbles_is_not_level() -> None:
    assert not label(sinking(9.0, roll=2.0, force=1.0), failed_at=0.98).level


def test_what_sinks_softly_was_never_lost() -> None:
    told = label(sinking(4.0), failed_at=0.98)
    assert math.isnan(told.lost_at)
    assert not told.ends_hard


def test_what_recovers_was_lost_and_ends_softly() -> None:
    # Given a sink of 9 m/s for a second, then a hover again
    falls = sinking(9.0)[:100]
    told = label([*falls, *[replace(HOVER, height=20.0)] * 50], failed_at=0.98)
    assert (told.lost_at, told.ends_hard) == (0.98, False)
    assert told.parameters["ends"] == "in the air, at 20 m"


def test_a_fast_descent_that_was_commanded_shows_nothing() -> None:
    falls = sinking(9.0, commanded_vertical_speed=-8.0)[:100]
    told = label([*falls, *[replace(HOVER, height=20.0)] * 50], failed_at=0.98)
    assert math.isnan(told.lost_at)


def test_what_lies_over_shows_once_it_sinks_as_well() -> None:
    # Given a tilt of 90 degrees from 1 s on, that begins to sink 1 s later
    over = [replace(HOVER, roll=1.6)] * 50
    told = label([HOVER] * 50 + over + sinking(5.0, roll=1.6)[50:], failed_at=1.0)
    assert (told.lost_at, told.shows_at, told.ends_hard) == (1.0, 2.0, True)


def test_what_lies_over_and_never_sinks_was_lost_and_ends_softly() -> None:
    told = label([HOVER] * 50 + [replace(HOVER, roll=1.6)] * 50, failed_at=1.0)
    assert (told.lost_at, told.ends_hard) == (1.0, False)


def test_where_nothing_fails_it_is_lost_when_it_obeys_no_more() -> None:
    told = label(sinking(9.0, roll=1.5))
    assert (told.lost_at, told.ends_hard) == (1.0, True)


def test_where_nothing_fails_and_nothing_happens_it_flies() -> None:
    told = label([HOVER] * 100)
    assert math.isnan(told.lost_at)
    assert math.isnan(told.failed_at)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"roll": math.nan}, "not a number"),
        ({"vertical_speed": -200.0}, "vertical_speed -200"),
        ({"height": 1e6}, "height 1000000"),
    ],
)
def test_what_no_vehicle_does_is_left_out(wrong: dict[str, float], words: str) -> None:
    with pytest.raises(UnflyableError, match=words):
        Recorder().add(replace(HOVER, **wrong))
