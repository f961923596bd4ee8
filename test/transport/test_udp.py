"""UDP as a wire, over real sockets on loopback."""

import contextlib
import socket

import pytest
from loop_bench import LOCAL, Running, descriptors, running, udp

from chute_ros.transport.address import Address
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.tcp import GIVE_BACK_AFTER
from chute_ros.transport.udp import MOST_PEERS, UdpWire


def test_listening_hears_a_datagram_and_answers_its_sender(await_until):
    with running(f"udpin:{LOCAL}:0") as node, udp() as device:
        node.link.answer = lambda data: b"answer to " + data
        device.sendto(b"hello", (LOCAL, node.port))
        assert device.recv(100) == b"answer to hello"
        assert node.link.received == [(b"hello", None)]


def test_sending_out_hears_what_comes_back():
    with udp() as device, running(f"udpout:{LOCAL}:{device.getsockname()[1]}") as node:
        node.link.answer = lambda data: b"thanks for " + data
        node.send(b"knock")
        data, peer = device.recvfrom(100)
        assert data == b"knock"
        device.sendto(b"this", peer)
        assert device.recv(100) == b"thanks for this"


def test_a_pair_listens_on_one_port_and_sends_to_another():
    ear = udp()
    pair = f"udppair:{LOCAL}:0:{LOCAL}:{ear.getsockname()[1]}"
    with ear, udp() as mouth, running(pair) as node:
        node.link.answer = lambda data: b"heard " + data
        mouth.sendto(b"one way", (LOCAL, node.port))
        data, sender = ear.recvfrom(100)
        assert data == b"heard one way"
        # It is sent from a socket of its own: nothing that answers it there is listened to.
        assert sender[1] != node.port


def test_everyone_who_was_heard_is_answered():
    with running(f"udpin:{LOCAL}:0") as node, udp() as first, udp() as second:
        node.link.answer = lambda data: data
        for device in (first, second):
            device.sendto(b"here", (LOCAL, node.port))
            assert device.recv(100) == b"here"
        assert first.recv(100) == b"here"  # the answer to the second one
        node.send(b"to all")
        assert [device.recv(100) for device in (first, second)] == [b"to all", b"to all"]


FRAME, NOISE = b"frame", b"noise"


@pytest.fixture
def server():
    """A listening wire, and more devices than are answered."""
    wire = UdpWire(Address("udpin", LOCAL, 0))
    wire.open()
    peers = [udp() for _ in range(MOST_PEERS + 4)]
    yield wire, peers
    wire.close()
    for peer in peers:
        peer.close()


def says(wire, data, now, *peers):
    """These send data, and the protocol takes it: one after the other."""
    here = (LOCAL, int(wire.describe().split(":")[2]))
    for peer in peers:
        peer.sendto(data, here)
    taken = 0
    while taken < len(peers):  # loopback delivers at once, or almost
        for chunk, stream in wire.read(wire.files()[0]):
            taken += 1
            wire.data_heard(stream, chunk == FRAME, now)


def answered(wire, peers):
    """Which of them hear what is written."""
    wire.write(b"to all")
    heard = []
    for number, peer in enumerate(peers):
        peer.settimeout(0.05)
        with contextlib.suppress(TimeoutError):
            assert peer.recv(100) == b"to all"
            heard.append(number)
    return heard


def test_garbage_from_many_ports_takes_no_place_and_is_not_answered(server):
    wire, peers = server
    says(wire, FRAME, 0.0, peers[0])
    # In one read as well.
    says(wire, NOISE, 60.0, *peers[2:])
    assert answered(wire, peers) == [0]
    says(wire, FRAME, 60.0, peers[1])
    # One damaged datagram of a known device takes its place from nobody.
    says(wire, NOISE, 60.1, peers[1])
    assert answered(wire, peers) == [0, 1]


def test_who_sends_frames_keeps_its_place_and_who_was_silent_longest_gives_way(server):
    wire, peers = server
    says(wire, FRAME, 0.0, *peers[:MOST_PEERS])
    # Others come with frames as well, and more often.
    for second in range(1, 10):
        says(wire, FRAME, float(second), peers[0], *peers[MOST_PEERS:])
    assert answered(wire, peers) == list(range(MOST_PEERS))
    # All but the first have been silent for long.
    says(wire, FRAME, 0.0 + GIVE_BACK_AFTER, peers[MOST_PEERS], peers[0])
    assert answered(wire, peers) == [0, *range(2, MOST_PEERS + 1)]


def test_only_those_are_answered_whose_frames_the_protocol_takes(await_until):
    one = Running(f"udpin:{LOCAL}:0")
    one.loop.stop()

    def frames():
        return sum(data == FRAME for data, _ in one.link.received)

    one.loop = WireLoop(one.link, one.wire, one.delivered.extend, frames=frames)
    one.loop.start()
    try:
        with udp() as device, udp() as stranger:
            device.sendto(FRAME, (LOCAL, one.port))
            stranger.sendto(NOISE, (LOCAL, one.port))
            await_until(lambda: len(one.link.received) == 2, "both are heard")
            one.send(b"to you")
            assert device.recv(100) == b"to you"
            stranger.settimeout(0.05)
            with pytest.raises(TimeoutError):
                stranger.recv(100)
    finally:
        one.loop.stop()


def test_nobody_is_there_to_hear_and_later_somebody_is(await_until):
    with udp() as gone:
        port = gone.getsockname()[1]
    with running(f"udpout:{LOCAL}:{port}") as node:
        for number in range(5):
            node.send(b"into the void %d" % number)
        await_until(lambda: len(node.link.updates) > 2, "the loop goes on")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as late:
            late.bind((LOCAL, port))
            late.settimeout(20.0)
            node.send(b"now")
            assert late.recv(100) == b"now"
        assert [change.is_open for change in node.changes] == [True]


def test_an_unreachable_peer_costs_its_own_frame_only(await_until):
    with running(f"udpin:{LOCAL}:0") as node, udp() as gone, udp() as here:
        for device in (gone, here):
            device.sendto(b"x", (LOCAL, node.port))
        await_until(lambda: len(node.link.received) == 2, "both are heard")
        # An address to which this host has no right to send fails in sendto itself.
        node.wire._peers = {("255.255.255.255", 9): 0.0, **node.wire._peers}
        gone.close()
        node.send(b"first")
        node.send(b"second")
        assert [here.recv(100), here.recv(100)] == [b"first", b"second"]
        await_until(lambda: node.loop.send_errors == 2, "the failures are counted")
        assert node.wire.is_open


def test_a_large_datagram_is_sent_whole_or_counted(await_until):
    with udp() as device, running(f"udpout:{LOCAL}:{device.getsockname()[1]}") as node:
        node.send(bytes(100_000))
        node.send(b"small")
        assert device.recv(100) == b"small"
        assert node.loop.send_errors == 1


def test_a_busy_port_is_said_once_and_taken_when_it_is_free(await_until):
    holder = udp()
    port = holder.getsockname()[1]
    with running(f"udpin:{LOCAL}:{port}") as node:
        change = node.changes[0]
        assert not change.is_open
        assert f"udpin:{LOCAL}:{port} cannot be opened" in change.text
        assert "Address already in use" in change.text
        assert "trying again each 0.5 s" in change.text
        before = len(node.link.updates)
        await_until(lambda: len(node.link.updates) > before + 6, "it has tried again")
        assert len(node.changes) == 1, "the same failure is said once"
        holder.close()
        await_until(lambda: node.changes[-1].is_open, "the port is taken")


def test_a_name_that_does_not_resolve_leaves_no_descriptor():
    wire = UdpWire(Address("udpout", "no-such-host.invalid", 14550))
    before = descriptors()
    with pytest.raises(OSError):
        wire.open()
    assert descriptors() == before
    assert not wire.is_open
