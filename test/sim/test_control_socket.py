"""Running simulators told what to do, each over its control socket: one datagram, one action."""

import errno
import os
import signal
import socket
import stat
import subprocess
import sys

import pytest
from printing_process import PrintingProcess

from chute_ros.links.relay.protocol.link import RelayConfig
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder
from chute_ros.sim.bench_actions import ACTIONS
from chute_ros.sim.control import DONE, order
from chute_ros.tools.isolation import free_udp_ports

MODULES = {
    "sim_autopilot": "chute_ros.sim.sim_autopilot",
    "sim_mavlink_parachute": "chute_ros.links.mavlink.simulator.sim_mavlink_parachute",
    "sim_upf": "chute_ros.links.upf.simulator.sim_upf",
    "sim_relay": "chute_ros.links.relay.simulator.sim_relay",
    "sim_flight_computer": "chute_ros.links.umbilical.simulator.sim_flight_computer",
}
EVERY = pytest.mark.parametrize("name", MODULES)
LOCAL = "127.0.0.1"


class Running(PrintingProcess):
    """A simulator that can be told what to do."""

    def __init__(self, name, path, *more):
        self.path = str(path)
        super().__init__(MODULES[name], "--control", self.path, *more)

    def order(self, action):
        return order(self.path, action, 10.0)


@pytest.fixture
def start(tmp_path, await_until):
    """Start one by its name, with wires of its own unless some are given."""
    started = []

    def begin(name, *more, path=None):
        (port,) = free_udp_ports(1)
        wires = {
            "sim_autopilot": ("--connection", f"udpout:{LOCAL}:{port}"),
            "sim_mavlink_parachute": ("--connection", f"udpout:{LOCAL}:{port}"),
            "sim_upf": ("--connection", f"mcast:0:{port}"),
        }
        given = more if "--connection" in more else (*wires.get(name, ()), *more)
        started.append(Running(name, path or tmp_path / "control", *given))
        await_until(lambda: started[-1].said("is open"), "it runs")
        return started[-1]

    yield begin
    for running in started:
        running.end(signal.SIGKILL)


@EVERY
def test_it_does_each_action_of_the_table_at_once_and_says_so_whatever_garbage_came(
    name, start, await_until
):
    running = start(name)
    send_garbage_to(running)
    actions = [what for one in ACTIONS for simulator, what in one.orders if simulator == name]
    assert len(actions) >= 6
    # Last, so that what was done before does not refuse a flight.
    for action in sorted(actions, key=lambda one: one.startswith(("fly", "launch", "mend"))):
        if action.startswith(("fly", "launch")):
            assert running.order("mend") == DONE
        assert running.order(action) == DONE
        await_until(lambda what=action: running.said(f"action {what}"), "it says so")
    assert running.end() == 0
    assert not running.said("Traceback")


def send_garbage_to(running):
    """Each is answered with a reason, if there is somebody to answer."""
    for garbage, reason in (
        ("explode", "action 'explode' is not known: need one of "),
        ("", "action '' is not known: need one of "),
        ("reboot=now", "action 'reboot=now': reboot takes no argument"),
        ("reboot\x00\x1b[31m", "is not known"),
        ("reboot " * 1000, "is not known"),
    ):
        answer = running.order(garbage)
        assert reason in answer
        assert "\x1b" not in answer
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.settimeout(10.0)
        end.bind("")
        end.sendto(b"\xff\xfe\x00" * 100, running.path)
        assert b"is no text: need an action" in end.recv(4096)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as nameless:
        nameless.sendto(b"reboot", running.path)


def test_only_who_started_it_may_write_there(start):
    before = os.umask(0)
    try:
        running = start("sim_relay")
    finally:
        os.umask(before)
    about = os.lstat(running.path)
    assert stat.S_ISSOCK(about.st_mode)
    assert stat.S_IMODE(about.st_mode) == 0o600


def test_it_takes_its_socket_away_at_its_end(start):
    running = start("sim_relay")
    assert running.end(signal.SIGTERM) == 0
    assert not os.path.lexists(running.path)
    assert "the simulator does not run" in running.order("reboot")


def test_what_one_that_was_killed_has_left_is_replaced(start):
    killed = start("sim_relay")
    killed.end(signal.SIGKILL)
    assert os.path.lexists(killed.path)
    assert start("sim_relay").order("reboot") == DONE


def refused(path):
    done = subprocess.run(
        [sys.executable, "-m", MODULES["sim_relay"], "--control", str(path)],
        capture_output=True,
        text=True,
        timeout=20.0,
        check=False,
    )
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    return done.stderr


def test_a_socket_in_use_a_file_and_a_path_that_cannot_be_are_refused(start, tmp_path):
    running = start("sim_relay")
    assert "Address already in use: need a path of at most 107 bytes" in refused(running.path)
    assert running.order("reboot") == DONE, "it still has its socket"
    (tmp_path / "notes").write_text("mine")
    assert "no file there" in refused(tmp_path / "notes")
    assert (tmp_path / "notes").read_text() == "mine"
    assert "No such file or directory" in refused(tmp_path / "none" / "control")
    assert "AF_UNIX path too long" in refused(tmp_path / ("a" * 120))


def heard(station):
    """Kinds of what has come until now."""
    found = []
    while True:
        try:
            frames = FrameDecoder().feed_datagram(station.recv(300), 0.0)
        except TimeoutError:
            return found
        found += [frame.message.get_type() for frame in frames]


def test_cut_it_is_not_heard_and_hears_nothing_on_its_first_wire_alone(start):
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as node,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as beside,
    ):
        for end in (node, beside):
            end.bind((LOCAL, 0))
            end.settimeout(20.0)
        wires = [f"udpout:{LOCAL}:{end.getsockname()[1]}" for end in (node, beside)]
        running = start("sim_autopilot", *("--connection", wires[0], "--connection", wires[1]))
        _, autopilot = node.recvfrom(300)
        assert running.order("cut") == DONE
        node.settimeout(0.5)
        heard(node)
        arm = dialect.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
        node.sendto(FrameEncoder(255, 190).encode(arm, 0.0), autopilot)
        assert heard(node) == []
        assert beside.recv(300)
        assert running.order("restore") == DONE
        node.settimeout(20.0)
        assert node.recv(300)
        assert not running.said("ARMED"), "what came meanwhile is lost"


def test_a_serial_cable_that_is_cut_is_gone_for_its_node_and_comes_back(
    start, tmp_path, await_until
):
    link = tmp_path / "ttyRELAY"
    running = start("sim_relay", "--link", str(link))
    with open(link, "wb", buffering=0) as port:

        def is_gone():
            try:
                port.write(b"x")
            except OSError as error:
                return error.errno == errno.EIO
            return False

        assert not is_gone()
        assert running.order("cut") == DONE
        assert not os.path.lexists(link)
        await_until(is_gone, "the other end of the cable is gone")
    assert running.order("cut") == DONE, "again, which changes nothing"
    assert running.order("restore") == DONE
    with open(link, "wb", buffering=0) as port:
        port.write(RelayConfig().fire)
        await_until(lambda: running.said("channel 1 closes"), "its board hears the node")
    assert running.order("restore") == DONE


def test_a_cable_that_cannot_be_restored_is_told(start, tmp_path):
    link = tmp_path / "ttyRELAY"
    running = start("sim_relay", "--link", str(link))
    assert running.order("cut") == DONE
    link.write_text("somebody's file")
    answer = running.order("restore")
    assert "cannot be opened" in answer
    assert "is no symbolic link" in answer
    link.unlink()
    assert running.order("restore") == DONE
    assert link.is_symlink()


def test_an_action_that_cannot_be_now_is_answered_with_the_reason(start):
    rocket = start("sim_flight_computer")
    assert rocket.order("launch") == DONE
    assert "it is in Ascent: need Startup or Standby" in rocket.order("launch")
    assert rocket.order("reboot") == DONE
    assert "its motor is spent: start over (mend)" in rocket.order("launch")
    assert rocket.order("mend") == DONE
    assert rocket.order("launch") == DONE


def test_a_script_may_cut_as_well(start, tmp_path, await_until):
    link = tmp_path / "ttyRELAY"
    running = start("sim_relay", "--link", str(link), *("--at", "0.3:cut", "--at", "0.6:restore"))
    await_until(lambda: running.said("action cut"), "it is cut")
    await_until(lambda: running.said("action restore"), "and restored")
    await_until(link.is_symlink, "the cable is back")
