"""How the simulated flight computer hears: one token a packet, a pause, a queue of four."""

import pytest
from test_flight_computer import Host

from chute_ros.links.umbilical.simulator.commands import NAMES, CommandReceiver, target_of


def hearing(*packets, until=None):
    """A receiver to which these came, (s, bytes) each, and which was looked at then."""
    one = CommandReceiver(2, lambda text: None)
    for at, data in packets:
        one.packet(data, at)
    if until is not None:
        one.update(until)
    return one


def heard(one):
    return [token for _, token in one.came]


def test_the_commands_are_those_of_the_reference_and_each_has_its_handler():
    expected = "L V KA KD M m S s D d 1 2 3 4 A1 A2 A3 R F f G W I X"
    assert [name.strip("<>") for name in NAMES] == expected.split()
    device = Host().device
    assert {*NAMES} <= {*device.flight.handlers, *device.commands_apart}
    for token in (*NAMES, "<T,42.4419130,-76.4878000>"):
        one = hearing((5.0, token.encode()))
        assert one.came == [(5.0, token)]
        assert one.take() == [token]
        assert one.take() == []
        assert not one.lost, token


# Packets


def test_what_is_glued_or_no_command_is_lost_without_an_answer():
    for data in (b"<KA><L>", b"<L><L>", b"<KA>\n", b"<KA> ", b"x<KA>", b"<<L>"):
        one = hearing((0.0, data))
        assert one.came == [], data
        assert one.lost == {"glued": data.count(b">")}, data
    for data in (b"<ZZ>", b"<ka>", b"<5>", b"<A4>", b"L", b"", b"\xff\x00<"):
        one = hearing((0.0, data))
        assert one.came == [], data
        assert sum(one.lost.values()) == bool(data), data
    one = hearing((0.0, b"x" * 64 + b"<L>"), until=0.2)
    assert heard(one) == ["<L>"], "what is beyond 64 bytes is a packet of its own"


def test_a_heartbeat_is_found_anywhere_but_costs_the_command():
    one = hearing((0.0, b"<H><KA>"), (1.0, b"<KD><H>"))
    assert one.heartbeats == [0.0, 1.0]
    assert one.came == []
    assert one.lost == {"glued": 2}
    one = hearing((0.0, b"<KA>"), (0.03, b"<H>"), (0.06, b"<L>"), until=0.2)
    assert heard(one) == ["<KA>"]
    assert one.heartbeats == [pytest.approx(0.1)]


# The pause


def test_two_commands_within_the_pause_are_taken_in_turn():
    one = hearing((0.0, b"<KA>"), (0.05, b"<L>"))
    assert heard(one) == ["<KA>"]
    assert one.next_deadline() == pytest.approx(0.1)
    one.update(0.2)
    assert one.came == [(0.0, "<KA>"), (0.1, "<L>")], "one that waits alone is heard after it"
    tokens = ["<KA>", "<L>", "<D>", "<d>"]
    apart = [(n * 0.1 + 1e-6, token.encode()) for n, token in enumerate(tokens)]
    assert heard(hearing(*apart, until=1.0)) == tokens, "100 ms apart all come"


def test_two_that_wait_together_are_lost():
    one = hearing((0.0, b"<KA>"), (0.03, b"<M>"), (0.06, b"<S>"), until=0.2)
    assert heard(one) == ["<KA>"]
    assert one.lost == {"glued": 2}
    # What is lost costs a pause too, and only a lone heartbeat does not.
    one = hearing((0.0, b"<ZZ>"), (0.01, b"<M>"), (0.02, b"<S>"), until=1.0)
    assert one.came == []
    one = hearing((0.0, b"<H>"), (0.001, b"<L>"), (0.2, b"<H>"))
    assert one.came == [(0.001, "<L>")]
    assert one.heartbeats == [0.0, 0.2]


# The queue


def test_a_fifth_command_in_the_queue_is_dropped():
    one = hearing(*[(n * 0.2, b"<M>") for n in range(6)])
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


def test_the_numbers_of_a_target():
    for token, floats, target in (
        ("<T,42.4419130,-76.4878000>", 2, (42.441913, -76.4878)),
        ("<T,-90,180>", 2, (-90.0, 180.0)),
        ("<T,1,2,3,4>", 4, (1.0, 2.0, 3.0, 4.0)),
        ("<T,1,2,90.5,4>", 4, None),
        ("<T,1,2>", 4, None),
        ("<T,1,2", 2, None),
        ("<T,1,inf>", 2, None),
    ):
        assert target_of(token, floats) == target, token
