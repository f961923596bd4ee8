"""How a device node watches over its supervisors."""

import math

import pytest

from chute_ros.runtime.topics import SafetyPicture, SupervisorBeat
from chute_ros.runtime.watch import SupervisorWatch


def heard(watch: SupervisorWatch, name: str, now: float, leading: bool = False) -> None:
    watch.heartbeat(SupervisorBeat(name, leading), 0.001, now)


def test_one_that_was_never_heard_is_not_lost():
    watch = SupervisorWatch(0.5, 1.0)
    assert watch.look(1000.0) is None
    assert math.isnan(watch.tell(1000.0).silence)


def test_one_that_falls_silent_is_lost_once_and_comes_back_once():
    watch = SupervisorWatch(0.5, 1.0)
    heard(watch, "a", 10.0, leading=True)
    assert watch.look(11.0) is None, "silent for as long as it may be"
    assert [watch.look(11.001), watch.look(12.0)] == [True, None]
    heard(watch, "a", 13.0, leading=True)
    assert [watch.look(13.0), watch.look(13.1)] == [False, None]
    assert watch.tell(13.1).times_lost == 1


def test_one_that_only_looks_on_keeps_nobody_from_missing_the_leader():
    watch = SupervisorWatch(0.5, 1.0)
    heard(watch, "a", 10.0, leading=True)
    heard(watch, "b", 11.5)
    assert watch.look(11.5) is True


def test_a_supervisor_of_a_fifth_name_counts_once_another_is_gone():
    """Given four that were heard before: made-up names, or supervisors that were renamed."""
    watch = SupervisorWatch(0.5, 0.2)
    for name in "abcd":
        heard(watch, name, 10.0)
    heard(watch, "e", 10.2, leading=True)
    assert math.isnan(watch.tell(10.2).silence), "four are there"
    for name in "bcd":
        heard(watch, name, 10.2)
    heard(watch, "e", 10.25, leading=True)
    assert watch.tell(10.25).silence == 0.0, "a has made room"
    heard(watch, "a", 10.3, leading=True)
    assert watch.tell(10.3).silence == pytest.approx(0.05), "and finds none itself"


def test_a_decision_of_a_clock_that_was_set_is_no_older():
    """Given a supervisor whose wall clock is set back by an hour between two heartbeats."""
    watch = SupervisorWatch(0.5, 1.0)
    watch.heartbeat(SupervisorBeat("a", True), 0.001, 10.0)
    watch.heartbeat(SupervisorBeat("a", True), 3600.001, 10.1)
    assert watch.age(3600.002) == pytest.approx(0.002)
    assert watch.tell(10.1).offset == pytest.approx(3600.0)


def test_a_clock_that_is_behind_shows_in_the_answer_to_our_own_heartbeat():
    """Given one that seems to be 2 s away, and a picture that answers what left 0.1 s ago."""
    watch = SupervisorWatch(0.5, 1.0)
    watch.heartbeat(SupervisorBeat("a", True), 2.0, 10.0)
    assert watch.tell(10.0).delay == pytest.approx(2.0)
    watch.sent(77, 10.0)
    for stamp in (76, 77):
        picture = SafetyPicture(False, (), "a", {"upf_can": stamp})
        watch.picture(picture, "upf_can", 2.0, 10.1)
        assert watch.tell(10.1).offset == pytest.approx(1.9 if stamp == 77 else 0.0)
    assert watch.age(2.0) == pytest.approx(0.1)
