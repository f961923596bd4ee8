"""An output that fires and never answers: stories, golden bytes and what must always hold."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.links.relay.protocol.link import RelayConfig, RelayLink
from chute_ros.model import LinkState, Outcome
from chute_ros.protocol.events import ParachuteChanged, RequestFinished, RequestReport

#: Channel 1 of an LCUS-1 closes and opens, by its data sheet.
FIRE, REST = bytes([0xA0, 1, 1, 0xA2]), bytes([0xA0, 1, 0, 0xA1])


class Output:
    """The link on an output that takes what it is given, or does not."""

    def __init__(self, config=None):
        self.link = RelayLink(config or RelayConfig())
        self.t, self.takes = 100.0, True
        #: (s, bytes) that the output took.
        self.written: list[tuple[float, bytes]] = []
        self.events: list[Any] = []

    def turn(self):
        """As the loop does: what is to be written, then what happened."""
        for frame in self.link.take_output():
            if self.takes:
                self.written.append((round(self.t - 100.0, 3), frame))
            else:
                self.link.not_written(frame)
        self.events += self.link.take_events()

    def to(self, t):
        """Go there, by every deadline on the way."""
        while (due := self.link.next_deadline() - 100.0) < t:
            self.t = max(self.t, 100.0 + due)
            self.link.update(self.t)
            self.turn()
        self.t = 100.0 + t
        self.link.update(self.t)
        self.turn()

    def open(self):
        self.link.wire_opened(self.t)
        self.turn()

    def lose(self):
        self.link.stream_ended(None)
        self.turn()

    def deploy(self, token=1, force=True):
        self.link.deploy(token, force, self.t)
        self.turn()

    def outcomes(self):
        reports = [one.report for one in self.events if isinstance(one, RequestReport)]
        return [(one.token, one.outcome) for one in reports]

    def ends(self):
        return [one.finished for one in self.events if isinstance(one, RequestFinished)]


def test_at_rest_it_is_written_again_and_again_and_is_unmonitored():
    output = Output()
    assert output.link.state is LinkState.NEVER_SEEN
    output.open()
    output.to(2.5)
    assert output.written == [(0.0, REST), (1.0, REST), (2.0, REST)]
    assert output.link.state is LinkState.UNMONITORED


def test_a_deploy_is_one_pulse_repeated_for_its_time_and_then_rest():
    output = Output(RelayConfig(pulse_time=0.35))
    output.open()
    output.to(0.5)
    output.deploy()
    output.to(2.0)
    fired = [(at, data) for at, data in output.written if data == FIRE]
    assert fired == [(0.5, FIRE), (0.6, FIRE), (0.7, FIRE), (0.8, FIRE)]
    assert output.written[-2:] == [(0.9, REST), (1.9, REST)]
    assert output.outcomes() == [(1, Outcome.SENT)]
    (end,) = output.ends()
    assert (end.success, end.accepted) == (False, False), "nobody has confirmed it"
    assert output.link.fired == 1


def test_it_is_at_rest_once_the_rest_after_the_pulse_was_taken():
    """Whoever ends the link waits for it."""
    output = Output(RelayConfig(pulse_time=0.35))
    assert output.link.at_rest
    output.deploy()
    assert not output.link.at_rest, "ordered, and not written yet"
    output.open()
    output.to(0.3)
    assert not output.link.at_rest
    output.takes = False
    output.to(0.6)
    assert not output.link.at_rest, "it may fire still"
    output.takes = True
    output.to(1.5)
    assert output.written[-1][1] == REST
    assert output.link.at_rest


def test_a_second_deploy_in_the_pulse_makes_it_longer():
    output = Output(RelayConfig(pulse_time=1.0, repeat_interval=0.125))
    output.open()
    output.deploy(1)
    output.to(0.5625)
    output.deploy(2)
    output.to(3.0)
    fired = [at for at, data in output.written if data == FIRE]
    assert (fired[0], fired[-1]) == (0.0, 1.438)
    assert output.outcomes() == [(1, Outcome.SENT), (2, Outcome.SENT)]


def test_what_the_output_does_not_take_is_tried_again_and_never_told_as_sent():
    output = Output(RelayConfig(repeat_interval=0.125))
    output.open()
    output.takes = False
    output.deploy()
    output.to(0.25)
    assert (output.link.state, output.outcomes()) == (LinkState.LOST, [])
    output.takes = True
    output.to(0.4)
    assert output.outcomes() == [(1, Outcome.SENT)]
    assert output.written[1] == (0.375, FIRE)
    output.to(4.0)
    fired = [at for at, data in output.written if data == FIRE]
    assert (fired[0], fired[-1]) == (0.375, 2.25), "the pulse begins when it is taken"


def test_one_that_cannot_be_written_fails_in_time_and_fires_nothing_later():
    output = Output(RelayConfig(give_up_after=1.5))
    output.deploy()
    output.to(3.0)
    assert output.outcomes() == [(1, Outcome.FAILED)]
    output.open()
    output.to(6.0)
    assert {data for _, data in output.written} == {REST}


def test_one_that_was_ordered_while_the_output_was_away_leaves_once_it_is_back():
    output = Output()
    output.open()
    output.lose()
    assert output.link.state is LinkState.LOST
    output.deploy()
    output.to(1.0)
    assert output.outcomes() == []
    output.open()
    assert output.written[-1] == (1.0, FIRE)
    assert output.outcomes() == [(1, Outcome.SENT)]


def test_an_output_that_comes_back_within_a_pulse_goes_on_with_it():
    output = Output(RelayConfig(pulse_time=1.0))
    output.open()
    output.deploy()
    output.to(0.3)
    output.lose()
    output.to(0.5)
    output.open()
    assert output.written[-1] == (0.5, FIRE)
    output.to(1.2)
    assert output.written[-1][1] == REST


def test_without_force_nothing_leaves():
    output = Output()
    output.open()
    output.deploy(force=False)
    output.to(3.0)
    assert {data for _, data in output.written} == {REST}
    assert output.outcomes() == [(1, Outcome.FAILED)]


@pytest.mark.parametrize(("arm", "success"), [(True, True), (False, False)])
def test_arming_says_that_there_is_none(arm, success):
    output = Output()
    output.open()
    output.link.arm(3, arm, 0, output.t)
    output.turn()
    (end,) = output.ends()
    assert (end.token, end.success) == (3, success)
    output.to(2.0)
    assert {data for _, data in output.written} == {REST}


def test_what_comes_back_is_counted_and_means_nothing():
    output = Output()
    output.open()
    output.link.receive(b"\xa0\x01\x01\xa2deployed", output.t)
    output.to(3.0)
    assert output.link.received == 12
    pictures = [one.status for one in output.events if isinstance(one, ParachuteChanged)]
    assert len(pictures) >= 3, "its picture is told each second"
    assert not any(one.deployed or one.healthy for one in pictures)


STEPS = st.lists(
    st.sampled_from(["open", "lose", "refuse", "take", "deploy", "unforced", "noise", "wait"]),
    max_size=40,
)


@given(STEPS, st.floats(0.01, 3.0))
def test_whatever_happens_it_fires_only_as_ordered_and_every_request_ends_once(steps, wait):
    output, ordered, last = Output(), 0, -100.0
    config = RelayConfig()
    for token, step in enumerate(steps, 1):
        if step == "open":
            output.open()
        elif step == "lose":
            output.lose()
        elif step in ("refuse", "take"):
            output.takes = step == "take"
        elif step in ("deploy", "unforced"):
            ordered += 1
            output.deploy(token, step == "deploy")
            last = output.t - 100.0 if step == "deploy" else last
        elif step == "noise":
            output.link.receive(bytes(range(256)), output.t)
        output.to(output.t - 100.0 + (wait if step == "wait" else 0.01))
        assert output.link.next_deadline() > output.t, "no deadline is left unserved"
    output.to(output.t - 100.0 + 20.0)
    assert len(output.ends()) == ordered
    assert {data for _, data in output.written} <= {FIRE, REST}
    latest = last + config.give_up_after + config.pulse_time + 1e-6
    assert all(at <= latest for at, data in output.written if data == FIRE)
    sent = sum(outcome is Outcome.SENT for _, outcome in output.outcomes())
    assert (output.link.fired > 0) == (sent > 0)
    assert output.link.fired <= sent
