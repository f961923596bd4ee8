"""python-can's own multicast as a wire, over real sockets: it hears itself."""

from random import randrange

import can
import msgpack
import pytest
from can_bench import (
    FRAMES,
    children,
    multicaster,
    need_multicast_route,
    opened,
    readers,
    running_can,
)
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.protocol.dronecan.can_frame import CanFrame, unpack
from chute_ros.transport.can_bus import Echoes


@pytest.fixture
def multicast():
    """A group of python-can's multicast, and a port, that no other test, or run, uses."""
    need_multicast_route()
    group = f"239.74.{randrange(1, 255)}.{randrange(1, 255)}"
    return group, randrange(20000, 32000)


def test_two_wires_on_a_multicast_bus_hear_each_other_and_not_themselves(multicast, await_until):
    connection = "udp_multicast:{}:{}".format(*multicast)
    before = children()
    with running_can(connection) as one, running_can(connection) as other:
        for frame in FRAMES:
            one.send_frame(frame)
        await_until(lambda: other.frames == FRAMES, "every frame is heard once, as it was")
        other.send_frame(FRAMES[0])
        await_until(lambda: one.frames == FRAMES[:1], "the same, from the other one")
        one.send_frame(FRAMES[1])
        await_until(lambda: len(other.frames) == len(FRAMES) + 1, "it is heard")
        assert other.frames == [*FRAMES, FRAMES[1]], "its own is not among them"
        assert one.wire.describe() == connection
        assert not one.wire.counts
        assert not readers()
        assert children() == before


def test_of_the_same_frame_one_echo_is_dropped_for_each_that_was_sent(multicast, await_until):
    group, port = multicast
    peer = can.Bus(interface="udp_multicast", channel=group, port=port, hop_limit=0)
    with peer, running_can(f"udp_multicast:{group}:{port}") as node:
        same = can.Message(arbitration_id=0x123, data=b"same")
        for _ in range(2):
            node.send_frame(CanFrame(0x123, b"same"))
        for _ in range(2):
            assert peer.recv(20.0) is not None
        for _ in range(3):
            peer.send(same)
        await_until(lambda: len(node.frames) == 3, "those of another node are heard")
        peer.send(can.Message(arbitration_id=0x124, data=b""))
        await_until(lambda: len(node.frames) == 4, "and nothing else was")
        assert node.frames == [CanFrame(0x123, b"same")] * 3 + [CanFrame(0x124, b"")]


def test_an_echo_is_expected_once_and_for_a_second():
    echoes = Echoes()
    echoes.sent(b"one", 10.0)
    echoes.sent(b"two", 10.1)
    assert echoes.take(b"two", 10.2)
    assert not echoes.take(b"two", 10.2)
    assert not echoes.take(b"other", 10.2)
    assert not echoes.take(b"one", 11.1), "too late: it is another node's"
    echoes.sent(b"one", 20.0)
    assert echoes.take(b"one", 20.9)
    for number in range(10000):
        echoes.sent(b"%d" % number, 30.0)
    assert not echoes.take(b"0", 30.0), "what is kept is bounded"
    assert echoes.take(b"9999", 30.0)


def packed(**values):
    """A frame as the library packs it."""
    frame = {"timestamp": 0.0, "arbitration_id": 1, "is_extended_id": True, "dlc": 0, "data": b""}
    return msgpack.packb(frame | values)


def test_a_bad_packet_is_counted_by_its_kind_and_the_wire_lives(multicast, await_until):
    unpackable = "bad frames: could not unpack received message"
    bad = {
        b"": unpackable,
        b"GET / HTTP/1.1\r\n": unpackable,
        msgpack.packb([1, 2]): unpackable,
        packed(dlc=3): unpackable,
        packed(arbitration_id=1 << 29): unpackable,
        packed(unheard_of=1): unpackable,
        packed(arbitration_id=1.5): "bad frames: TypeError",
        packed(data=bytes(64), dlc=64, is_fd=True): "CAN FD frames",
    }
    expected = {kind: list(bad.values()).count(kind) for kind in bad.values()}
    with running_can("udp_multicast:{}:{}".format(*multicast)) as node:
        with multicaster(*multicast, by_route=True) as stranger:
            for one in bad:
                stranger.send(one)
            stranger.send(packed(arbitration_id=0x7FF, is_extended_id=False))
            await_until(lambda: node.frames, "the good one is heard")
        assert node.frames == [CanFrame(0x7FF, b"", extended=False)]
        assert node.wire.counts == expected
        assert [change.is_open for change in node.changes] == [True]


def test_a_flood_is_read_a_bit_at_a_time(multicast):
    wire = opened("udp_multicast:{}:{}".format(*multicast))
    try:
        with multicaster(*multicast, by_route=True) as stranger:
            for number in range(100):
                stranger.send(packed(arbitration_id=number))
        chunks = [wire.read(wire.files()[0]) for _ in range(2)]
        assert [len(chunk) for chunk in chunks] == [64, 36]
    finally:
        wire.close()
    assert not wire.is_open


def test_any_datagram_is_a_frame_or_counted(multicast):
    wire = opened("udp_multicast:{}:{}".format(*multicast))
    values = st.one_of(st.integers(-1, 2**32), st.floats(), st.booleans(), st.binary(max_size=9))
    names = [
        "arbitration_id",
        "is_extended_id",
        "is_remote_frame",
        "is_error_frame",
        "dlc",
        "data",
    ]
    fields = st.dictionaries(st.sampled_from(names), st.one_of(values, st.none(), st.text()))

    @given(st.one_of(st.binary(max_size=80), fields.map(lambda f: packed(**f))))
    def holds(data):
        wire.counts.clear()
        stranger.send(data)
        frames = wire.read(wire.files()[0])
        assert len(frames) + sum(wire.counts.values()) == 1
        assert all(unpack(frame) is not None for frame, _ in frames)

    try:
        with multicaster(*multicast, by_route=True) as stranger:
            holds()
    finally:
        wire.close()
