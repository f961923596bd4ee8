"""The output as a file or a serial port, and the parameters that name it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from chute_msgs.srv import Deploy
from relay_bench import Board

from chute_ros.errors import ParameterError
from chute_ros.links.relay.output import FileWire, make_output
from chute_ros.links.relay.protocol.link import RelayConfig
from chute_ros.model import LinkState


def test_a_file_is_written_from_its_beginning_each_time(tmp_path):
    path = tmp_path / "value"
    path.write_text("0")
    wire = FileWire(path)
    assert not wire.is_open
    wire.open()
    assert (wire.is_open, wire.describe(), wire.files()) == (True, f"file:{path}", [])
    for value in (b"1", b"0", b"1"):
        wire.write(value)
        assert path.read_bytes() == value
    wire.close()
    assert not wire.is_open
    wire.close()


def test_a_file_that_is_not_there_is_not_made(tmp_path):
    with pytest.raises(FileNotFoundError):
        FileWire(tmp_path / "value").open()
    assert not list(tmp_path.iterdir())


def test_a_pipe_is_an_output_while_somebody_reads_it(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    wire = FileWire(path)
    with pytest.raises(OSError):  # and it does not hang
        wire.open()
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    wire.open()
    wire.write(b"1")
    assert os.read(reader, 10) == b"1"
    os.close(reader)
    with pytest.raises(ConnectionError):
        wire.write(b"1")
    wire.close()


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_is_stopped_in_a_pulse_ends_after_it_and_at_rest(bench, tmp_path, by):
    path = tmp_path / "value"
    path.write_text("9")
    command = [sys.executable, "-m", "chute_ros.links.relay", "--ros-args"]
    command += ["-r", f"__ns:={bench.namespace}"]
    for name, value in (("connection", f"file:{path}"), ("output_fire", "'1'")):
        command += ["-p", f"{name}:={value}"]
    command += ["-p", "output_rest:='0'", "-p", "pulse_time:=1.5"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as node:
        bench.until(lambda: path.read_text() == "0", "it rests")
        bench.call(Deploy, "relay/deploy", force=True, reason="a test")
        began = time.monotonic()
        assert path.read_text() == "1"
        node.send_signal(by)
        while time.monotonic() < began + 1.2:
            assert path.read_text() == "1", "the pulse has its time"
            time.sleep(0.05)
        _, errors = node.communicate(timeout=10.0)
    assert path.read_text() == "0"
    assert node.returncode == 0, errors
    assert "Traceback" not in errors


def test_what_is_not_taken_whole_is_not_taken(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    wire = FileWire(path)
    wire.open()
    with pytest.raises(OSError, match=r"of 1000000 bytes were taken"):
        wire.write(bytes(1_000_000))
    with pytest.raises(BlockingIOError):
        wire.write(b"1")
    wire.close()
    os.close(reader)


def test_a_device_that_says_it_is_gone_is_opened_again(monkeypatch):
    wire = FileWire(Path("/dev/full"))
    wire.open()
    with pytest.raises(OSError) as full:
        wire.write(b"1")
    assert not isinstance(full.value, ConnectionError), "no room is no reason to open it again"
    wire.close()
    with pytest.raises(ConnectionError):
        wire.write(b"1")


@pytest.mark.parametrize(
    ("given", "described"),
    [
        ("file:/sys/class/gpio/gpio17/value", "file:/sys/class/gpio/gpio17/value"),
        ("serial:/dev/ttyUSB0:9600", "serial:/dev/ttyUSB0:9600"),
        ("usb:1a86:7523", "usb:1a86:7523"),
    ],
)
def test_what_can_be_named(given, described):
    assert make_output(given).describe() == described


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("", "connection '' is no output: need file:PATH, serial:PATH"),
        ("file:", "connection 'file:' is no output: need file:PATH, serial:PATH"),
        ("udpin:0.0.0.0:14550", "is no output: need file:PATH"),
        ("/dev/ttyUSB0", "is no output: need file:PATH"),
        ("serial:", "need "),
        ("file:~nobody_at_all/x", "parameter connection is '~nobody_at_all/x'"),
    ],
)
def test_what_cannot(given, said):
    with pytest.raises(ParameterError) as error:
        make_output(given)
    assert said in str(error.value)


def test_bytes_as_text_and_as_digits():
    assert RelayConfig(output_fire="1").fire == b"1"
    assert RelayConfig(output_fire="hex:a00101a2").fire == b"\xa0\x01\x01\xa2"
    assert RelayConfig(output_rest="hex:A0 01").rest == b"\xa0\x01"
    for wrong in ("", "hex:", "hex:a", "hex:xy"):
        with pytest.raises(
            ParameterError, match=f"parameter output_fire is '{wrong}': need a text"
        ):
            RelayConfig(output_fire=wrong)


def test_a_node_that_would_fire_at_rest_does_not_start(bench):
    told = "output_fire is '1' and output_rest is '1': the output would always fire"
    with pytest.raises(ParameterError, match=told):
        Board(bench, output_fire="1", output_rest="1")


def test_a_node_fires_a_gpio(bench, tmp_path):
    path = tmp_path / "value"
    path.write_text("?")
    board = Board(
        bench, connection=f"file:{path}", output_fire="1", output_rest="0", pulse_time=0.3
    )
    link = board.node.loop.link
    bench.until(lambda: link.state is LinkState.UNMONITORED, "it can be written")
    assert path.read_text() == "0"
    board.node.loop.call(lambda link, now: link.deploy(7, True, now))
    bench.until(lambda: path.read_text() == "1", "it fires")
    bench.until(lambda: path.read_text() == "0", "and rests")
