"""The device's end of a serial cable, as a real pseudo terminal."""

import os
import select
import time

import pytest
import serial

from chute_ros.sim.pty_wire import PtyWire


@pytest.fixture
def link(tmp_path):
    return tmp_path / "ttyACM0"


@pytest.fixture
def wire(link):
    one = PtyWire(str(link))
    one.open()
    yield one
    one.close()


@pytest.fixture
def node(wire, link):
    with serial.Serial(str(link), 115200, timeout=20.0, exclusive=True) as port:
        yield port


def read(wire):
    """The next packet."""
    (file,) = wire.files()
    assert select.select([file], [], [], 20.0)[0], "something comes"
    return wire.read(file)


def test_bytes_go_both_ways_unchanged(wire, node):
    every_byte = bytes(range(256))
    for start in range(0, 256, 64):
        wire.write(every_byte[start : start + 64])
    assert node.read(256) == every_byte
    node.write(b"<KA>\r\n\x03\x00")
    ((data, stream),) = read(wire)
    assert data == b"<KA>\r\n\x03\x00"
    assert stream is not None


def test_a_read_is_one_packet_of_64_bytes(wire, node):
    node.write(b"x" * 100)
    parts = []
    while sum(map(len, parts)) < 100:
        parts += [data for data, _ in read(wire)]
    assert len(parts[0]) == 64
    (file,) = wire.files()
    assert wire.read(file) == [], "nothing more is no end"


def test_it_is_described_by_the_path_that_others_open(wire, link):
    assert wire.describe() == f"pty:{wire.path}"
    assert os.readlink(link) == wire.path


def test_without_a_link_the_path_does(await_until):
    wire = PtyWire()
    wire.open()
    try:
        with serial.Serial(wire.path, timeout=20.0) as node:
            wire.write(b"hello")
            assert node.read(5) == b"hello"
    finally:
        wire.close()
    assert (wire.path, wire.files(), wire.is_open) == ("", [], False)


def test_a_node_that_closes_and_opens_again_is_no_hang_up(wire, link):
    for _ in range(3):
        with serial.Serial(str(link), timeout=20.0, exclusive=True) as node:
            node.write(b"<H>")
            assert read(wire)[0][0] == b"<H>"
            wire.write(b"line\n")
            assert node.readline() == b"line\n"
        assert wire.read(wire.files()[0]) == []
        assert wire.is_open


def test_closing_is_a_pulled_cable_and_the_link_is_gone(wire, node, link):
    files = [wire._master, wire._slave]
    wire.close()
    assert not os.path.lexists(link)
    with pytest.raises((OSError, serial.SerialException)):
        node.read(1)
    for file in files:
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(file)
    wire.close()


def test_plugged_in_again_it_is_at_the_same_link_as_another_stream(wire, link):
    with serial.Serial(str(link)) as node:
        node.write(b"one")
        ((_, before),) = read(wire)
    wire.close()
    wire.open()
    with serial.Serial(str(link)) as node:
        node.write(b"two")
        ((data, after),) = read(wire)
    assert data == b"two"
    assert before != after


def test_opening_twice_opens_once(wire):
    path = wire.path
    wire.open()
    assert wire.path == path


def test_what_nobody_reads_is_dropped_at_once(wire, link):
    started = time.monotonic()

    def flood():
        for _ in range(100_000):
            wire.write(b"x" * 64)

    with pytest.raises(BlockingIOError):
        flood()
    assert time.monotonic() - started < 20.0
    assert wire.is_open
    with serial.Serial(str(link), timeout=20.0) as node:
        node.reset_input_buffer()
        wire.write(b"\nagain\n")
        assert b"again\n" in (node.readline(), node.readline())


def test_the_link_replaces_an_old_one_without_a_gap(link, tmp_path):
    link.symlink_to("/dev/null")
    wire = PtyWire(str(link))
    wire.open()
    assert os.readlink(link) == wire.path
    assert os.listdir(tmp_path) == [link.name], "nothing half made is left"
    wire.close()
    assert os.listdir(tmp_path) == []


def test_a_link_that_points_elsewhere_by_now_is_left_alone(wire, link):
    link.unlink()
    link.symlink_to("/dev/null")
    wire.close()
    assert os.readlink(link) == "/dev/null"


def test_what_is_no_link_is_not_replaced(link):
    link.write_text("notes")
    wire = PtyWire(str(link))
    with pytest.raises(FileExistsError, match="is no symbolic link"):
        wire.open()
    assert not wire.is_open
    assert link.read_text() == "notes"


def test_a_link_in_a_folder_that_is_not_there_is_told(tmp_path):
    wire = PtyWire(str(tmp_path / "no" / "link"))
    with pytest.raises(FileNotFoundError):
        wire.open()
    assert not wire.is_open
