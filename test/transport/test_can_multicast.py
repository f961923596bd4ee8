"""CAN over UDP multicast, with real sockets, and with the driver that the format comes from."""

import gc
import os
import select
import shutil
import subprocess
import sys
from random import randrange

import dronecan
import pytest
from can_bench import (
    FRAMES,
    children,
    multicast_ear,
    multicaster,
    need_multicast_route,
    packet,
    running_can,
)
from dronecan.driver.common import CANFrame
from hypothesis import given
from hypothesis import strategies as st
from loop_bench import descriptors, loop_threads

from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack
from chute_ros.transport.can_address import CanAddress
from chute_ros.transport.can_multicast import CanMulticastWire, is_of_this_host

EXTENDED = 1 << 31


class Bus:
    """A bus that no other test, or run, uses."""

    def __init__(self):
        self.number, self.port = randrange(1, 256), randrange(20000, 32000)
        self.connection = f"mcast:{self.number}:{self.port}"
        self.group = f"239.65.82.{self.number}"

    def wire(self):
        return CanMulticastWire(CanAddress("mcast", str(self.number), self.port))


@pytest.fixture
def bus():
    return Bus()


@pytest.fixture
def stranger(bus):
    with multicaster(bus.group, bus.port) as end:
        yield end


def heard(wire):
    """What comes next."""
    assert select.select(wire.files(), [], [], 20.0)[0]
    return [unpack(data) for data, _ in wire.read(wire.files()[0])]


def test_two_wires_hear_each_other_and_not_themselves(bus, await_until):
    with running_can(bus.connection) as one, running_can(bus.connection) as other:
        for frame in FRAMES:
            one.send_frame(frame)
        await_until(lambda: other.frames == FRAMES, "every frame is heard once, as it was")
        answer = CanFrame(0x123, b"answer")
        other.send_frame(answer)
        await_until(lambda: one.frames, "the answer is heard")
        assert one.frames == [answer], "and nothing that it sent itself"
        assert other.frames == FRAMES
        assert all(stream is None for _, stream in one.link.received)
        assert one.wire.describe() == bus.connection
        assert not one.wire.counts


def test_a_wire_on_another_bus_or_port_hears_nothing(bus, await_until):
    elsewhere = [
        f"mcast:{bus.number % 255 + 1}:{bus.port}",
        f"mcast:{bus.number}:{bus.port + 1}",
    ]
    with (
        running_can(bus.connection) as here,
        running_can(bus.connection) as sender,
        running_can(elsewhere[0]) as first,
        running_can(elsewhere[1]) as second,
    ):
        sender.send_frame(FRAMES[0])
        await_until(lambda: here.frames, "it is heard here")
        for other in (first, second):
            turns = len(other.link.updates)
            await_until(lambda o=other, n=turns: len(o.link.updates) > n, "it had its turn")
            assert not other.frames


def test_the_packet_is_byte_for_byte_that_of_the_format(bus):
    """What pydronecan 1.0.27 sends for CANFrame(0x18040A7B, 01 02 03, extended)."""
    golden = bytes.fromhex("3429 55fa 0000 7b0a0498 010203")
    wire = bus.wire()
    wire.open()
    with multicast_ear(bus.group, bus.port) as ear:
        try:
            wire.write(pack(CanFrame(0x18040A7B, b"\1\2\3")))
            assert ear.recv(100) == golden
        finally:
            wire.close()
    assert packet(0x18040A7B | EXTENDED, b"\1\2\3") == golden


def test_a_frame_goes_both_ways_with_the_driver_that_the_format_comes_from(await_until):
    need_multicast_route()
    # Its port is fixed: only the bus can be one of our own.
    bus = randrange(1, 256)
    before = children()
    driver = dronecan.make_driver(f"mcast:{bus}")
    try:
        with running_can(f"mcast:{bus}") as ours:
            theirs = []

            def asked():
                # The process that does its work takes a while to start, and tells nobody.
                driver.send_frame(CANFrame(0x1E8A7B0A, b"ask", True))
                return ours.frames

            await_until(asked, "its frame is heard")
            assert set(ours.frames) == {CanFrame(0x1E8A7B0A, b"ask")}
            for frame in FRAMES:
                ours.send_frame(frame)
            while len(theirs) < len(FRAMES):
                frame = driver.receive(timeout=20.0)
                assert frame is not None, "our frame is heard"
                theirs.append(CanFrame(frame.id, bytes(frame.data), frame.extended))
            assert theirs == FRAMES
            assert not ours.wire.counts
    finally:
        # Closing it does nothing, and its queues have threads that would wait for each other.
        driver.proc.kill()
        driver.proc.join()
        for queue in (driver.rx_queue, driver.tx_queue):
            queue.cancel_join_thread()
            queue.close()
    assert children() == before


def test_a_bad_packet_is_counted_by_its_kind_and_the_wire_lives(bus, stranger, await_until):
    good = packet(0x123 | EXTENDED, b"good")
    bad = {
        "packets of a wrong length": [b"", good[:9], packet(1, bytes(9)), packet(1, bytes(65))],
        "packets of another kind": [packet(1, b"x", magic=0x2935), b"GET / HTTP/1.1\r\n"],
        "packets with a wrong CRC": [good[:-1] + b"D", good[:-1]],
        "CAN FD frames": [packet(1, bytes(64), flags=1), packet(1, b"", flags=1)],
        "impossible CAN identifiers": [packet(0x800, b"")],
        "error frames": [packet(0x20000040, bytes(8))],
    }
    with running_can(bus.connection) as node:
        for packets in bad.values():
            for one in packets:
                stranger.send(one)
        stranger.send(good)
        await_until(lambda: node.frames, "the good one is heard")
        assert node.frames == [CanFrame(0x123, b"good")]
        assert node.wire.counts == {kind: len(packets) for kind, packets in bad.items()}
        assert [change.is_open for change in node.changes] == [True]


@given(
    st.one_of(
        st.binary(max_size=80),
        st.builds(
            packet,
            st.integers(0, 2**32 - 1),
            st.binary(max_size=66),
            st.sampled_from([0, 0, 1, 2, 0xFFFF]),
        ),
    )
)
def test_any_datagram_is_a_frame_or_counted(data):
    wire = CanMulticastWire(CanAddress("mcast", "0", 1))
    frame = wire._frame(data, "127.0.0.1")
    assert (frame is None) == (sum(wire.counts.values()) == 1)
    if frame is not None:
        found = unpack(frame)
        assert found is not None
        assert int.from_bytes(data[6:10], "little") == int.from_bytes(frame[:4], "little")
        assert data[10:] == found.data


def test_a_flood_is_read_a_bit_at_a_time(bus, stranger):
    wire = bus.wire()
    wire.open()
    try:
        for number in range(100):
            stranger.send(packet(number, b""))
        first = heard(wire)
        assert len(first) <= 64, "the loop comes to its deadlines in between"
        rest = []
        while len(first) + len(rest) < 100:
            rest += heard(wire)
        assert [frame.identifier for frame in first + rest] == list(range(100))
    finally:
        wire.close()


def test_what_another_host_sends_is_not_for_us():
    assert is_of_this_host("127.0.0.1")
    assert is_of_this_host("127.9.9.9")
    assert not is_of_this_host("203.0.113.7")  # reserved for documentation: nobody has it
    wire = CanMulticastWire(CanAddress("mcast", "0", 1))
    assert wire._frame(packet(1, b"x"), "203.0.113.7") is None
    assert wire.counts == {"packets from another host": 1}


def test_closed_and_opened_again_it_leaves_nothing_behind(bus, await_until):
    gc.collect()
    files, threads = descriptors(), loop_threads()
    with running_can(bus.connection) as peer:
        wire = bus.wire()
        for round_ in range(5):
            wire.open()
            assert wire.is_open
            assert len(wire.files()) == 1
            wire.write(pack(CanFrame(round_, b"")))
            wire.close()
            assert not wire.is_open
            assert wire.files() == []
        await_until(lambda: len(peer.frames) == 5, "each opening of it was heard")
        wire.close()
    assert descriptors() == files
    assert loop_threads() == threads


#: What a process does in a network of its own: no route, and loopback down until it is told.
SECLUDED = """
import fcntl, socket, struct, sys, time
from can_bench import FRAMES, CanRunning

def loopback(up):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        request = struct.pack("16sh22x", b"lo", 0x41 if up else 0x40)
        fcntl.ioctl(end, 0x8914, request)

def until(condition, what):
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.002)

one, other = CanRunning("mcast:5:14700"), CanRunning("mcast:5:14700")
for node in (one, other):
    node.loop.start()
try:
    (change,) = one.changes
    assert not change.is_open
    assert "mcast:5:14700 cannot be opened: " in change.text, change.text
    assert "the loopback interface is down" in change.text, change.text
    loopback(True)
    until(lambda: one.wire.is_open and other.wire.is_open, "they are opened, without a route")
    one.send_frame(FRAMES[0])
    until(lambda: other.frames == FRAMES[:1], "the first is heard, once")
    loopback(False)
    one.send_frame(FRAMES[1])
    until(lambda: one.loop.send_errors == 1, "what cannot be sent is counted")
    loopback(True)
    one.send_frame(FRAMES[2])
    until(lambda: len(other.frames) == 2, "it is heard again")
    assert other.frames == [FRAMES[0], FRAMES[2]], other.frames
finally:
    for node in (one, other):
        node.loop.stop()
print("all of it")
"""


def test_without_a_route_and_with_the_interface_down_and_up_again():
    alone = ["unshare", "--user", "--map-root-user", "--net"]
    if not shutil.which("unshare") or subprocess.run([*alone, "true"], check=False).returncode:
        pytest.skip("this system gives no process a network of its own")
    here = os.path.dirname(os.path.abspath(__file__))
    paths = os.pathsep.join([here, *filter(None, sys.path)])
    done = subprocess.run(
        [*alone, sys.executable, "-c", SECLUDED],
        check=False,
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": paths},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "all of it\n"
