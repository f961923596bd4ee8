"""The simulated flight computer as an executable, talked to over its pseudo terminal."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import serial
from printing_process import PrintingProcess

from chute_ros.links.umbilical.simulator import sim_flight_computer

FOLDER = str(Path(__file__).parents[4] / "msg_defs" / "telem")
MODULE = sim_flight_computer.__name__
PROGRAM = (sys.executable, "-m", MODULE, "--telem-path", FOLDER)


@pytest.fixture
def link(tmp_path):
    return tmp_path / "umbilical"


@pytest.fixture
def start(link, await_until):
    started = []

    def begin(*arguments):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        more = ("--telem-path", FOLDER, "--link", str(link), *arguments)
        one = PrintingProcess(MODULE, *more, environment=environment)
        started.append(one)
        await_until(lambda: os.path.lexists(link), "the link is there")
        return one

    yield begin
    for simulator in started:
        if simulator.process.poll() is None:
            simulator.process.kill()
            simulator.end()
        simulator.process.stdout.close()


@pytest.fixture
def port(link):
    """port(): the node's end."""
    opened = []

    def begin():
        opened.append(serial.Serial(str(link), 115200, timeout=20.0, exclusive=True))
        return opened[-1]

    yield begin
    for one in opened:
        one.close()


def lines_until(port, matches, most=400):
    """The lines up to the first that matches."""
    lines = []
    for _ in range(most):
        line = port.readline().decode("latin-1").removesuffix("\n")
        lines.append(line)
        if matches(line):
            return lines
    raise AssertionError(f"not in {most} lines; the last are {lines[-3:]}")


def mode_is(mode):
    return lambda line: line.startswith(f"$TELEM,{mode},")


@pytest.fixture
def fail(monkeypatch, capsys):
    """What it says to a mistake, in one line or after its usage."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", [MODULE, "--telem-path", FOLDER, *arguments])
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        try:
            with pytest.raises(SystemExit) as ended:
                sim_flight_computer.main()
        finally:
            # A program that ends at its --link has blocked what would end it.
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        assert ended.value.code == 2
        told, said = capsys.readouterr()
        assert told == ""
        return said.splitlines()[-1]

    return run


#: Sends itself a Ctrl-C as the link is made.
EARLY = """
import os
import signal
import sys

make = os.symlink


def interrupted(*arguments, **more):
    make(*arguments, **more)
    signal.raise_signal(signal.SIGINT)


os.symlink = interrupted
from chute_ros.links.umbilical.simulator.sim_flight_computer import main
sys.exit(main())
"""


def test_a_ctrl_c_as_soon_as_its_link_is_there_ends_it(link):
    command = [sys.executable, "-c", EARLY, *PROGRAM[3:], "--link", str(link)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert not os.path.lexists(link)


def test_its_first_line_is_its_path_and_link(start, link, await_until):
    running = start()
    await_until(lambda: running.lines, "it prints")
    path = os.readlink(link)
    assert running.lines[0] == f"{path} linked from {link}"
    assert running.end() == 0
    assert not os.path.lexists(link)
    assert all(re.match(r" *\d+\.\d{3} ", line) for line in running.lines[1:]), running.lines


def test_armed_and_launched_it_flies(start, port):
    running = start("--speed", "30", "--rate", "13")
    node = port()
    lines_until(node, mode_is(0))
    node.write(b"<KA>")
    lines_until(node, mode_is(1))
    node.write(b"<L>")
    for mode in (2, 3, 4, 5):
        lines_until(node, mode_is(mode))
    assert running.end(signal.SIGTERM) == 0
    told = [line.split(None, 1)[1] for line in running.lines if " -> " in line]
    assert told[0] == "Startup -> Standby"
    assert told[-1] == "DrogueDeployed -> MainDeployed"


def test_it_speaks_the_layout_that_is_chosen(start, port):
    start("--layout", "telem54")
    node = port()
    # The first line may be what is left of one that began before.
    node.readline()
    lines = [node.readline().decode().removesuffix("\n") for _ in range(3)]
    assert [line.count(",") for line in lines] == [54] * 3


def test_it_does_what_the_options_and_the_script_say(start, port):
    start("--debug", "--interlock", "--drogue-fails", "--at", "0.5:jump=Coast", "--speed", "50")
    node = port()
    node.write(b"<KA>")
    lines = lines_until(node, lambda line: line == "Arming blocked: wipe flash first")
    assert "[WARN] UMBILICAL CMD: Key arm" in lines
    lines = lines_until(node, lambda line: line.startswith("$TELEM,3,") and ",0,0," in line)
    on_the_ground = re.compile(r"\$TELEM,3,101325,15,0,")
    lines = lines_until(node, on_the_ground.match)
    assert "[INFO] Drogue deployed" not in lines


def test_two_commands_at_once_are_lost_as_on_the_real_one(start, port, await_until):
    running = start()
    node = port()
    node.write(b"<KA><L>")
    await_until(lambda: any("lost b'<KA><L>': glued" in line for line in running.lines), "lost")
    node.write(b"<H>")
    await_until(lambda: any("umbilical connected" in line for line in running.lines), "heard")


def test_spoiled_lines_come_as_the_seed_says(start, port):
    start("--cut", "0.5", "--garbage", "0.2", "--seed", "4", "--rate", "50")
    node = port()
    node.readline()
    lines = lines_until(node, lambda line: line.count("$TELEM") > 1)
    assert lines


def test_quiet_it_prints_nothing(start, port):
    running = start("--quiet")
    node = port()
    lines_until(node, mode_is(0))
    assert running.end() == 0
    assert running.lines == []


def test_help_names_every_action_and_layout_default():
    done = subprocess.run(
        [*PROGRAM, "--help"],
        env={**os.environ, "COLUMNS": "500"},
        capture_output=True,
        text=True,
        check=True,
    )
    for word in (
        *("--link PATH", "--layout NAME", "--at SECONDS:ACTION", "telem57_airbrake_state"),
        *("mute", "stuck", "jump=MODE", "dump-stalls", "wipe-hangs", "MainDeployed"),
    ):
        assert word in done.stdout


MISTAKES = {
    "--layout telem99": "--layout 'telem99': need one of telem57_airbrake_state, telem5",
    "--telem-path /no/folder": "--telem-path is '/no/folder': there is no layout",
    "--at 5:explode": "action 'explode' is not known: need one of cut, drogue-fails, dump-",
    "--at 5:jump=Moon": "is no argument of jump: need jump=one of Startup, ",
    "--at soon:land": "--at 'soon:land': need SECONDS:ACTION",
    "--rate 0": "rate is 0.0: need 0.01 to 100 Hz",
    "--speed -1": "speed is -1.0: need 0.01 to 1000",
    "--cut 30": "cut is 30.0: need 0 to 1",
    "--heartbeat-timeout nan": "heartbeat-timeout is nan: need 0 to 3600 s",
    "--link /no/folder/link": "--link '/no/folder/link': the folder /no/folder does not exist",
    "--warp 9": "unrecognized arguments: --warp 9",
}


def test_a_mistake_is_told_in_one_line(fail):
    for arguments, said in MISTAKES.items():
        assert said in fail(*arguments.split()), arguments


def test_a_mistake_leaves_no_link_behind_and_a_file_is_not_replaced(link, fail):
    fail("--link", str(link), "--at", "5:explode")
    assert not os.path.lexists(link)
    link.write_text("notes")
    assert "is there and is no symbolic link" in fail("--link", str(link))
    assert link.read_text() == "notes"
