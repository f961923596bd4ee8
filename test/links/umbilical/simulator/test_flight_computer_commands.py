"""How the simulated flight computer hears: one token a packet, a pause, a queue of four."""

import re
from pathlib import Path

import pytest
from test_flight_computer import Host

from chute_ros.links.umbilical.simulator.commands import NAMES, CommandReceiver, target_of


def receiver():
    return CommandReceiver(2, lambda text: None)


def heard(one):
    return [token for _, token in one.came]


@pytest.mark.parametrize("token", [*NAMES, "<T,42.4419130,-76.4878000>"])
def test_each_command_of_the_reference_is_heard_alone_in_its_packet(token):
    one = receiver()
    one.packet(token.encode(), 5.0)
    assert one.came == [(5.0, token)]
    assert one.take() == [token]
    assert one.take() == []
    assert not one.lost


def test_the_commands_are_those_of_the_reference():
    expected = "L V KA KD M m S s D d 1 2 3 4 A1 A2 A3 R F f G W I X"
    assert [name.strip("<>") for name in NAMES] == expected.split()


@pytest.mark.parametrize("token", NAMES)
def test_each_command_has_its_handler(token):
    device = Host().device
    assert token in {**device.flight.handlers, **device.commands_apart}


@pytest.mark.parametrize("token", [*NAMES, "<T,", "<H>"])
def test_each_command_is_named_in_a_story_of_its_own(token):
    """Beside this file's table: a test that says what the command does."""
    files = Path(__file__).parent.glob("test_flight_computer*.py")
    stories = "".join(f.read_text() for f in files if f.name != Path(__file__).name)
    in_a_loop = re.fullmatch("<A?[1-4]>", token)
    assert in_a_loop or token in stories


# Packets


@pytest.mark.parametrize("data", [b"<KA><L>", b"<L><L>", b"<KA>\n", b"<KA> ", b"x<KA>", b"<<L>"])
def test_what_is_glued_is_lost(data):
    one = receiver()
    one.packet(data, 0.0)
    assert one.came == []
    assert one.lost == {"glued": data.count(b">")}


def test_a_heartbeat_is_found_anywhere_but_costs_the_command():
    one = receiver()
    one.packet(b"<H><KA>", 0.0)
    one.packet(b"<KD><H>", 1.0)
    assert one.heartbeats == [0.0, 1.0]
    assert one.came == []
    assert one.lost == {"glued": 2}


@pytest.mark.parametrize("data", [b"<ZZ>", b"<ka>", b"<5>", b"<A4>", b"L", b"", b"\xff\x00<"])
def test_what_is_no_command_is_lost_without_an_answer(data):
    one = receiver()
    one.packet(data, 0.0)
    assert one.came == []
    assert sum(one.lost.values()) == bool(data)


def test_a_packet_has_64_bytes():
    one = receiver()
    one.packet(b"x" * 64 + b"<L>", 0.0)
    one.update(0.2)
    assert heard(one) == ["<L>"], "the rest is a packet of its own"


# The pause


def test_two_commands_within_the_pause_are_taken_in_turn():
    one = receiver()
    one.packet(b"<KA>", 0.0)
    one.packet(b"<L>", 0.05)
    assert heard(one) == ["<KA>"]
    assert one.next_deadline() == pytest.approx(0.1)
    one.update(0.2)
    assert one.came == [(0.0, "<KA>"), (0.1, "<L>")], "one that waits alone is heard after it"


def test_two_that_wait_together_are_lost():
    one = receiver()
    one.packet(b"<KA>", 0.0)
    one.packet(b"<M>", 0.03)
    one.packet(b"<S>", 0.06)
    one.update(0.2)
    assert heard(one) == ["<KA>"]
    assert one.lost == {"glued": 2}


def test_a_heartbeat_that_waits_with_a_command_costs_it():
    one = receiver()
    one.packet(b"<KA>", 0.0)
    one.packet(b"<H>", 0.03)
    one.packet(b"<L>", 0.06)
    one.update(0.2)
    assert heard(one) == ["<KA>"]
    assert one.heartbeats == [pytest.approx(0.1)]


def test_after_a_lone_heartbeat_there_is_no_pause():
    one = receiver()
    one.packet(b"<H>", 0.0)
    one.packet(b"<L>", 0.001)
    one.packet(b"<H>", 0.2)
    assert one.came == [(0.001, "<L>")]
    assert one.heartbeats == [0.0, 0.2]


def test_what_is_lost_costs_a_pause_too():
    one = receiver()
    one.packet(b"<ZZ>", 0.0)
    one.packet(b"<M>", 0.01)
    one.packet(b"<S>", 0.02)
    one.update(1.0)
    assert one.came == []


def test_commands_100_ms_apart_all_come():
    one = receiver()
    tokens = ["<KA>", "<L>", "<D>", "<d>"]
    for n, token in enumerate(tokens):
        one.packet(token.encode(), n * 0.1 + 1e-6)
    one.update(1.0)
    assert heard(one) == tokens


# The queue


def test_a_fifth_command_in_the_queue_is_dropped():
    one = receiver()
    for n in range(6):
        one.packet(b"<M>", n * 0.2)
    assert heard(one) == ["<M>"] * 4
    assert one.lost == {"busy": 2}
    assert len(one.take()) == 4
    one.packet(b"<M>", 2.0)
    assert len(one.take()) == 1


def test_the_flight_loop_takes_what_is_queued_at_its_next_turn():
    host = Host()
    host.run(0.02)
    host.device.receive(b"<M>", host.now, "usb")
    assert host.device.flight.flags["mav_open"] == 0
    host.run(0.05)
    assert host.device.flight.flags["mav_open"] == 1


def test_the_device_reports_what_it_lost():
    host = Host()
    host.send("<KA><L>")
    host.send("<ZZ>")
    assert "lost b'<KA><L>': glued" in host.log
    assert "lost b'<ZZ>': unknown" in host.log


# The target command


@pytest.mark.parametrize(
    ("token", "floats", "target"),
    [
        ("<T,42.4419130,-76.4878000>", 2, (42.441913, -76.4878)),
        ("<T,-90,180>", 2, (-90.0, 180.0)),
        ("<T,1,2,3,4>", 4, (1.0, 2.0, 3.0, 4.0)),
        ("<T,1,2,90.5,4>", 4, None),
        ("<T,1,2>", 4, None),
        ("<T,1,2", 2, None),
        ("<T,1,inf>", 2, None),
    ],
)
def test_the_numbers_of_a_target(token, floats, target):
    assert target_of(token, floats) == target
