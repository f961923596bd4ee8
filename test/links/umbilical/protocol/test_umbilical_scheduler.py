"""The scheduler: one token a write, spaced, the heartbeat in between, the urgent first."""

import itertools
import math

import pytest

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol.scheduler import (
    HEARTBEAT,
    Command,
    CommandScheduler,
    SchedulerLimits,
)

FIRE, VALVE, INFO, WIPE = (
    Command(name, f"<{token}>".encode())
    for name, token in [("drogue", "D"), ("open_mav", "M"), ("flash_info", "I"), ("wipe", "W")]
)
LIMITS = SchedulerLimits(spacing=0.125, heartbeat_interval=1.0, heartbeat_slack=0.5)


class Bench:
    """A scheduler that is woken when it wants to be; writes: (time, token)."""

    def __init__(self, limits=LIMITS, alive=False, wire=True):
        self.scheduler = CommandScheduler(limits)
        self.now = 0.0
        self.writes = []
        self.numbers = 0
        if alive:
            self.scheduler.owner_alive(math.inf)
        if wire:
            self.scheduler.wire_opened(0.0)

    def at(self, t):
        while (wake := self.scheduler.next_deadline()) <= t:
            self.now = max(self.now, wake)
            self._look()
        self.now = t
        self._look()
        return self

    def order(self, *commands, urgent=False):
        for command in commands:
            self.numbers += 1
            self.scheduler.start(self.numbers, command, self.now, urgent, 0)
        self._look()
        return self

    def _look(self):
        self.scheduler.send_next(self.now)
        sends = self.scheduler.take_output()
        assert len(sends) <= 1
        self.writes += [(self.now, send.command.token.decode()) for send in sends]
        assert self.scheduler.next_deadline() > self.now

    def tokens(self):
        return "".join(token for _, token in self.writes)

    def times(self, token):
        return [t for t, written in self.writes if written == token]


def test_commands_leave_one_by_one_in_their_order_and_the_urgent_before_them():
    assert Bench().order(VALVE).at(1.0).writes == [(0.125, "<M>")], "a spacing after the opening"
    bench = Bench().at(1.0).order(VALVE, INFO, VALVE).at(3.0)
    assert bench.writes == [(1.0, "<M>"), (1.125, "<I>"), (1.25, "<M>")]
    assert (bench.scheduler.commands_sent, bench.scheduler.waiting) == (3, 0)
    bench = Bench().at(1.0).order(VALVE, INFO, INFO)
    assert bench.order(FIRE, urgent=True).at(3.0).tokens() == "<M><D><I><I>"
    bench = Bench().at(1.0).order(INFO).order(VALVE, FIRE, urgent=True)
    assert bench.at(3.0).tokens() == "<I><M><D>"


def test_heartbeats_leave_at_their_own_rate_while_the_owner_is_known_to_live():
    bench = Bench(alive=True).at(4.5)
    assert bench.writes == [(t, "<H>") for t in (0.125, 1.125, 2.125, 3.125, 4.125)]
    assert bench.scheduler.heartbeats_sent == 5
    assert bench.scheduler.last_heartbeat == 4.125
    assert Bench().at(5.0).writes == []
    bench = Bench()
    bench.scheduler.owner_alive(2.125)
    assert bench.at(5.0).times("<H>") == [0.125, 1.125]
    bench.scheduler.owner_alive(6.5)
    assert bench.at(9.0).times("<H>") == [0.125, 1.125, 5.0, 6.0]
    assert bench.scheduler.next_deadline() == math.inf
    bench = Bench(alive=True)
    bench.scheduler.send_next(0.2)
    (send,) = bench.scheduler.take_output()
    assert (send.command, send.token) == (HEARTBEAT, None), "it has no number"


def test_a_heartbeat_that_is_due_lets_only_an_urgent_one_pass_until_it_is_overdue():
    bench = Bench(alive=True).at(1.0).order(*[INFO] * 20).at(6.0)
    assert len(bench.times("<I>")) == 20
    beats = bench.times("<H>")
    assert max(b - a for a, b in itertools.pairwise(beats)) <= 1.0 + LIMITS.spacing
    bench = Bench(alive=True).at(1.0625).order(INFO).order(FIRE, urgent=True).at(1.5)
    assert bench.writes[1:] == [(1.0625, "<I>"), (1.1875, "<D>"), (1.3125, "<H>")]
    bench = Bench(alive=True).at(1.0).order(*[FIRE] * 20, urgent=True).at(8.0)
    assert len(bench.times("<D>")) == 20
    assert bench.times("<H>")[:3] == [0.125, 1.625, 3.125]


def test_nothing_leaves_while_the_wire_is_closed_and_what_waits_leaves_after():
    bench = Bench(alive=True, wire=False).order(INFO).order(FIRE, urgent=True).at(5.0)
    assert bench.writes == []
    assert bench.scheduler.next_deadline() == math.inf
    bench.scheduler.wire_opened(5.0)
    assert bench.at(6.0).writes == [(5.125, "<D>"), (5.25, "<H>"), (5.375, "<I>")]


def test_closing_stops_it_at_once_and_an_opening_right_after_a_write_keeps_the_spacing():
    bench = Bench(alive=True).at(1.0).order(INFO, INFO)
    bench.scheduler.wire_closed()
    assert bench.at(9.0).tokens() == "<H><I>"
    bench = Bench().at(1.0).order(INFO, INFO)
    bench.scheduler.wire_closed()
    bench.scheduler.wire_opened(1.0)
    assert bench.at(2.0).writes == [(1.0, "<I>"), (1.125, "<I>")]


def test_a_full_queue_is_told_but_the_urgent_find_a_place():
    bench = Bench(SchedulerLimits(most_waiting=2), wire=False).order(INFO, INFO, VALVE)
    (not_sent,) = bench.scheduler.take_finished()
    assert (not_sent.token, not_sent.command, not_sent.accepted) == (3, VALVE, False)
    assert not_sent.text() == "not sent: 2 commands are waiting already"
    assert bench.scheduler.take_finished() == []
    bench.order(FIRE, urgent=True)
    assert bench.scheduler.take_finished() == []
    bench.scheduler.wire_opened(0.0)
    assert bench.at(2.0).tokens() == "<D><I><I>"


def test_a_cancelled_one_does_not_leave_and_what_was_sent_cannot_be_cancelled():
    for urgent in (False, True):
        bench = Bench().order(INFO, VALVE, FIRE, urgent=urgent)
        bench.scheduler.cancel(2, 0.0)
        bench.scheduler.cancel(99, 0.0)
        assert bench.at(2.0).tokens() == "<I><D>"
    bench = Bench().at(1.0).order(INFO, VALVE)
    bench.scheduler.cancel(1, 1.0)
    assert bench.at(2.0).tokens() == "<I><M>"
    bench = Bench().order(VALVE)
    bench.now = 1.0
    bench.scheduler.start(7, INFO, 1.0, False, 0)
    bench.scheduler.cancel(1, 1.0)
    assert bench.at(2.0).tokens() == "<I>", "what waits does not leave by starting another"


def test_one_without_a_number_leaves_in_its_turn_unless_it_is_withdrawn():
    bench = Bench().order(INFO)
    bench.scheduler.send_once(WIPE, 0.0)
    bench.scheduler.send_once(VALVE, 0.0)
    bench.scheduler.withdraw(lambda command: command == WIPE)
    bench.scheduler.withdraw(lambda command: command == INFO)  # it has a number
    assert bench.at(2.0).tokens() == "<I><M>"


def test_looking_late_sends_one_and_then_waits_again():
    bench = Bench().order(INFO, INFO, INFO)
    bench.now = 10.0
    bench._look()
    assert bench.at(11.0).writes == [(10.0, "<I>"), (10.125, "<I>"), (10.25, "<I>")]


@pytest.mark.parametrize(
    ("limits", "named"),
    [
        ({"spacing": 0.09}, "spacing"),
        ({"spacing": math.inf}, "spacing"),
        ({"spacing": math.nan}, "spacing"),
        ({"heartbeat_interval": 0.2}, "heartbeat_interval"),
        ({"heartbeat_interval": math.inf}, "heartbeat_interval"),
        ({"heartbeat_slack": -0.1}, "heartbeat_slack"),
        ({"heartbeat_slack": math.nan}, "heartbeat_slack"),
    ],
)
def test_limits_that_make_no_sense_are_refused_by_name(limits, named):
    with pytest.raises(ParameterError, match=named):
        SchedulerLimits(**limits)


def test_the_longest_time_between_heartbeats_is_far_below_what_the_receiver_waits():
    assert SchedulerLimits().latest_heartbeat == pytest.approx(1.62)
