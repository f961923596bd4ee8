"""The command conformance on a flight computer at the end of a pseudo terminal."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from command_bench import refused
from conformance_processes import Bench
from mcap.reader import make_reader

from chute_ros.tools.conformance import command

MODULE = "chute_ros.links.umbilical.simulator.sim_flight_computer"
QUICK = ["--only", "target", "flash-info"]


class UmbilicalBench(Bench):
    """A flight computer on a pseudo terminal, whose cable can be pulled."""

    def __init__(self, folder: Path, *options: str) -> None:
        self._folder, self._control = folder, str(folder / "control")
        device = (MODULE, "--link", f"{folder}/tty", "--control", self._control, *options)
        super().__init__(device, ("umbilical", "--connection", f"serial:{folder}/tty"), True)

    def act(self, action: str) -> None:
        """The device does this."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as one:
            one.bind(str(self._folder / "hand"))
            one.sendto(action.encode(), self._control)
            assert one.recv(100) == b"ok"
        os.unlink(self._folder / "hand")


@contextmanager
def armed(bench: Bench) -> Iterator[subprocess.Popen[str]]:
    """The kit in the middle of its clauses, with the device armed."""
    with bench.trying("--arm", "--only", "key-arm", "nearly-arms") as kit:
        assert kit.stdin is not None
        assert kit.stdout is not None
        kit.stdin.write("ARM\n")
        kit.stdin.flush()
        assert any("passed         key-arm" in line for line in kit.stdout)
        yield kit


def test_a_sound_device_and_what_is_written_of_it(tmp_path: Path) -> None:
    page, traffic = tmp_path / "a.html", tmp_path / "a.mcap"
    files = ("--html", str(page), "--mcap", str(traffic))
    code, out, errors = UmbilicalBench(tmp_path).run(*QUICK, *files)
    assert (code, errors) == (0, "")
    assert "umbilical flight computer (telem57_airbrake_state): 2 passed\n" in out
    assert "Flash: 1024/14336 KB used (7.1%)" in page.read_text()
    with traffic.open("rb") as file:
        packets = [json.loads(one.data) for *_, one in make_reader(file).iter_messages()]
    assert {"$TELEM", "write", "line"} <= {one["name"] for one in packets}


def test_a_firmware_of_another_layout_is_tried_with_its_name(tmp_path: Path) -> None:
    """It is found by the number of fields of its lines."""
    layout = ("--layout", "telem54")
    code, out, errors = UmbilicalBench(tmp_path, *layout).run(*layout, "--only", "target")
    assert (code, errors) == (0, "")
    assert "flight computer (telem54): 1 passed" in out


def test_what_wipes_takes_its_option_and_is_told_before(tmp_path: Path) -> None:
    bench, one = UmbilicalBench(tmp_path), ("--only", "wipe-flash")
    code, out, _ = bench.run(*one)
    assert (code, "IT WIPES" in out) == (0, False)
    assert "not tried      wipe-flash           it takes --wipe" in out
    code, out, _ = bench.run(*one, "--wipe")
    assert code == 0
    assert "[1/1] wipe-flash: IT WIPES what it stores" in out
    assert "passed         wipe-flash           Flash: 0/14336 KB used (0.0%)" in out


def test_with_the_word_it_launches_and_is_restarted(tmp_path: Path) -> None:
    code, out, errors = UmbilicalBench(tmp_path).run("--fire", "--only", "launch", typed="FIRE\n")
    assert (code, errors) == (0, "")
    assert "launch: IT LAUNCHES" in out
    assert "passed         launch               Ascent after" in out


def test_damaged_lines_end_in_words(tmp_path: Path) -> None:
    """Given a cable that cuts lines and puts random bytes between them."""
    noisy = UmbilicalBench(tmp_path, "--cut", "0.3", "--garbage", "0.5")
    code, out, errors = noisy.run("--only", "line-end", "text", "field-count", "target")
    assert (code, errors) == (1, "")
    assert "FAILED         text                 bytes come that are no text" in out
    assert "passed         target" in out


@pytest.mark.parametrize("plugged_again", [False, True])
def test_after_a_pulled_cable_it_is_disarmed_or_said_to_be_left_armed(
    plugged_again: bool, tmp_path: Path
) -> None:
    bench = UmbilicalBench(tmp_path)
    with armed(bench) as kit:
        bench.act("cut")
        if plugged_again:
            bench.act("restore")
        out, errors = kit.communicate(timeout=60.0)
    assert kit.returncode == 3
    assert "was unplugged" in errors
    assert ("it may be LEFT ARMED" in errors) != plugged_again
    assert "flight computer (telem57_airbrake_state): 1 passed\n" in out


def test_a_ctrl_c_leaves_it_disarmed(tmp_path: Path) -> None:
    with armed(UmbilicalBench(tmp_path)) as kit:
        kit.send_signal(signal.SIGINT)
        _, errors = kit.communicate(timeout=60.0)
    assert (kit.returncode, errors) == (3, "conformance: aborted by Ctrl-C\n")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--layout", "telem99"), "--layout 'telem99': need one of telem57_airbrake_state, "),
        (("--connection", "udpin:0.0.0.0:1"), "connection 'udpin:0.0.0.0:1' is no serial port"),
    ],
)
def test_a_mistake_in_the_command_line_ends_with_2(
    options: tuple[str, ...], told: str, monkeypatch, capsys
) -> None:
    _, errors = refused(command, monkeypatch, capsys, "umbilical", *options)
    assert f"conformance: {told}" in errors
