"""A second program that reads the same serial port is called that; the port stays open."""

import os
import subprocess
import sys
import time
import tty

import pytest
from loop_bench import running
from test_serial import Device

from chute_ros.transport.serial_users import PortUsers, users_of
from chute_ros.transport.wire_events import WireTrouble

READ = "import os,sys\nf=os.open(sys.argv[1],os.O_RDWR|os.O_NOCTTY)\nprint(1,flush=True)\n"
TAKE_ALL = READ + "import select\nwhile select.select([f],[],[]): os.read(f,4096)"
HOLD = READ + "sys.stdin.read()"
WRITE_ONLY = HOLD.replace("O_RDWR", "O_WRONLY")


class Program:
    """Another program that has the port open."""

    def __init__(self, code, path):
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert self.process.stdout.readline(), "it has opened the port"

    @property
    def name(self):
        return f"(pid {self.process.pid})"

    def end(self):
        self.process.kill()
        self.process.communicate()


@pytest.fixture
def device(tmp_path):
    one = Device(tmp_path / "ttyUSB0")
    yield one
    one.unplug()


@pytest.fixture
def program(device):
    programs = []

    def run(code):
        programs.append(Program(code, device.path))
        return programs[-1]

    yield run
    for one in programs:
        one.end()


def troubles(node):
    return [event.text for event in node.delivered if isinstance(event, WireTrouble)]


def test_a_second_reader_is_named_and_the_port_is_kept(device, program, await_until):
    with running(f"serial:{device.path}") as node:
        other = program(TAKE_ALL)

        def named():
            os.write(device.master, b"$TELEM,1\n")
            return troubles(node)

        await_until(named, "it is told")
        assert len(troubles(node)) == 1, "once"
        (text,) = troubles(node)
        assert other.name in text
        assert "has a second reader, which takes part of the data" in text
        assert node.wire.is_open
        assert [change.is_open for change in node.changes] == [True], "never closed, nor reopened"
        other.end()
        await_until(lambda: troubles(node)[-1] == "", "its end is told")
        assert len(troubles(node)) == 2, "and nothing in between"
        before = node.link.heard()
        os.write(device.master, b"all")
        await_until(lambda: node.link.heard() == before + b"all", "all is heard again")


def test_an_unplugged_port_with_a_second_reader_is_unplugged(device, program, await_until):
    with running(f"serial:{device.path}") as node:
        program(HOLD)
        device.unplug()
        await_until(lambda: not node.changes[-1].is_open, "the hang-up is told")
        assert "second reader" not in node.changes[-1].text


def test_a_program_that_only_writes_is_no_reader(device, program):
    program(WRITE_ONLY)
    assert users_of(os.stat(device.path).st_rdev) == []


def test_who_holds_the_other_end_is_the_device():
    master, slave = os.openpty()
    try:
        tty.setraw(slave)
        code = "import os,sys\nm,s=os.openpty()\nprint(os.ttyname(s),flush=True)\nsys.stdin.read()"
        simulator = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        name = simulator.stdout.readline().decode().strip()
        assert users_of(os.stat(name).st_rdev) == []
        simulator.kill()
        simulator.communicate()
    finally:
        os.close(slave)
        os.close(master)


def test_a_port_in_use_names_who_uses_it(device, program, await_until):
    lock = READ.replace("print", "import fcntl\nfcntl.flock(f,fcntl.LOCK_EX)\nprint")
    other = program(lock + "sys.stdin.read()")
    with running(f"serial:{device.path}") as node:
        (change,) = node.changes
    assert "the port is in use by another program (" in change.text
    assert other.name in change.text


def test_a_reader_that_cannot_be_seen_is_told_by_its_signs(await_until):
    looks = []
    users = PortUsers("/dev/ttyUSB0", 0, lambda number, apart: looks.append(1) or [], 0.1)
    try:
        now = time.monotonic()
        for tenth in range(2):
            users.ready_without_data(now + tenth / 10)
        before = len(looks)
        await_until(lambda: len(looks) > before + 1, "it was looked for in vain")
        assert users.trouble(now + 0.3) == "", "once or twice may be a driver's whim"
        users.ready_without_data(now + 0.3)
        assert "sudo fuser -v /dev/ttyUSB0" in users.trouble(now + 0.3)
        assert users.trouble(now + 11.0) == "", "over, where no sign comes any more"
    finally:
        users.stop()


def test_a_program_that_only_tried_to_open_the_port_is_not_told_of(await_until):
    looks = []

    def look(number, apart):
        looks.append(["prober (pid 7)"] if not looks else [])
        return looks[-1]

    users = PortUsers("/dev/ttyUSB0", 0, look, 0.1)
    try:
        await_until(lambda: len(looks) > 2, "it was looked for again")
        assert users.trouble(time.monotonic()) == ""
    finally:
        users.stop()
