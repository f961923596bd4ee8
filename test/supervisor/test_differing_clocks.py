"""A device node's wall clock that differs is told; a heartbeat that only comes late is not."""

from dataclasses import replace

import pytest
from story import LINK, Story

TEXT = f"{LINK}: its wall clock differs; it may refuse decisions as too old"
AGREES = f"{LINK}: its wall clock agrees again"


def beats(story: Story, until: float, difference: float, interval: float = 0.1) -> Story:
    """Heartbeats that show this difference: on their way, and of the clocks."""
    while story.t + interval <= until + 1e-9:
        beat = replace(story.heartbeat(), clock_difference=difference)
        story.at(story.t + interval, beat)
    return story


@pytest.mark.parametrize("late", [1, 2, 5, 9])
@pytest.mark.parametrize("begin", [1.0, 1.5, 1.9])
def test_some_late_heartbeats_in_a_row_are_no_clock_that_differs(late, begin):
    story = beats(Story(), begin, 0.002)
    beats(story, begin + late * 0.1, 0.4)
    beats(story, 10.0, 0.002)
    assert story.alarms() == []
    assert story.state.alarming.alarms == ()


def test_a_first_heartbeat_that_is_late_is_none_either():
    assert beats(beats(Story(), 0.1, 3.0), 5.0, 0.002).alarms() == []


def test_what_waited_while_we_hung_is_none_either():
    """Given 2.5 s in which nobody reads, when all that came meanwhile is read at once."""
    story = beats(Story(), 1.0, 0.002)
    for number in range(10):
        story.at(3.5, replace(story.heartbeat(), clock_difference=0.95 - number / 10))
    assert beats(story, 8.0, 0.002).alarms() == []


@pytest.mark.parametrize("difference", [0.3, -0.3, 7200.0])
@pytest.mark.parametrize("interval", [0.1, 0.5, 1.0])
def test_a_clock_that_differs_is_told_within_seconds(difference, interval):
    story = beats(Story(), 3.0, difference, interval)
    assert story.alarms() == [TEXT]
    assert beats(story, 6.0, difference, interval).alarms() == [TEXT], "once"


@pytest.mark.parametrize("difference", [0.3, -0.3])
def test_a_clock_that_is_set_in_flight_is_told_within_seconds(difference):
    story = beats(Story(), 5.0, 0.002)
    assert beats(story, 5.9, difference).alarms() in ([], [TEXT])
    assert beats(story, 7.5, difference).alarms() == [TEXT]


def test_a_clock_that_differs_shows_although_some_heartbeats_are_late():
    """Its clock is 0.3 s ahead, so that late ones look as if they were in time."""
    story = Story()
    for _ in range(20):
        beats(story, story.t + 0.3, -0.3)
        beats(story, story.t + 0.1, 0.0)
    assert story.alarms() == [TEXT]
    assert AGREES not in story.said()


def test_the_alarm_is_over_when_the_clock_agrees_again():
    story = beats(Story(), 3.0, 5.0)
    assert story.state.alarming.alarms == (TEXT,)
    beats(story, 5.5, 0.002)
    assert story.state.alarming.alarms == ()
    assert story.said().count(AGREES) == 1
    beats(story, 9.0, 5.0)
    assert story.state.alarming.alarms == (TEXT,), "and comes again"


def test_other_alarms_stay_when_it_is_over():
    story = beats(Story(), 3.0, 5.0)
    story.state = replace(
        story.state,
        alarming=replace(story.state.alarming, alarms=(*story.state.alarming.alarms, "another")),
    )
    assert beats(story, 5.5, 0.002).state.alarming.alarms == ("another",)


def test_what_was_heard_before_a_long_silence_says_nothing():
    story = beats(Story(), 1.0, 5.0)
    story.at(20.0, replace(story.heartbeat(), clock_difference=5.0))
    assert story.alarms() == []


def test_without_stamps_nothing_is_known():
    story = Story()
    story.alive(5.0)
    assert story.alarms() == []


def test_one_that_follows_says_nothing_of_clocks_which_its_leader_tells():
    story = Story()
    for number in range(100):
        story.state = replace(
            story.state,
            own=replace(story.state.own, leading=False),
            alarming=replace(story.state.alarming, alarms=(TEXT,) if number % 2 else ()),
        )
        story.at(number / 10, replace(story.heartbeat(), clock_difference=5.0 * (number < 50)))
    assert story.said() == ""
