"""Interfaces of python-can as a wire: slcan on pseudo terminals, and those that need no device."""

import fcntl
import gc
import struct
import termios
import threading
from random import randrange

import can
import pytest
from can_bench import FRAMES, children, opened, readers, running_can
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import descriptors
from slcan_adapter import Adapter
from test_serial_users import TAKE_ALL, Program

from chute_ros.protocol.dronecan.can_frame import CanFrame
from chute_ros.transport.can_address import CanAddress
from chute_ros.transport.can_bus import CanBusWire
from chute_ros.transport.wire_events import WireTrouble

#: FRAMES as lines of the LAWICEL protocol.
LINES = [
    b"T18040A7B801020304050607C0",
    b"T1FFFFFFF0",
    b"T00000000100",
    b"t7FF8FFFFFFFFFFFFFFFF",
    b"t0010",
]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "ttyACM0"


@pytest.fixture
def adapter(path):
    one = Adapter(path)
    yield one
    one.unplug()


# -- slcan ----------------------------------------------------------------------------------------


def test_frames_go_both_ways_over_a_serial_adapter(adapter, path, await_until):
    before = children()
    with running_can(f"slcan:{path}", 1_000_000) as node:
        assert node.wire.describe() == f"slcan:{path} at 1000000 bit/s"
        assert adapter.channel_open.wait(20.0)
        await_until(lambda: b"S8" in adapter.commands, "the bitrate is set")
        adapter.deliver(*LINES)
        await_until(lambda: node.frames == FRAMES, "every frame is heard as it was")
        assert all(stream is None for _, stream in node.link.received)
        for frame in FRAMES:
            node.send_frame(frame)
        await_until(lambda: adapter.sent == LINES, "every frame is sent as it is")
        assert not node.wire.counts
        assert node.loop.send_errors == 0
        assert children() == before, "no process is started for it"


def test_without_a_bitrate_the_adapter_keeps_its_own(adapter, path):
    with running_can(f"slcan:{path}"):
        assert adapter.channel_open.wait(20.0)
    assert not [command for command in adapter.commands if command.startswith(b"S")]


def test_a_remote_frame_is_one_on_the_other_side(adapter, path, await_until):
    frames = [CanFrame(0x123, b"", extended=False, remote=True), CanFrame(5, b"", remote=True)]
    with running_can(f"slcan:{path}") as node:
        adapter.deliver(b"r1230", b"R000000050")
        await_until(lambda: node.frames == frames, "they are heard as what they are")
        for frame in frames:
            node.send_frame(frame)
        await_until(lambda: adapter.sent == [b"r1230", b"R000000050"], "they are sent so")


def test_a_line_that_is_no_frame_is_counted_by_its_kind_and_the_wire_lives(
    adapter, path, await_until
):
    bad = {
        b"T123": "bad frames: IndexError",
        b"T0000000X0": "bad frames: ValueError",
        b"t12": "bad frames: IndexError",
        b"T00000001801020": "bad frames: ValueError",
        # Cut off behind a whole byte: the frame would be another, shorter one.
        b"T00000001801": "frames of a wrong length",
        b"T000000019" + b"00" * 9: "frames of a wrong length",
        b"T200000000": "impossible CAN identifiers",
        b"t8000": "impossible CAN identifiers",
        b"d1230": "CAN FD frames",
        b"B000000019" + b"00" * 12: "CAN FD frames",
        b"\xff\xfe": "bad frames: Could not read from serial device",
    }
    expected = {kind: list(bad.values()).count(kind) for kind in bad.values()}
    with running_can(f"slcan:{path}") as node:
        adapter.deliver(b"V1013", b"", b"\a", b"z", *bad)
        await_until(lambda: node.wire.counts == expected, "they are counted")
        adapter.deliver(*LINES)
        await_until(lambda: node.frames == FRAMES, "what comes after them is heard")
        assert [change.is_open for change in node.changes] == [True]


def test_a_frame_on_the_heels_of_garbage_is_heard(adapter, path, await_until):
    """In one piece with it, as a serial port delivers what came in one go."""
    with running_can(f"slcan:{path}") as node:
        adapter.deliver(b"\xff\xfe\r" + LINES[0])
        await_until(lambda: node.frames == FRAMES[:1], "it is heard")
        assert node.wire.counts.total() == 1


def test_an_adapter_that_delivers_nothing_but_garbage_is_opened_again(adapter, path, await_until):
    with running_can(f"slcan:{path}") as node:
        adapter.deliver(*[b"T123"] * 150)
        await_until(lambda: len(node.changes) == 3, "it is closed, and opened again")
        assert [change.is_open for change in node.changes] == [True, False, True]
        assert "only failures, the last one: " in node.changes[1].text
        await_until(lambda: adapter.commands[-2:] == [b"C", b"O"], "the adapter has seen it")
        adapter.deliver(*LINES)
        await_until(lambda: node.frames == FRAMES, "it is received again")


def test_unplugged_and_plugged_in_again_at_the_same_path(adapter, path, await_until):
    with running_can(f"slcan:{path}", 500_000) as node:
        adapter.deliver(LINES[0])
        await_until(lambda: node.frames == FRAMES[:1], "it is heard")
        adapter.unplug()
        await_until(lambda: not node.changes[-1].is_open, "the hang-up is told")
        assert f"slcan:{path} at 500000 bit/s: " in node.changes[-1].text
        assert "trying again each 0.5 s" in node.changes[-1].text
        assert None in node.link.ended
        assert not readers()
        node.send_frame(FRAMES[0])
        await_until(lambda: node.loop.send_errors == 1, "what cannot be sent is counted")
        again = Adapter(path)
        try:
            await_until(lambda: node.wire.is_open, "it is opened again")
            assert again.channel_open.wait(20.0)
            assert b"S6" in again.commands, "and is told its bitrate again"
            again.deliver(LINES[1])
            await_until(lambda: node.frames == FRAMES[:2], "it is received again")
            node.send_frame(FRAMES[2])
            await_until(lambda: again.sent == LINES[2:3], "it is sent to again")
        finally:
            again.unplug()


def test_a_second_reader_of_the_adapters_port_is_named_and_the_bus_is_kept(
    adapter, path, await_until
):
    with running_can(f"slcan:{path}") as node:
        other = Program(TAKE_ALL, path)
        try:

            def told():
                adapter.deliver(LINES[0])
                return [one for one in node.delivered if isinstance(one, WireTrouble)]

            await_until(told, "it is told")
            (trouble,) = told()
            assert "has a second reader, which takes part of the data" in trouble.text
            assert other.name in trouble.text
            assert [change.is_open for change in node.changes] == [True]
        finally:
            other.end()


def test_a_path_that_is_not_there_is_said_once_and_tried_again(path, await_until, capfd):
    with running_can(f"slcan:{path}") as node:
        (change,) = node.changes
        assert not change.is_open
        assert f"slcan:{path} cannot be opened: " in change.text
        assert "No such file or directory" in change.text
        late = Adapter(path)
        try:
            await_until(lambda: node.wire.is_open, "it is opened once it is there")
        finally:
            late.unplug()
    assert capfd.readouterr() == ("", "")


def test_a_bitrate_that_the_adapter_does_not_know_is_said_with_those_it_does(adapter, path):
    with running_can(f"slcan:{path}", 123) as node:
        (change,) = node.changes
        assert f"slcan:{path} at 123 bit/s cannot be opened: Invalid bitrate" in change.text
        assert "1000000" in change.text


def test_an_adapter_that_takes_nothing_does_not_hold_up_the_loop(adapter, path, await_until):
    with running_can(f"slcan:{path}") as node:
        assert adapter.channel_open.wait(20.0)
        adapter.stop_listening()

        def send_until_full():
            for _ in range(20):
                node.send_frame(FRAMES[0])
            turn = len(node.link.updates)
            await_until(lambda: len(node.link.updates) > turn, "the loop goes on")
            return node.loop.send_errors

        await_until(send_until_full, "what does not fit is counted")
        adapter.deliver(LINES[0])
        await_until(lambda: FRAMES[0] in node.frames, "receiving goes on")
        assert node.wire.is_open


def test_a_flood_that_nobody_reads_does_not_keep_the_wire_from_closing(adapter, path, await_until):
    wire = opened(f"slcan:{path}")
    assert adapter.channel_open.wait(20.0)
    flood = threading.Thread(target=adapter.deliver, args=LINES[:1] * 3000)
    flood.start()
    sizes = []

    def stuck():
        """Nothing more comes: the reading thread waits until somebody takes what it has."""
        sizes.append(struct.unpack("i", fcntl.ioctl(wire.files()[0], termios.FIONREAD, bytes(4))))
        return len(sizes) > 20 and sizes[-1] == sizes[-20] > (0,)

    await_until(stuck, "the thread waits")
    assert len(wire.read(wire.files()[0])) == 64, "no more than a burst at once"
    wire.close()
    assert not readers()
    again = opened(f"slcan:{path}")
    try:
        # What is left is taken, so that the flood can end.
        await_until(lambda: again.read(again.files()[0]) or not flood.is_alive(), "it is heard")
        await_until(lambda: not (again.read(again.files()[0]) or flood.is_alive()), "it ends")
    finally:
        again.close()
        flood.join()


def test_closed_and_opened_again_it_leaves_nothing_behind(adapter, path):
    opened(f"slcan:{path}").close()  # what the library keeps is there from then on
    gc.collect()
    before = descriptors()
    for _ in range(3):
        wire = opened(f"slcan:{path}")
        assert len(wire.files()) == 1
        assert len(readers()) == 1
        wire.close()
        assert not wire.is_open
        assert wire.files() == []
        wire.close()
        with pytest.raises(OSError, match="Invalid bitrate"):
            opened(f"slcan:{path}", 123)
    with pytest.raises(OSError, match="No such file"):
        opened(f"slcan:{path}.not")
    assert readers() == []
    assert descriptors() == before


def test_after_any_lines_the_wire_lives(adapter, path, await_until):
    line = st.from_regex(rb"[trTRdDbBx][0-9A-Fa-f ]{0,30}")
    last = CanFrame(0x7FF, b"last one", extended=False)

    @settings(max_examples=40)
    @given(st.lists(st.one_of(st.binary(max_size=30), line)))
    def holds(lines):
        adapter.deliver(*lines)

        def heard():
            # More than once: what follows a line that cannot be decoded may be lost.
            adapter.deliver(b"t7FF8" + last.data.hex().encode())
            return last in node.frames

        await_until(heard, "a frame is heard")
        assert len(node.changes) == 1
        node.link.received.clear()

    with running_can(f"slcan:{path}") as node:
        holds()


# -- interfaces without a descriptor --------------------------------------------------------------


def test_an_interface_without_a_descriptor_is_read_as_well(await_until):
    channel = f"chute_ros {randrange(1 << 30)}"
    peer = can.Bus(interface="virtual", channel=channel)
    with peer, running_can(f"virtual:{channel}") as node:
        peer.send(can.Message(arbitration_id=0x40, is_error_frame=True, is_extended_id=False))
        peer.send(can.Message(arbitration_id=1, data=bytes(12), is_fd=True))
        peer.send(can.Message(arbitration_id=0x123, data=b"here"))
        # Only Linux's identifiers of error frames are known to us: it might say bus-off.
        expected = [CanFrame(0, b"", extended=False, error=True), CanFrame(0x123, b"here")]
        await_until(lambda: node.frames == expected, "it is heard")
        assert node.wire.counts == {"CAN FD frames": 1}
        node.send_frame(FRAMES[0])
        message = peer.recv(20.0)
        assert (message.arbitration_id, bytes(message.data)) == (0x18040A7B, FRAMES[0].data)
        assert message.is_extended_id


# -- interfaces that are not there ----------------------------------------------------------------


def test_socketcan_without_its_interface_is_said_in_one_line_and_tried_again(await_until, capfd):
    with running_can("socketcan:nocan7", 500_000) as node:
        turns = len(node.link.updates)
        await_until(lambda: len(node.link.updates) > turns + 6, "it has tried again")
        (change,) = node.changes
        assert not change.is_open
        text = change.text
        assert "socketcan:nocan7 at 500000 bit/s cannot be opened: " in text
        advice = ["ip link set nocan7 up type can bitrate 500000", "modprobe can-raw"]
        assert any(one in text for one in advice)
        assert "\n" not in text
        assert "trying again each 0.5 s" in text
    assert capfd.readouterr() == ("", ""), "the library does not repeat it"


def test_a_driver_that_is_not_installed_is_said_in_one_line(capfd):
    wire = CanBusWire(CanAddress("neousys", "0"))
    with pytest.raises(OSError) as caught:
        wire.open()
    assert str(caught.value)
    assert "\n" not in str(caught.value)
    assert not wire.is_open
    assert capfd.readouterr() == ("", "")
