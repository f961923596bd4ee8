"""Where nothing is acknowledged, sent is not done: done is what the device's own status shows."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import TransitionError
from chute_ros.model import Outcome
from chute_ros.protocol.effect import NO_ANSWER, ConfirmedCommand, EffectLimits, EffectLoop
from chute_ros.protocol.effect_phases import TRANSITIONS, Happening, Phase
from chute_ros.transitions import after

SHOWN = "telemetry reports open"


class Refused:
    """How a command that found no place to wait ends."""

    accepted = False
    not_now = False
    superseded = False
    result = NO_ANSWER

    def text(self):
        return "not sent: too many wait"


class Bench:
    """One loop, a wire on which the story sends, and a device whose status it sets."""

    def __init__(self, already=False, effect=True, sends_at_once=True, **goal):
        self.there = already
        shown = (lambda: self.there) if effect else None
        text = SHOWN if effect else "nothing shows it"
        self.goal = ConfirmedCommand("open", ("<S>",), text, shown, unacknowledged=True, **goal)
        self.loop = EffectLoop(1, self.goal, EffectLimits(1.5, 0.25, 5.0), 0.0)
        self.sends_at_once = sends_at_once
        self.sent, self.waiting, self.reports = [], 0, []
        self.now = 0.0
        self._collect()

    def at(self, now):
        while self.loop.next_deadline() <= now:
            self.now = max(self.now, self.loop.next_deadline())
            self.loop.update(self.now)
            assert self.loop.next_deadline() > self.now
            self._collect()
        self.now = now
        return self

    def send(self):
        """What waits leaves now."""
        while self.waiting:
            self.waiting -= 1
            self.sent.append(self.now)
            self.loop.command_sent(self.now)
        return self._collect()

    def shows(self, there=True):
        self.there = there
        self.loop.effect_may_show(self.now)
        return self._collect()

    def _collect(self):
        self.waiting += len(self.loop.take_commands())
        if self.waiting and self.sends_at_once:
            self.send()
        self.reports += [report.outcome for report in self.loop.take_reports()]
        return self

    @property
    def end(self):
        assert self.loop.finished is not None
        return self.loop.finished


def test_sent_and_then_shown():
    bench = Bench()
    assert bench.reports == [Outcome.SENT]
    bench.at(0.3).shows()
    assert bench.reports == [Outcome.SENT, Outcome.CONFIRMED]
    end = bench.end
    assert (end.success, end.accepted, end.sent, end.shown) == (True, False, True, True)
    assert end.message == "telemetry reports open after 0.30 s; sent once"
    assert end.result == NO_ANSWER


def test_sent_and_never_shown_is_sent_again_and_given_up_in_time():
    bench = Bench().at(20.0)
    assert bench.sent == [0.0, 1.5, 3.0, 4.5]
    end = bench.end
    assert (end.success, end.sent, end.shown) == (False, True, False)
    assert end.message == (
        "open given up after 5.0 s: sent 4 times, but the device's own status never showed that "
        "telemetry reports open"
    )
    assert bench.reports == [Outcome.SENT, Outcome.FAILED]


def test_the_effect_of_a_second_try_counts():
    bench = Bench().at(2.0).shows()
    assert bench.end.message == "telemetry reports open after 2.00 s; sent 2 times"
    assert bench.at(20.0).sent == [0.0, 1.5]


def test_what_is_sent_once_is_never_sent_again_though_its_effect_may_come_late():
    bench = Bench(once=True).at(4.9)
    assert bench.sent == [0.0]
    assert not bench.loop.ended
    assert "sent once, but" in bench.at(5.0).end.message
    assert bench.at(50.0).sent == [0.0]
    # The effect of what is sent once may come late.
    assert Bench(once=True).at(4.5).shows().end.success


def test_the_effect_counts_and_its_time_runs_from_when_it_left():
    # The time to the effect runs from when it left.
    bench = Bench(sends_at_once=False).at(1.0).send().at(2.4)
    assert (bench.sent, bench.waiting) == ([1.0], 0)
    bench.at(2.5)
    assert bench.waiting == 1
    assert bench.send().sent == [1.0, 2.5]
    # The effect does not count before it left.
    bench = Bench(sends_at_once=False, even_if_shown=True).at(0.5).shows()
    assert not bench.loop.ended
    bench.send()
    assert not bench.loop.ended
    bench.shows()
    assert bench.end.sent


def test_what_another_did_while_this_one_waited_is_not_done_again():
    bench = Bench(sends_at_once=False, sent_by_another=lambda: True).at(0.5).shows()
    assert (bench.end.success, bench.end.sent, bench.end.shown) == (True, False, True)
    assert bench.end.message == f"{SHOWN} after 0.50 s; nothing was sent"
    assert bench.reports == [Outcome.CONFIRMED]


def test_what_nobody_has_sent_is_sent_whatever_is_told():
    # One damaged line of telemetry must not swallow a deploy.
    bench = Bench(sends_at_once=False).at(0.5).shows()
    assert not bench.loop.ended
    assert bench.send().sent == [0.5]


def test_what_never_left_says_so():
    end = Bench(sends_at_once=False).at(9.0).end
    assert (end.success, end.sent, end.shown) == (False, False, False)
    assert end.message == (
        "open given up after 5.0 s: never sent: its turn did not come, or the wire is closed"
    )


@pytest.mark.parametrize("again", [False, True])
def test_what_shows_already_is_sent_only_where_that_is_wanted(again):
    bench = Bench(already=True, even_if_shown=again)
    assert len(bench.sent) == int(again)
    if again:
        bench.at(0.1).shows()
    end = bench.end
    assert (end.success, end.sent, end.shown) == (True, again, True)
    assert end.message.endswith("sent once" if again else "already; nothing was sent")


def test_where_nothing_shows_it_sent_is_all():
    bench = Bench(effect=False)
    end = bench.end
    assert (end.success, end.accepted, end.sent, end.shown) == (True, False, True, False)
    assert end.message == "open sent; nothing shows it"
    assert bench.at(20.0).sent == [0.0]


def test_one_that_found_no_place_ends_at_once():
    bench = Bench(sends_at_once=False)
    bench.loop.command_finished(Refused(), 0.1)
    end = bench.end
    assert (end.success, end.sent, end.message) == (False, False, "open not sent: too many wait")


@pytest.mark.parametrize("left", [False, True])
def test_one_that_is_not_wanted_any_more_says_whether_it_left(left):
    bench = Bench(sends_at_once=left)
    bench.loop.abandon("close was ordered", 0.1)
    sent = "; it had been sent once" if left else ""
    message = f"open given up: close was ordered{sent}"
    assert (bench.end.sent, bench.end.message) == (left, message)
    assert bench.loop.is_sent is left
    assert bench.loop.next_deadline() == math.inf


def test_what_is_acknowledged_does_not_take_sent_for_it():
    loop = EffectLoop(
        1,
        ConfirmedCommand("open", ("<S>",), "x", lambda: False),
        EffectLimits(1.5, 0.25, 5.0),
        0.0,
    )
    loop.command_sent(0.0)
    assert loop.phase is Phase.WAIT_ACKNOWLEDGEMENT
    loop.abandon("y", 0.1)
    assert loop.finished.sent
    assert not loop.finished.shown


@pytest.mark.parametrize("phase", Phase, ids=lambda one: one.name)
def test_sent_moves_on_only_what_waits_for_it(phase):
    if phase is Phase.WAIT_ACKNOWLEDGEMENT:
        assert after(TRANSITIONS, phase, Happening.SENT_UNACKNOWLEDGED) is Phase.WAIT_EFFECT
    else:
        with pytest.raises(TransitionError):
            after(TRANSITIONS, phase, Happening.SENT_UNACKNOWLEDGED)


STEPS = st.lists(st.tuples(st.floats(0, 1.5), st.sampled_from(["send", "show", "hide"])))
YES = st.booleans()


@given(STEPS, YES, YES, YES, YES)
def test_whatever_comes_it_ends_once_in_time(steps, effect, once, again, already):
    bench = Bench(already, effect, sends_at_once=False, once=once, even_if_shown=again)
    for pause, what in steps:
        bench.at(bench.now + pause)
        bench.send() if what == "send" else bench.shows(what == "show")
    bench.at(bench.now + 5.0)
    ends = [one for one in bench.reports if one in (Outcome.CONFIRMED, Outcome.FAILED)]
    assert len(ends) == 1
    assert bench.end.shown <= bench.end.success
    assert not once or len(bench.sent) <= 1
    assert bench.reports.count(Outcome.SENT) <= 1
