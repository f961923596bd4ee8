"""A serial port as a wire, on pseudo terminals."""

import os
import tty

import pytest
from loop_bench import point, running


class Device:
    """The far end of a serial cable, plugged in at a path."""

    def __init__(self, path):
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.path = path
        point(path, os.ttyname(slave))
        os.close(slave)
        self.open = True

    def read(self, count):
        data = b""
        while len(data) < count:
            data += os.read(self.master, count - len(data))
        return data

    def unplug(self):
        if self.open:
            self.open = False
            # The name goes first: its number is free for any other process from then on.
            self.path.unlink()
            os.close(self.master)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "ttyUSB0"


@pytest.fixture
def device(path):
    one = Device(path)
    yield one
    one.unplug()


def test_bytes_go_both_ways_unchanged(device, path, await_until):
    every_byte = bytes(range(256))
    with running(f"serial:{path}:115200") as node:
        os.write(device.master, every_byte)
        await_until(lambda: node.link.heard() == every_byte, "every byte is heard as it was")
        assert all(stream is not None for _, stream in node.link.received)
        node.send(every_byte)
        assert device.read(256) == every_byte
        assert node.wire.describe() == f"serial:{path}:115200"


def test_unplugged_and_plugged_in_again_at_the_same_path(device, path, await_until):
    with running(f"serial:{path}") as node:
        os.write(device.master, b"before")
        await_until(lambda: node.link.heard() == b"before", "it is heard")
        device.unplug()
        await_until(lambda: not node.changes[-1].is_open, "the hang-up is told")
        assert f"serial:{path}:57600" in node.changes[-1].text
        assert "trying again each 0.5 s" in node.changes[-1].text
        assert None in node.link.ended, "what was half received does not continue"
        again = Device(path)
        try:
            await_until(lambda: node.wire.is_open, "it is opened again")
            os.write(again.master, b" after")
            await_until(lambda: node.link.heard() == b"before after", "it is heard again")
            streams = {stream for _, stream in node.link.received}
            assert len(streams) == 2, "what comes now is a new stream"
            node.send(b"command")
            assert again.read(7) == b"command"
        finally:
            again.unplug()


def test_a_path_that_is_not_there_is_said_clearly_and_tried_again(path, await_until):
    with running(f"serial:{path}") as node:
        (change,) = node.changes
        assert not change.is_open
        assert str(path) in change.text
        assert "No such file or directory" in change.text
        late = Device(path)
        try:
            await_until(lambda: node.wire.is_open, "it is opened once it is there")
        finally:
            late.unplug()


def test_a_port_in_use_is_not_shared(device, path, await_until):
    with running(f"serial:{path}") as second_owner_to_be:
        await_until(lambda: second_owner_to_be.wire.is_open, "the first has it")
        with running(f"serial:{path}") as intruder:
            (change,) = intruder.changes
            assert not change.is_open
            assert "exclusively lock" in change.text
            os.write(device.master, b"for the owner")
            await_until(
                lambda: second_owner_to_be.link.heard() == b"for the owner", "the owner hears it"
            )
            assert intruder.link.received == []


def test_what_is_no_serial_port_is_said_clearly(tmp_path):
    file = tmp_path / "notes.txt"
    file.write_text("no port")
    with running(f"serial:{file}") as node:
        (change,) = node.changes
        assert not change.is_open
        assert str(file) in change.text
    assert file.read_text() == "no port"


def test_a_device_that_takes_nothing_does_not_hold_up_the_loop(device, path, await_until):
    with running(f"serial:{path}") as node:
        for _ in range(64):
            node.send(bytes(4096))  # a pseudo terminal holds some kilobytes
        await_until(lambda: node.loop.send_errors, "what does not fit is counted")
        os.write(device.master, b"still heard")
        await_until(lambda: node.link.heard() == b"still heard", "receiving goes on")
        assert node.wire.is_open
