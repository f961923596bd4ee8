"""A serial port as a wire, on pseudo terminals."""

import contextlib
import os
import tty
from types import SimpleNamespace

import pytest
from loop_bench import point, running

from chute_ros.transport import serial_wire

#: The user "nobody".
NOBODY = 65534


@contextlib.contextmanager
def as_nobody():
    """Without the rights of root, if that is who runs the tests."""
    before = os.geteuid()
    if before == 0:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(before)


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
        assert "no such port, is it plugged in?" in change.text
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
            assert "the port is in use by another program" in change.text
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
        assert f"{file} is no serial port" in change.text
    assert file.read_text() == "no port"


def test_a_port_that_may_not_be_opened_says_what_to_do(device, path):
    os.chmod(os.path.realpath(path), 0o600)
    os.chmod(path.parent, 0o755)
    with as_nobody(), running(f"serial:{path}") as node:
        (change,) = node.changes
    assert not change.is_open
    assert "permission denied: add yourself to the group of the port" in change.text
    assert change.text.count("\n") == 0


@pytest.fixture
def plugged_in(monkeypatch):
    """USB ports that the machine seems to have: (device, vendor, product, serial number)."""
    ports = []

    def comports():
        names = ("device", "vid", "pid", "serial_number")
        return [SimpleNamespace(**dict(zip(names, port, strict=True))) for port in ports]

    monkeypatch.setattr(serial_wire.list_ports, "comports", comports)
    return ports


def test_a_port_is_found_by_its_usb_ids_wherever_it_comes_back(
    plugged_in, device, path, await_until
):
    with running("usb:c0de:cafe") as node:
        (change,) = node.changes
        assert "no such USB device is plugged in (there is no serial port here)" in change.text
        plugged_in.append(("/dev/ttyS0", None, None, None))
        plugged_in.append((str(path), 0xC0DE, 0xCAFE, "A1"))
        await_until(lambda: node.wire.is_open, "it is found")
        assert node.wire.describe() == f"usb:c0de:cafe ({path})"
        os.write(device.master, b"telemetry")
        await_until(lambda: node.link.heard() == b"telemetry", "it is heard")
        plugged_in[-1] = (f"{path}.2", 0xC0DE, 0xCAFE, "A1")
        device.unplug()
        again = Device(path.with_name("ttyUSB0.2"))
        try:
            await_until(
                lambda: len(node.changes) > 2 and node.wire.is_open, "it is found elsewhere"
            )
            assert node.wire.describe() == f"usb:c0de:cafe ({path}.2)"
        finally:
            again.unplug()


def test_two_devices_with_the_same_ids_are_told_apart_by_their_serial_number(
    plugged_in, device, path, await_until
):
    plugged_in.append((str(path), 0xC0DE, 0xCAFE, "A1"))
    plugged_in.append(("/dev/ttyACM7", 0xC0DE, 0xCAFE, "B2"))
    with running("usb:c0de:cafe") as node:
        (change,) = node.changes
        assert "2 devices have these ids: add the serial number of one" in change.text
        assert "/dev/ttyACM7 B2" in change.text
    with running("usb:C0DE:0xCAFE:A1") as node:
        await_until(lambda: node.wire.is_open, "the right one is opened")
        assert node.wire.describe() == f"usb:c0de:cafe:A1 ({path})"


def test_a_device_that_takes_nothing_does_not_hold_up_the_loop(device, path, await_until):
    with running(f"serial:{path}") as node:
        for _ in range(64):
            node.send(bytes(4096))  # a pseudo terminal holds some kilobytes
        await_until(lambda: node.loop.send_errors, "what does not fit is counted")
        os.write(device.master, b"still heard")
        await_until(lambda: node.link.heard() == b"still heard", "receiving goes on")
        assert node.wire.is_open
