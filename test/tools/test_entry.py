"""Ctrl-C ends every tool in one line and with exit code 130, at whatever moment it comes."""

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = ["demo", "replay", "report", "to_rosbag2", "campaign", "explore", "chute"]
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


#: A Ctrl-C comes, and what was called makes an error of its own of it, or there is none and it
#: fails all the same.
BINDING = """
import signal
import sys
import types


def main():
    try:
        signal.raise_signal({number})
    except KeyboardInterrupt:
        raise RuntimeError("Unable to convert call argument") from None
    raise RuntimeError("a mistake")


module = types.ModuleType("chute_ros.tools.binding")
module.main = main
sys.modules[module.__name__] = module
from chute_ros.tools.entry import run
run("binding", "binding")
"""


def test_in_the_middle_of_a_binding_that_makes_an_error_of_it():
    code = BINDING.format(number="signal.SIGINT")
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert (done.returncode, done.stderr) == (130, "binding: interrupted\n")


#: Something on its way swallows it, as a finaliser does.
SWALLOWED = """
import signal
import sys
import time
import types

from chute_ros.tools import entry


def main():
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        pass
    time.sleep(600)


module = types.ModuleType("chute_ros.tools.swallowing")
module.main = main
sys.modules[module.__name__] = module
entry._CUT_OFF_AFTER = 0.2
entry.run("chute", "swallowing")
"""


def test_one_that_was_swallowed_ends_it_all_the_same():
    command = [sys.executable, "-c", SWALLOWED]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=ROOT, check=False, timeout=60.0
    )
    assert (done.returncode, done.stderr) == (130, "chute: interrupted\n")


#: The signal comes while rclpy makes one of its objects, half of which would complain when it is
#: collected.
HALF_MADE = """
import signal
import sys
import types
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
from chute_ros.tools.entry import run
from chute_ros.tools.processes import Processes

module = types.ModuleType("chute_ros.tools.half_made")
module.main = {place}
sys.modules[module.__name__] = module
run("half_made", "half_made")
"""


@pytest.mark.parametrize(
    ("place", "number", "code", "told"),
    [
        ("director", "SIGINT", 130, "half_made: interrupted\n"),
        ("session", "SIGINT", 130, "half_made: interrupted\n"),
        ("session", "SIGTERM", 143, ""),
    ],
)
def test_in_the_middle_of_what_rclpy_makes(place, number, code, told):
    command = [sys.executable, "-c", HALF_MADE.format(place=place, number=number)]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=ROOT, check=False, timeout=60.0
    )
    assert (done.returncode, done.stderr) == (code, told)
    # The turn in which it came is the second, and whole.
    assert done.stdout.count("due\n") == 2


#: rclpy has shut itself down by a signal that Python has not been told of yet.
SHUT_DOWN = """
import sys
import types

import rclpy
import rclpy.executors
from std_srvs.srv import Trigger


def main():
    rclpy.init(args=[])
    client = rclpy.create_node("shut_down").create_client(Trigger, "any")
    {ends}
    client.service_is_ready()
    raise RuntimeError("a mistake")


module = types.ModuleType("chute_ros.tools.shutting")
module.main = main
sys.modules[module.__name__] = module
from chute_ros.tools.entry import run
run("shutting", "shutting")
"""


@pytest.mark.parametrize(
    ("ends", "code", "told"),
    [
        ("rclpy.get_default_context().shutdown()", 130, "shutting: interrupted\n"),
        ("pass", 1, "RuntimeError: a mistake\n"),
    ],
)
def test_after_rclpy_has_shut_down_by_a_signal(ends, code, told):
    command = [sys.executable, "-c", SHUT_DOWN.format(ends=ends)]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=ROOT, check=False, timeout=60.0
    )
    assert (done.returncode, done.stderr[-len(told) :]) == (code, told)


def test_an_error_of_another_cause_is_one():
    code = BINDING.format(number="signal.SIGCONT")
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 1
    assert done.stderr.endswith("RuntimeError: a mistake\n")


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
import sys
import types


def main():
    with contextlib.suppress(OSError):
        os.write(1, b"the middleware complains\\n")
    print("remark", file=sys.stderr)
    print("result")
    sys.exit(1)


module = types.ModuleType("chute_ros.tools.printing")
module.main = main
sys.modules[module.__name__] = module
from chute_ros.tools.entry import run
run("printing", "printing")
"""


def shell(arguments, redirections, command=(sys.executable, "-c", PRINTS)):
    """Its exit code, and what it wrote to standard output and error, where they are open."""
    line = f"{shlex.join([*command, *arguments])} {redirections}"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
        timeout=120.0,
    )
    return done.returncode, done.stdout, done.stderr


def test_what_others_write_to_descriptor_1_is_no_result():
    complaint = "the middleware complains\n"
    assert shell([], "") == (1, "result\n", f"{complaint}remark\n")


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
    code, told, complained = shell([], redirections)
    assert (code, told) == (1, out)
    assert complained.endswith(err)
    assert "Traceback" not in complained


def test_what_cannot_be_printed_is_no_result():
    code, _, err = shell([], ">/dev/full")
    told = "printing: standard output cannot be written: No space left on device\n"
    assert (code, err) == (74, f"the middleware complains\nremark\n{told}")


def test_a_reader_who_has_seen_enough_is_told_nothing():
    code, _, err = shell([], "| true")
    assert (code, err) == (141, "the middleware complains\nremark\n")


@pytest.mark.parametrize("tool", ["judge_log", "replay", "chute", "campaign"])
def test_no_tool_takes_it_for_a_result(tool):
    command = (sys.executable, "-m", f"chute_ros.tools.{tool}")
    code, _, err = shell(["--help"], ">/dev/full", command)
    told = f"{tool}: standard output cannot be written: No space left on device\n"
    assert (code, err) == (74, told)


# What is no file


@pytest.mark.parametrize(
    "line",
    [
        "report fifo",
        "replay fifo",
        "test_card fifo",
        "to_rosbag2 fifo",
        "judge_log fifo",
        "campaign --replay fifo",
        "campaign --flights 1 --resume fifo",
        "campaign --tapes fifo",
        "campaign --vehicle fifo",
    ],
)
def test_a_fifo_in_place_of_a_file_is_not_waited_for(line, tmp_path):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    tool, *arguments = (str(fifo) if one == "fifo" else one for one in line.split())
    code, _, err = shell(arguments, "", (sys.executable, "-m", f"chute_ros.tools.{tool}"))
    assert code == 2
    assert "no regular file but a FIFO" in err
    assert "Traceback" not in err
