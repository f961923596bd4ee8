"""A command as a transaction: sent again, answered by the right one, or given up."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chute_ros.errors import ParameterError
from chute_ros.links.mavlink.protocol import results
from chute_ros.links.mavlink.protocol.commands import (
    Acknowledgement,
    CommandLimits,
    CommandTransactions,
    MavCommand,
)
from chute_ros.links.mavlink.protocol.unanswered import MOST_SENDS

RELEASE = MavCommand(1, 161, 208, (2.0, *[0.0] * 6))
DISABLE = MavCommand(1, 161, 208, (0.0,) * 7)
ARM = MavCommand(1, 161, 225, (4.0, 4.0, *[0.0] * 5))


class Bench:
    """Transactions and what left; every try is at the deadline that they name."""

    def __init__(self, **limits):
        # Longer than the standard, so that what else a story tells fits in between.
        limits = {"ack_timeout": 0.5, "tries": 3, **limits}
        self.commands = CommandTransactions(CommandLimits(**limits))
        self.sent = []
        self.now = 0.0

    def start(self, token, command, **options):
        self.commands.start(token, command, self.now, **options)
        self._collect()
        return self

    def at(self, now):
        while self.commands.next_deadline() <= now:
            self.now = self.commands.next_deadline()
            self.commands.update(self.now)
            self._collect()
        self.now = now
        self.commands.update(now)
        self._collect()
        return self

    def ack(self, command, result=results.ACCEPTED, ids=None):
        system, component = ids or (command.system_id, command.component_id)
        self.commands.acknowledged(
            Acknowledgement(system, component, command.number, result), self.now
        )
        self._collect()
        return self

    def _collect(self):
        self.sent += [(self.now, one) for one in self.commands.take_output()]

    def ends(self):
        return self.commands.take_finished()


def test_it_is_sent_at_once_and_done_at_its_acknowledgement():
    bench = Bench().start(7, RELEASE)
    assert [(when, one.confirmation) for when, one in bench.sent] == [(0.0, 0)]
    (end,) = bench.at(0.2).ack(RELEASE).ends()
    assert (end.token, end.accepted, end.sends) == (7, True, 1)
    assert end.text() == "accepted (after 0.20 s)"
    assert len(bench.at(60.0).sent) == 1


def test_it_is_sent_again_with_a_rising_confirmation_and_given_up_in_words():
    # It is sent again with a rising confirmation and given up in words.
    bench = Bench(ack_timeout=0.5, tries=3).start(7, RELEASE).at(10.0)
    assert [(when, one.confirmation) for when, one in bench.sent] == [(0.0, 0), (0.5, 1), (1.0, 2)]
    (end,) = bench.ends()
    assert end.result == results.NO_ACKNOWLEDGEMENT
    assert end.text() == "no acknowledgement after 3 sends in 1.50 s"
    # The confirmation is a byte and stays at its highest.
    bench = Bench(tries=100, ack_timeout=0.1, late_ack_window=0.1)
    for number in (1, 2, 3, 4):  # each joins the one before, and begins its tries again
        bench.start(number, RELEASE, urgent=True).at(number * 8.5)
    bench.at(100.0)
    assert max(one.confirmation for _, one in bench.sent) == 255


def test_only_the_component_that_was_addressed_can_answer():
    for ids in ((1, 162), (2, 161), (255, 0)):
        bench = Bench().start(7, RELEASE).at(0.1).ack(RELEASE, ids=ids)
        assert bench.ends() == [], ids
        assert bench.commands.unexpected_count == 1


def test_every_result_ends_it_with_words_of_its_own():
    for result in (*range(5), *range(6, 12), 254):
        bench = Bench().start(7, RELEASE).at(0.1).ack(RELEASE, result)
        (end,) = bench.ends()
        assert end.result == result
        assert end.text(), result
    texts = [results.result_text(number) for number in range(256)]
    assert len(set(texts)) == 256
    assert "which MAVLink does not define" in results.result_text(99)


def test_in_progress_extends_the_wait_and_nothing_is_sent_meanwhile():
    bench = Bench(in_progress_timeout=5.0).start(7, RELEASE)
    bench.at(0.1).ack(RELEASE, results.IN_PROGRESS).at(5.0)
    assert len(bench.sent) == 1
    (end,) = bench.ack(RELEASE).ends()
    assert end.accepted
    # Right after an answered command too, but not if it is of an earlier one.
    bench = Bench(in_progress_timeout=5.0).start(1, DISABLE).at(0.1).ack(DISABLE)
    bench.at(0.2).start(2, RELEASE).at(0.3).ack(RELEASE, results.IN_PROGRESS)
    assert bench.commands.next_deadline() == pytest.approx(5.3)
    assert len(bench.at(5.0).sent) == 2
    bench = Bench(tries=1, ack_timeout=0.5).start(1, DISABLE).at(0.5)
    bench.at(0.6).start(2, RELEASE).at(0.7).ack(DISABLE, results.IN_PROGRESS)
    assert bench.commands.next_deadline() == pytest.approx(1.1)


def test_a_late_answer_to_an_earlier_command_does_not_confirm_a_later_one():
    bench = Bench(tries=1, ack_timeout=0.5).start(1, DISABLE).at(1.0)
    assert bench.ends()[0].result == results.NO_ACKNOWLEDGEMENT
    bench.start(2, RELEASE).at(1.1).ack(DISABLE)
    assert bench.ends() == []
    assert bench.commands.late_count == 1
    # Its own answer comes too, and two answers cannot both be to the one earlier send.
    (end,) = bench.at(1.2).ack(RELEASE).ends()
    assert (end.token, end.accepted) == (2, True)
    # Answers that never come do not hold a later command up for ever.
    bench = Bench(tries=1, ack_timeout=0.5, late_ack_window=5.0).start(1, DISABLE).at(1.0)
    bench.ends()
    bench.at(6.0).start(2, RELEASE).at(6.1).ack(RELEASE)
    assert bench.ends()[0].accepted
    # A late final answer after in progress does not confirm a later command.
    bench = Bench(tries=1, in_progress_timeout=1.0, late_ack_window=2.0).start(1, DISABLE)
    bench.at(0.1).ack(DISABLE, results.IN_PROGRESS).at(1.5)
    assert bench.ends()[0].result == results.NO_ACKNOWLEDGEMENT
    bench.at(2.5).start(2, RELEASE).at(2.6).ack(DISABLE)
    assert bench.ends() == []
    # What was sent once without waiting confirms nothing either.
    bench = Bench()
    bench.commands.send_once(DISABLE, 0.0)
    bench.start(2, RELEASE).at(0.1).ack(DISABLE)
    assert bench.ends() == []
    assert bench.at(0.2).ack(RELEASE).ends()[0].accepted


def test_commands_of_other_numbers_and_components_are_under_way_at_once():
    other = MavCommand(1, 162, 208)
    bench = Bench().start(1, RELEASE).start(2, ARM).start(3, other).at(0.1)
    assert len(bench.sent) == 3
    bench.ack(ARM, results.DENIED).ack(other).ack(RELEASE)
    ends = {end.token: end.result for end in bench.ends()}
    assert ends == {1: results.ACCEPTED, 2: results.DENIED, 3: results.ACCEPTED}


def test_a_second_command_of_the_same_number_waits_for_its_turn():
    bench = Bench().start(1, DISABLE).start(2, RELEASE).at(0.1)
    assert [one.command for _, one in bench.sent] == [DISABLE]
    bench.ack(DISABLE)
    assert [one.command for _, one in bench.sent] == [DISABLE, RELEASE]
    bench.at(0.2).ack(RELEASE)
    assert [end.token for end in bench.ends()] == [1, 2]


def test_an_urgent_one_takes_the_place_of_another_or_joins_the_very_same():
    bench = Bench().start(1, DISABLE).start(2, DISABLE).start(3, RELEASE, urgent=True)
    assert bench.sent[-1][1].command == RELEASE
    ends = bench.ends()
    assert {end.token: end.superseded for end in ends} == {1: True, 2: True}
    assert "for a newer command of the same number" in ends[0].text()
    # An urgent one joins one that asks for the very same.
    bench = Bench().start(1, RELEASE, urgent=True).at(0.1).start(2, RELEASE, urgent=True)
    assert len(bench.sent) == 2
    bench.at(0.2).ack(RELEASE)
    assert sorted(end.token for end in bench.ends()) == [1, 2]


def test_a_cancelled_command_is_neither_sent_again_nor_reported():
    bench = Bench().start(1, DISABLE).start(2, RELEASE)
    bench.commands.cancel(1, 0.1)
    bench.commands.cancel(2, 0.1)
    assert bench.at(10.0).ends() == []
    assert bench.commands.next_deadline() == math.inf
    bench = Bench().start(1, DISABLE).start(2, DISABLE).start(3, RELEASE)
    bench.commands.cancel(2, 0.1)
    bench.at(0.2).ack(DISABLE).at(0.3).ack(RELEASE)
    assert [end.token for end in bench.ends()] == [1, 3], "the others keep their turn"
    assert [one.command for _, one in bench.sent] == [DISABLE, RELEASE]


def test_commands_that_were_answered_add_no_tries_to_a_later_one():
    bench = Bench(tries=3)
    for number in (1, 2, 3):
        bench.start(number, DISABLE).at(bench.now + 0.1).ack(DISABLE)
    bench.start(9, RELEASE).at(10.0)
    assert [one.confirmation for _, one in bench.sent[3:]] == [0, 1, 2]


def test_a_device_that_never_answers_does_not_make_us_grow():
    bench = Bench(tries=1, ack_timeout=0.02, late_ack_window=60.0)
    for number in range(500):
        bench.start(number, RELEASE).at(bench.now + 0.03)
        bench.commands.send_once(RELEASE, bench.now)
    (sends,) = bench.commands._sends.values()
    assert len(sends._sends) <= MOST_SENDS


def test_limits_that_make_no_sense_are_refused_by_name():
    for name, value in (
        *(("ack_timeout", 0.0), ("tries", 0), ("tries", 101)),
        ("late_ack_window", math.nan),
    ):
        with pytest.raises(ParameterError, match=name):
            CommandLimits(**{name: value})


class Device:
    """Executes each command that reaches it and answers once, late, out of order, or not heard."""

    def __init__(self, chance: random.Random, loss: float, slowest: float):
        self.chance, self.loss, self.slowest = chance, loss, slowest
        self.on_the_way = []

    def receive(self, command, now):
        if self.chance.random() < self.loss:
            return
        result = results.ACCEPTED if command.params[0] == 0.0 else results.FAILED
        if self.chance.random() >= self.loss:
            self.on_the_way.append((now + self.chance.random() * self.slowest, result))


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32), st.floats(0, 0.8), st.floats(0.01, 4.9))
def test_whatever_is_lost_late_or_out_of_order_no_release_is_taken_for_accepted(
    seed, loss, slowest
):
    """The device accepts DISABLE and fails RELEASE: an accepted RELEASE would be a mix-up."""
    chance = random.Random(seed)
    device = Device(chance, loss, slowest)
    bench = Bench(tries=2, ack_timeout=0.3, late_ack_window=5.0)
    answered = 0
    for number in range(12):
        command = chance.choice([RELEASE, DISABLE])
        count = len(bench.sent)
        bench.start(number, command, urgent=chance.random() < 0.3)
        until = bench.now + chance.choice([0.1, 0.5, 1.5])
        while True:
            for _, send in bench.sent[count:]:
                device.receive(send.command, bench.now)
            count = len(bench.sent)
            device.on_the_way.sort()
            answer = device.on_the_way[0][0] if device.on_the_way else math.inf
            step = min(answer, bench.commands.next_deadline(), until)
            bench.now = max(step, bench.now)
            if step == until:
                break
            if step == answer:
                bench.ack(RELEASE, device.on_the_way.pop(0)[1])
            else:
                bench.commands.update(bench.now)
                bench._collect()
        for end in bench.ends():
            if end.result == results.NO_ACKNOWLEDGEMENT:
                continue
            answered += 1
            right = results.FAILED if end.command == RELEASE else results.ACCEPTED
            assert end.result == right, f"command {end.token} of {number}"
    assert answered or loss > 0 or slowest > 0.3
