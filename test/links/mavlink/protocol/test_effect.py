"""Acknowledged is not done: a goal is reached when the device's own status shows it."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import ParameterError, TransitionError
from chute_ros.links.mavlink.protocol import results
from chute_ros.links.mavlink.protocol.commands import CommandFinished, MavCommand
from chute_ros.model import Outcome
from chute_ros.protocol.effect import ConfirmedCommand, EffectLimits, EffectLoop
from chute_ros.protocol.effect_phases import TRANSITIONS, Happening, Phase
from chute_ros.transitions import after

ORDER = MavCommand(1, 161, 208, (2.0, *[0.0] * 6))
ASK = MavCommand(1, 161, 512, (430.0, *[0.0] * 6))


class Bench:
    """One loop and a device whose status the story sets."""

    def __init__(self, already=False, effect=True, **goal):
        self.there = already
        self.goal = ConfirmedCommand(
            "release",
            (ORDER,),
            "PARACHUTE_STATUS reports deployed",
            (lambda: self.there) if effect else None,
            ASK,
            **goal,
        )
        self.loop = EffectLoop(1, self.goal, EffectLimits(1.5, 0.25, 5.0), 0.0)
        self.sent, self.asked, self.reports = [], [], []
        self.now = 0.0
        self._collect()

    def at(self, now):
        while self.loop.next_deadline() <= now and not self.loop.ended:
            self.now = max(self.now, self.loop.next_deadline())
            self.loop.update(self.now)
            self._collect()
        self.now = now
        return self

    def answer(self, result=results.ACCEPTED, sends=1, superseded=False):
        end = CommandFinished(1, ORDER, result, sends, self.now, superseded)
        self.loop.command_finished(end, self.now)
        self._collect()
        return self

    def shows(self):
        self.there = True
        self.loop.effect_may_show(self.now)
        self._collect()
        return self

    def _collect(self):
        commands = self.loop.take_commands()
        self.sent += [self.now for _ in commands]
        for _ in commands:
            self.loop.command_sent(self.now)
        self.asked += [self.now for _ in self.loop.take_refreshes()]
        self.reports += [report.outcome for report in self.loop.take_reports()]

    @property
    def end(self):
        assert self.loop.finished is not None
        return self.loop.finished


def test_a_pair_is_in_the_table_or_raises():
    for phase, happening in itertools.product(Phase, Happening):
        if (phase, happening) in TRANSITIONS:
            moved = after(TRANSITIONS, phase, happening)
            assert moved is TRANSITIONS[phase, happening], (phase, happening)
        else:
            with pytest.raises(TransitionError, match=phase.name):
                after(TRANSITIONS, phase, happening)
    assert not [pair for pair in TRANSITIONS if pair[0] in (Phase.CONFIRMED, Phase.FAILED)]


def test_acknowledged_and_then_shown():
    bench = Bench().at(0.1).answer()
    assert not bench.loop.ended
    assert bench.asked == [0.1]
    bench.at(0.3).shows()
    assert (bench.end.success, bench.end.accepted, bench.end.result) == (True, True, 0)
    assert bench.end.message.startswith("PARACHUTE_STATUS reports deployed after 0.30 s")
    assert bench.reports == [Outcome.SENT, Outcome.ACCEPTED, Outcome.CONFIRMED]


def test_shown_or_not_acknowledged_or_not_says_which_did_not_come():
    # Shown without an acknowledgement is done and says so.
    bench = Bench().at(0.3).shows()
    assert (bench.end.success, bench.end.accepted) == (True, False)
    assert "not acknowledged" in bench.end.message
    # Acknowledged but never shown says which did not come and when it gave up.
    bench = Bench().at(0.1).answer()
    while not bench.loop.ended:
        bench.at(bench.loop.next_deadline())
        if bench.sent[-1] == bench.now and not bench.loop.ended:
            bench.answer()
    assert (bench.end.success, bench.end.accepted) == (False, True)
    assert "given up after 5.0 s" in bench.end.message
    assert "acknowledged after 0.10 s" in bench.end.message
    assert "never showed that PARACHUTE_STATUS reports deployed" in bench.end.message
    # Neither says both.
    bench = Bench().at(1.5).answer(results.NO_ACKNOWLEDGEMENT, sends=3).at(10.0)
    assert (bench.end.success, bench.end.accepted) == (False, False)
    assert bench.end.result == results.NO_ACKNOWLEDGEMENT
    assert "no acknowledgement after 3 sends" in bench.end.message
    assert "never showed" in bench.end.message


def test_an_effect_that_is_late_is_asked_for_again_and_then_ordered_again():
    bench = Bench().at(0.1).answer().at(1.7)
    assert len(bench.asked) >= 5
    assert bench.sent == [0.0, pytest.approx(1.6)]
    bench.at(1.8).shows()
    assert bench.end.success


def test_temporarily_rejected_is_told_once_and_at_once_and_tried_again():
    bench = Bench().at(0.1).answer(results.TEMPORARILY_REJECTED)
    assert bench.reports == [Outcome.SENT, Outcome.REFUSED]
    assert bench.at(0.4).sent == [0.0, pytest.approx(0.35)]
    bench.answer(results.TEMPORARILY_REJECTED).at(0.7).answer().shows()
    assert bench.end.success
    assert bench.reports[2:] == [Outcome.ACCEPTED, Outcome.CONFIRMED]
    # No answer and a newer command are no refusals.
    bench = Bench(urgent=True).at(1.0).answer(results.NO_ACKNOWLEDGEMENT)
    bench.at(1.3).answer(results.TEMPORARILY_REJECTED, superseded=True)
    assert Outcome.REFUSED not in bench.reports


def test_any_other_refusal_is_final_and_in_words_unless_somebody_insists():
    for result in (results.DENIED, results.UNSUPPORTED, results.FAILED, results.CANCELLED, 9, 99):
        bench = Bench().at(0.1).answer(result)
        end = bench.end
        assert (end.success, end.accepted, end.result) == (False, False, result)
        assert results.result_text(result) in end.message
        assert bench.reports[-1] is Outcome.FAILED
    for result in (results.DENIED, results.UNSUPPORTED, results.FAILED):
        bench = Bench(insist=True).at(0.1).answer(result)
        assert bench.reports == [Outcome.SENT, Outcome.REFUSED]
        assert not bench.loop.ended
        assert len(bench.at(0.4).sent) == 2
        assert "given up after 5.0 s" in bench.at(20.0).end.message
    bench = Bench(hint=lambda: "armed triggers: none").at(0.1).answer(results.FAILED)
    assert bench.end.message.endswith("; armed triggers: none")


def test_nothing_is_ordered_of_what_is_shown_already():
    # An effect that is there already is not ordered again.
    bench = Bench(already=True)
    assert bench.sent == []
    assert bench.end.success
    assert "nothing was sent" in bench.end.message
    assert bench.reports == [Outcome.CONFIRMED]
    # Nothing more is sent once it is shown.
    bench = Bench().at(0.1).answer().shows()
    before = (list(bench.sent), list(bench.asked))
    bench.at(100.0).answer()
    assert (bench.sent, bench.asked) == before
    assert bench.loop.next_deadline() == math.inf


def test_where_no_status_shows_it_the_acknowledgement_is_all():
    bench = Bench(effect=False).at(0.1)
    bench.loop.effect_may_show(0.1)
    assert not bench.loop.ended
    bench.answer()
    assert bench.end.success
    assert bench.end.message == "release acknowledged after 0.10 s"


def test_what_is_not_wanted_any_more_ends_with_the_reason():
    bench = Bench().at(0.1)
    bench.loop.abandon("a release was ordered", 0.1)
    assert "given up: a release was ordered" in bench.end.message
    bench.loop.abandon("again", 0.2)
    assert "again" not in bench.end.message


def test_times_that_make_no_sense_are_refused_by_name():
    for name in ("effect_timeout", "retry_interval", "give_up_after"):
        with pytest.raises(ParameterError, match=name):
            EffectLimits(**{name: 0.0})


def test_a_refusal_after_an_acceptance_is_the_answer_that_is_reported():
    bench = Bench().at(0.1).answer().at(1.7).answer(results.DENIED)
    assert (bench.end.success, bench.end.accepted, bench.end.result) == (False, True, 2)
    assert "denied" in bench.end.message
    # Time that is up names the newest answer too.
    bench = Bench().at(0.1).answer().at(1.7)
    while not bench.loop.ended:
        bench.answer(results.TEMPORARILY_REJECTED).at(bench.now + 0.3)
    assert "acknowledged after 0.10 s, but the device's own status never" in bench.end.message
    assert "; newest answer: temporarily rejected" in bench.end.message
    assert bench.end.result == results.TEMPORARILY_REJECTED


def test_superseded_is_tried_again_only_if_urgent():
    urgent = Bench(urgent=True).at(0.1).answer(results.NO_ACKNOWLEDGEMENT, superseded=True)
    assert len(urgent.at(0.4).sent) == 2
    other = Bench().at(0.1).answer(results.NO_ACKNOWLEDGEMENT, superseded=True)
    assert "for a newer command of the same number" in other.end.message


def test_an_order_that_nobody_has_fetched_is_not_sent_after_the_end():
    for end in ("shown", "abandoned"):
        bench = Bench()
        loop = EffectLoop(1, bench.goal, EffectLimits(1.5, 0.25, 5.0), 0.0)
        if end == "shown":
            bench.there = True
            loop.effect_may_show(0.0)
        else:
            loop.abandon("a release was ordered", 0.0)
        assert loop.take_commands() == [], end


def test_the_status_is_not_asked_for_if_the_acknowledgement_finds_it_shown():
    bench = Bench().at(0.1)
    bench.there = True
    assert bench.answer().end.success
    assert bench.asked == []


def test_a_command_that_never_had_its_turn_says_so():
    loop = EffectLoop(1, Bench().goal, EffectLimits(1.5, 0.25, 5.0), 0.0)
    loop.update(5.0)
    assert "never sent: an earlier command of the same number" in loop.finished.message
    loop.update(6.0)
    assert len(loop.take_reports()) == 1


STEPS = st.lists(st.tuples(st.floats(0, 1.5), st.integers(-2, 255)), max_size=30)


@given(STEPS, st.booleans(), st.booleans())
def test_whatever_comes_it_ends_once_in_time_and_never_spins(steps, insist, effect):
    """-2 and -1: the status shows the effect, or not; else: this result is answered."""
    bench = Bench(effect=effect, insist=insist)
    for wait, what in steps:
        bench.at(bench.now + wait)
        if what == -2:
            bench.shows()
        elif what >= 0:
            bench.answer(what)
        bench.loop.update(bench.now)
        bench._collect()
        assert bench.loop.next_deadline() > bench.now
    bench.at(bench.now + 5.0)
    ends = [one for one in bench.reports if one in (Outcome.CONFIRMED, Outcome.FAILED)]
    assert len(ends) == 1
    assert bench.reports[-1] is ends[0]
    assert len(bench.sent) <= 5.0 / 0.25 + 1
