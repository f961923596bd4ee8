"""The router: frames go where their addressee was heard, and are recorded as they pass."""

import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.tools.isolation import free_udp_ports
from sitl.record import read
from sitl.routing import FrameSplitter, Routes, message_id, sender, target

ROOT = Path(__file__).resolve().parent.parent.parent
BEAT = dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)


def command(system: int, component: int) -> object:
    return dialect.MAVLink_command_long_message(system, component, 400, 0, *[1.0] * 7)


def frame(message: object, system: int = 1, component: int = 1) -> bytes:
    return FrameEncoder(system, component).encode(message, 0.0)


def test_sender_target_and_number_are_read_from_the_frame():
    one = frame(command(1, 161), 255, 190)
    assert (sender(one), target(one), message_id(one)) == ((255, 190), (1, 161), 76)
    assert target(frame(BEAT)) == (0, 0)


def test_zeros_that_mavlink_2_leaves_out_are_zeros():
    ack = dialect.MAVLink_command_ack_message(400, 0, 0, 0, 0, 0)
    assert target(frame(ack)) == (0, 0)


def test_a_stream_is_split_however_it_comes_and_noise_is_passed_over():
    splitter = FrameSplitter()
    whole = [frame(BEAT), frame(command(1, 1)), frame(BEAT)]
    stream = b"\x00noise" + b"".join(whole)
    found = [one for at in range(len(stream)) for one in splitter.feed(stream[at : at + 1])]
    assert found == whole


@pytest.mark.parametrize(
    ("message", "ends"),
    [
        (BEAT, ["parachute", "station"]),
        (command(1, 161), ["parachute"]),
        (command(255, 0), ["station"]),
        (command(1, 0), ["parachute"]),
        (command(7, 1), []),
    ],
)
def test_what_is_addressed_goes_where_its_addressee_was_heard(message, ends):
    routes = Routes()
    routes.hear("autopilot", frame(BEAT, 1, 1))
    routes.hear("parachute", frame(BEAT, 1, 161))
    routes.hear("station", frame(BEAT, 255, 190))
    every = ["autopilot", "parachute", "station"]
    assert routes.ways("autopilot", frame(message), every) == ends


class End:
    """A process at the router."""

    def __init__(self, one: socket.socket) -> None:
        self.socket = one
        one.settimeout(10.0)

    @classmethod
    def udp(cls, port: int) -> "End":
        one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        one.connect(("127.0.0.1", port))
        return cls(one)

    def says_until(self, other: "End", words: bytes) -> None:
        """Until it is heard there: an end that the router does not know yet gets nothing."""
        other.socket.settimeout(0.2)
        while True:
            self.socket.send(words)
            try:
                other.heard(words)
            except TimeoutError:
                continue
            other.socket.settimeout(10.0)
            return

    def heard(self, wanted: bytes) -> None:
        while self.socket.recv(4096) != wanted:
            pass  # heartbeats of the others


def test_real_sockets_two_networks_a_serial_line_and_the_record(tmp_path):
    line, node, bench = free_udp_ports(3)
    record = tmp_path / "record"
    router = subprocess.Popen(
        [sys.executable, "-m", "sitl.router", str(record), f"t{line},{node}", str(bench)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert router.stdout is not None
        assert router.stdout.readline() == "routing\n"
        autopilot = End(socket.create_connection(("127.0.0.1", line)))
        companion, apart = End.udp(node), End.udp(bench)
        apart.socket.send(frame(BEAT, 254, 190))
        companion.says_until(autopilot, frame(BEAT, 1, 191))
        half = frame(BEAT, 1, 1)
        autopilot.socket.send(half[:5])
        autopilot.socket.send(half[5:])
        companion.heard(half)
        order = frame(command(1, 1), 1, 191)
        companion.socket.send(order)
        autopilot.heard(order)
        autopilot.socket.close()
        again = End(socket.create_connection(("127.0.0.1", line)))
        again.socket.send(half)
        companion.heard(half)
        apart.socket.setblocking(False)
        with pytest.raises(BlockingIOError):
            apart.socket.recv(4096)
    finally:
        router.send_signal(signal.SIGINT)
        assert router.wait(10.0) == 0
    seen = [(one.port, one.component, one.name) for one in read(record, 0.0, frozenset({0, 76}))]
    assert (bench, 190, "HEARTBEAT") in seen
    assert seen[-3:] == [
        (line, 1, "HEARTBEAT"),
        (node, 191, "COMMAND_LONG"),
        (line, 1, "HEARTBEAT"),
    ]
