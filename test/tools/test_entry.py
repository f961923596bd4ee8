"""Ctrl-C ends every tool in one line and with exit code 130, at whatever moment it comes."""

import os
import shlex
import signal
import subprocess
import sys

import pytest
from command_bench import ROOT, ended, refused

from chute_ros.tools import (
    campaign_command,
    replay_command,
    report_command,
    to_rosbag2_command,
)
from chute_ros.tools import (
    test_card_command as card_command,
)
from chute_ros.tools.judge_log import command as judge_log

TOOLS = ["demo", "replay", "report", "to_rosbag2", "campaign", "explore", "chute", "judge_log"]
#: Stays in the middle of the imports of a tool, once it has said so.
SLOW = """
import signal
import sys


class Slow:
    def find_spec(self, name, path=None, target=None):
        if name == "chute_ros.errors":
            print("importing", flush=True)
            signal.pause()


sys.meta_path.insert(0, Slow())
"""


#: A recording that is opened waits at the gate.
GATED = """
import os

fdopen = os.fdopen


def gated(number, *arguments, **named):
    if os.readlink(f"/proc/self/fd/{number}").endswith("/recording.mcap"):
        with open(os.environ["GATE"]) as gate:
            gate.read()
    return fdopen(number, *arguments, **named)


os.fdopen = gated
"""


def start(tool, *arguments, **how):
    return subprocess.Popen(
        [sys.executable, "-m", f"chute_ros.tools.{tool}", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        **how,
    )


def interrupted(tool):
    """Its exit code and the end of what it says."""
    tool.send_signal(signal.SIGINT)
    _, err = tool.communicate(timeout=60.0)
    return tool.returncode, err


@pytest.mark.parametrize("tool", TOOLS)
def test_while_it_imports(tool, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(SLOW)
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    started = start(tool, env={**os.environ, "PYTHONPATH": path})
    assert started.stdout.readline() == "importing\n"
    assert interrupted(started) == (130, f"{tool}: interrupted\n")


@pytest.fixture
def recording(tmp_path):
    """A recording that is read no further than the test lets it."""
    path = tmp_path / "recording.mcap"
    path.write_bytes(b"no MCAP")
    os.mkfifo(tmp_path / "gate")
    (tmp_path / "sitecustomize.py").write_text(GATED)
    return path


def reading(tool, recording, **how):
    path = os.pathsep.join([str(recording.parent), *filter(None, sys.path)])
    gate = str(recording.with_name("gate"))
    given = {**os.environ, "PYTHONPATH": path, "GATE": gate}
    return start(tool, str(recording), env=given, **how)


@pytest.mark.parametrize("tool", ["replay", "report", "to_rosbag2"])
def test_while_it_reads(tool, recording):
    started = reading(tool, recording)
    with recording.with_name("gate").open("wb"):  # waits until it is opened there, too
        assert interrupted(started) == (130, f"{tool}: interrupted\n")


def test_while_it_explores():
    started = start("explore", "--depth", "9")
    assert started.stderr.readline().startswith("depth 1: ")
    assert interrupted(started) == (130, "explore: interrupted\n")


#: A tool with a main of the test's own.
OWN = """
import sys
import types

{main}

module = types.ModuleType("chute_ros.tools.own")
module.main = main
sys.modules[module.__name__] = module
from chute_ros.tools import entry
{before}
entry.run("{name}", "own")
"""


def own(main, name="own", before=""):
    """The command of a tool with this main."""
    return (sys.executable, "-c", OWN.format(main=main, name=name, before=before))


#: A Ctrl-C comes, and what was called makes an error of its own of it, or there is none and it
#: fails all the same.
BINDING = """
import signal


def main():
    try:
        signal.raise_signal({number})
    except KeyboardInterrupt:
        raise RuntimeError("Unable to convert call argument") from None
    raise RuntimeError("a mistake")
"""


def test_in_the_middle_of_a_binding_that_makes_an_error_of_it():
    code, _, err = ended(own(BINDING.format(number="signal.SIGINT")))
    assert (code, err) == (130, "own: interrupted\n")
    code, _, err = ended(own(BINDING.format(number="signal.SIGCONT")))
    assert code == 1, "of another cause"
    assert err.endswith("RuntimeError: a mistake\n")


#: Something on its way swallows it, as a finaliser does.
SWALLOWED = """
import signal
import time


def main():
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        pass
    time.sleep(600)
"""


def test_one_that_was_swallowed_ends_it_all_the_same():
    command = own(SWALLOWED, "chute", "entry._CUT_OFF_AFTER = 0.2")
    assert ended(command) == (130, "", "chute: interrupted\n")


#: The signal comes while rclpy makes one of its objects, half of which would complain when it is
#: collected.
HALF_MADE = """
import signal
from pathlib import Path

from rclpy.task import Future

make = Future.__init__


def make_slowly(self, *arguments, **named):
    if spins:
        signal.raise_signal(signal.{number})
    make(self, *arguments, **named)


def due():
    global spins
    spins = True
    print("due", flush=True)


def director():
    director = Director("/half_made", Processes(Path("/nowhere")))
    director.node.create_timer(0.01, due)
    try:
        director.until("it goes on", 60.0, lambda: False)
    finally:
        director.close()


def session():
    with opened("/half_made") as session:
        session.node.create_timer(0.01, due)
        with full_screen():
            session.until(lambda: False, 60.0)


spins = False
Future.__init__ = make_slowly
from chute_ros.tools.chute.screen import full_screen
from chute_ros.tools.chute.session import opened
from chute_ros.tools.demo_director import Director
from chute_ros.tools.processes import Processes

main = {place}
"""


@pytest.mark.parametrize(
    ("place", "number", "code", "told"),
    [
        ("director", "SIGINT", 130, "own: interrupted\n"),
        ("session", "SIGINT", 130, "own: interrupted\n"),
        ("session", "SIGTERM", 143, ""),
    ],
)
def test_in_the_middle_of_what_rclpy_makes(place, number, code, told):
    # The turn in which it came is the second, and whole.
    command = own(HALF_MADE.format(place=place, number=number))
    found, out, err = ended(command)
    assert (found, out.count("due\n"), err) == (code, 2, told)


#: rclpy has shut itself down by a signal that Python has not been told of yet.
SHUT_DOWN = """
import rclpy
import rclpy.executors
from std_srvs.srv import Trigger


def main():
    rclpy.init(args=[])
    client = rclpy.create_node("shut_down").create_client(Trigger, "any")
    {ends}
    client.service_is_ready()
    raise RuntimeError("a mistake")
"""


@pytest.mark.parametrize(
    ("ends", "code", "told"),
    [
        ("rclpy.get_default_context().shutdown()", 130, "own: interrupted\n"),
        ("pass", 1, "RuntimeError: a mistake\n"),
    ],
)
def test_after_rclpy_has_shut_down_by_a_signal(ends, code, told):
    found, _, err = ended(own(SHUT_DOWN.format(ends=ends)))
    assert (found, err[-len(told) :]) == (code, told)


def test_one_that_is_to_ignore_it_goes_on(recording):
    """As a shell starts what is to run behind its back."""
    started = reading(
        "replay",
        recording,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )
    with recording.with_name("gate").open("wb"):
        started.send_signal(signal.SIGINT)
    _, err = started.communicate(timeout=60.0)
    assert (started.returncode, err) == (2, f"replay: {recording} is no MCAP file\n")


# What nobody can read


#: A tool with a result, of which something is printed.
PRINTS = """
import contextlib
import os


def main():
    with contextlib.suppress(OSError):
        os.write(1, b"the middleware complains\\n")
    print("remark", file=sys.stderr)
    print("result")
    sys.exit(1)
"""


def shell(command, redirections):
    """Its exit code, and what it wrote to standard output and error, where they are open."""
    return ended(["bash", "-o", "pipefail", "-c", f"{shlex.join(command)} {redirections}"])


def test_what_others_write_to_descriptor_1_is_no_result():
    complaint = "the middleware complains\n"
    assert shell(own(PRINTS), "") == (1, "result\n", f"{complaint}remark\n")


@pytest.mark.parametrize(
    ("redirections", "out", "err"),
    [
        ("<&-", "result\n", "remark\n"),
        (">&-", "", "remark\n"),
        ("2>&-", "result\n", ""),
        ("<&- >&- 2>&-", "", ""),
        ("2>/dev/full", "result\n", ""),
    ],
)
def test_a_closed_stream_changes_no_result(redirections, out, err):
    code, told, complained = shell(own(PRINTS), redirections)
    assert (code, told) == (1, out)
    assert complained.endswith(err)
    assert "Traceback" not in complained


def test_what_cannot_be_printed_is_no_result():
    code, _, err = shell(own(PRINTS), ">/dev/full")
    told = "own: standard output cannot be written: No space left on device\n"
    assert (code, err) == (74, f"the middleware complains\nremark\n{told}")


def test_a_reader_who_has_seen_enough_is_told_nothing():
    code, _, err = shell(own(PRINTS), "| true")
    assert (code, err) == (141, "the middleware complains\nremark\n")


def test_nor_is_help():
    command = (sys.executable, "-m", "chute_ros.tools.replay", "--help")
    code, _, err = shell(command, ">/dev/full")
    told = "replay: standard output cannot be written: No space left on device\n"
    assert (code, err) == (74, told)


# What is no file


@pytest.mark.parametrize(
    ("command", "before"),
    [
        (report_command, ()),
        (replay_command, ()),
        (card_command, ()),
        (to_rosbag2_command, ()),
        (judge_log, ()),
        (campaign_command, ("--replay",)),
        (campaign_command, ("--flights", "1", "--resume")),
        (campaign_command, ("--tapes",)),
        (campaign_command, ("--vehicle",)),
    ],
)
def test_a_fifo_in_place_of_a_file_is_not_waited_for(
    command, before, tmp_path, monkeypatch, capsys
):
    os.mkfifo(tmp_path / "fifo")
    monkeypatch.chdir(tmp_path)
    _, errors = refused(command, monkeypatch, capsys, *before, "fifo")
    assert "no regular file but a FIFO" in errors
