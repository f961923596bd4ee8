"""What is told of a decision waits for those who carry it out; then comes all, in order."""

import math

import pytest
from chute_msgs.msg import SafetyState
from chute_msgs.srv import Kill
from supervisor_bench import Scene

from chute_ros.model import Action
from chute_ros.runtime import deferred_work
from chute_ros.runtime.deferred_work import QUIET, DeferredWork

#: Longer than anything here takes, s.
LONG = 3.0


@pytest.fixture
def told():
    return []


def test_while_nothing_was_decided_all_is_told_at_once(told):
    later = DeferredWork()
    later.tell(lambda: told.append("a log line"))
    assert (told, later.quiet, later.until) == (["a log line"], False, math.inf)


def test_after_a_decision_it_waits_and_comes_in_order_once(told):
    later = DeferredWork()
    later.decided(10.0)
    for what in ("the decision", "a log line"):
        later.tell(lambda what=what: told.append(what))
    later.look(10.0 + QUIET / 2)
    assert (told, later.quiet, later.until) == ([], True, 10.0 + QUIET)
    later.look(later.until)
    assert (told, later.quiet) == (["the decision", "a log line"], False)
    later.look(20.0)
    assert told == ["the decision", "a log line"]


def test_decisions_one_after_the_other_do_not_keep_it_quiet_for_ever(told):
    later = DeferredWork()
    later.decided(10.0)
    later.tell(lambda: told.append("the first"))
    later.decided(10.0 + QUIET * 0.9)
    later.look(10.0 + QUIET)
    assert told == ["the first"]


def test_what_raises_keeps_nothing_else_back(told):
    later = DeferredWork()
    later.decided(10.0)
    later.tell(lambda: told.append("the first"))
    later.tell(lambda: 1 // 0)
    later.tell(lambda: told.append("the last"))
    with pytest.raises(ZeroDivisionError):
        later.look(11.0)
    assert told == ["the first", "the last"]
    later.look(12.0)
    assert told == ["the first", "the last"]


def test_what_is_told_may_be_decided_upon(told):
    later = DeferredWork()
    later.decided(10.0)
    later.tell(lambda: later.decided(11.0))
    later.look(11.0)
    later.tell(lambda: told.append("of the second"))
    assert (told, later.until) == ([], 11.0 + QUIET)


@pytest.fixture
def ready(bench, monkeypatch):
    """A supervisor that stays quiet for long."""
    scene = Scene(bench)
    scene.await_stage(SafetyState.READY)
    bench.until(
        lambda: not scene.supervisor.runtime.afterwards.quiet, "all is told of the release"
    )
    monkeypatch.setattr(deferred_work, "QUIET", LONG)
    return scene


def test_a_kill_leaves_before_anything_is_told_of_it_and_then_all_is(ready, capfd):
    ready.bench.ask(Kill, "safety/kill", reason="a person says so")
    ready.await_decision(Action.KILL)
    assert ready.states[-1].state == SafetyState.READY
    assert " KILL by rule " not in capfd.readouterr().err
    ready.await_stage(SafetyState.KILLING)
    assert " KILL by rule " in capfd.readouterr().err


def test_a_supervisor_that_ends_meanwhile_has_told_it(ready, capfd):
    ready.bench.ask(Kill, "safety/kill", reason="a person says so")
    ready.await_decision(Action.KILL)
    ready.bench.remove(ready.supervisor)
    assert " KILL by rule " in capfd.readouterr().err
