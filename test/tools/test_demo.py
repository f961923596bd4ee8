"""The demo flies end to end, and fails loudly where a step cannot happen.

Two run at a time, which also shows that runs side by side do not meet.
"""

import os
import re
import signal
import subprocess
import sys

import pytest
from command_bench import refused
from flight_bench import run

from chute_ros.tools import demo_command, replay_command


def start(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "chute_ros.tools.demo", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


# What is flown once for all of them is flown by one worker.
pytestmark = pytest.mark.xdist_group("demo")
#: Name -> arguments of those that are flown at one time: more, on a machine with two cores, starve
#: each other of the heartbeats that they are about.
RUNS = (
    {"good": (), "bad": ("--fault", "parachute-mute")},
    {"both": ("--parachute", "both"), "rocket": ("--vehicle", "rocket")},
    {
        "upf": ("--parachute", "upf"),
        "deaf": ("--vehicle", "rocket", "--fault", "parachute-mute"),
    },
)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """runs(name): (exit code, stdout, stderr, folder of the logs), flown as it is asked for."""
    ends = {}

    def run(name):
        if name not in ends:
            together = {}
            for one, arguments in next(pair for pair in RUNS if name in pair).items():
                folder = tmp_path_factory.mktemp(one)
                together[one] = (start("--logs", str(folder), *arguments), folder)
            for one, (child, folder) in together.items():
                out, err = child.communicate(timeout=120.0)
                ends[one] = (child.returncode, out, err, folder)
        return ends[name]

    return run


def assert_in_this_order(story, out):
    places = [out.find(step) for step in story]
    assert -1 not in places, out
    assert places == sorted(places), out


def test_it_passes_from_the_block_to_the_touchdown(runs):
    code, out, err, _ = runs("good")
    assert code == 0, out + err
    story = [
        "no parachute yet",
        "armed, and disarmed at once: flight is blocked",
        "plugs the parachute in",
        "READY",
        "IN_FLIGHT",
        "MOTOR FAILURE at",
        "KILL by rule",
        "DEPLOY by rule",
        "CANOPY OPEN",
        "TOUCHDOWN",
        "DEMO PASSED",
    ]
    assert_in_this_order(story, out)
    assert "FLIGHT_BLOCK_RELEASE" in out


def test_its_summary_has_the_kill_before_the_release(runs):
    _, out, _, _ = runs("good")
    times = {
        name: float(seconds)
        for seconds, name in re.findall(r"^ +(\d+\.\d{3}) s  (.+)$", out, re.MULTILINE)
    }
    kill, release = times["kill on the wire"], times["release on the wire"]
    assert 0.0 < kill <= times["deploy decided"] <= release
    # Each is stamped in its own process, as it is read there.
    assert release <= times["parachute's own status: deployed"] + 0.05
    assert times["release acknowledged"] < 10.0


def test_it_keeps_the_logs_where_it_is_told_to(runs):
    logs = {file.name: file.read_text() for file in runs("good")[3].glob("*.log")}
    assert set(logs) == {f"{n}.log" for n in ("supervisor", "mavlink", "autopilot", "parachute")}
    assert "RELEASED by" in logs["parachute.log"]
    assert "DISARMED" in logs["autopilot.log"]
    assert not any("Traceback" in text for text in logs.values())


@pytest.mark.long
def test_with_a_upf_parachute_its_own_algorithm_fires_after_the_kill(runs):
    code, out, err, folder = runs("upf")
    assert code == 0, out + err
    story = [
        "upf_can 33 received",
        "upf_can 33 armed",
        "MOTOR FAILURE at",
        "KILL (upf_can 33: it is about to launch (TYPE_KILLSWITCH)",
        "KILL CONFIRMED",
        "its own status reports deployed",
        "CANOPY OPEN",
        "DEMO PASSED",
    ]
    assert_in_this_order(story, out)
    log = (folder / "upf.log").read_text()
    assert log.index("TYPE_KILLSWITCH answered: SUCCESS") < log.index("FIRED by")


def test_with_both_parachutes_the_first_of_the_ladder_is_enough(runs):
    code, out, err, folder = runs("both")
    assert code == 0, out + err
    assert "mavlink_parachute DEPLOY CONFIRMED" in out
    assert "RELEASED by" in (folder / "parachute.log").read_text()
    assert "FIRED by" not in (folder / "upf.log").read_text()


def test_a_rocket_flies_to_its_landing_under_the_canopies_that_were_called_for(runs):
    code, out, err, folder = runs("rocket")
    assert code == 0, out + err
    story = [
        "no cable yet",
        "launch refused",
        "READY",
        "Arming blocked: wipe flash first",
        "Flash wiped successfully.",
        "rocket            key armed",
        "drogue refused: the drogue is not fired on the ground",
        "needs an explicit confirmation",
        "rocket            LAUNCH",
        "IN_FLIGHT",
        "burnout at",
        "and no drogue",
        "KILL CONFIRMED: telemetry reports mav_open 0",
        "DEPLOY CONFIRMED: telemetry reports ssa_drogue_deployed 1",
        "MAIN at",
        "LANDED at",
        "DEMO PASSED",
    ]
    assert_in_this_order(story, out)
    logs = {file.name: file.read_text() for file in folder.glob("*.log")}
    assert set(logs) == {f"{n}.log" for n in ("supervisor", "umbilical", "rocket")}
    assert logs["rocket.log"].index("command <V>") < logs["rocket.log"].index("command <D>")
    assert not any("Traceback" in text for text in logs.values())


@pytest.mark.long
def test_a_rocket_that_takes_no_command_does_not_fly(runs):
    code, out, err, _ = runs("deaf")
    assert code == 1, out + err
    assert "DEMO FAILED: wiping: " in err
    assert "LAUNCH\n" not in out
    assert "Traceback" not in err


@pytest.mark.parametrize(
    "name", ["good", "both", "rocket", pytest.param("upf", marks=pytest.mark.long)]
)
def test_its_recording_decides_the_same_once_more(runs, name, monkeypatch):
    recordings = [*(runs(name)[3] / "ros_home").rglob("*.mcap")]
    assert recordings
    assert run(replay_command.main, monkeypatch, *recordings) == 0


def test_where_a_step_cannot_happen_it_fails_loudly(runs):
    code, out, err, _ = runs("bad")
    assert code == 1, out + err
    assert "DEMO FAILED: arming: " in err
    assert "DEMO PASSED" not in out
    assert "take off" not in out
    assert "Traceback" not in err


def test_ctrl_c_in_the_middle_ends_it_in_one_line():
    child = start()
    assert child.stdout is not None
    assert any("READY" in line for line in child.stdout)
    child.send_signal(signal.SIGINT)
    out, err = child.communicate(timeout=30.0)
    assert (child.returncode, err.strip()) == (130, "demo: interrupted"), out + err


def test_a_fault_that_is_none_is_refused(monkeypatch, capsys):
    _, errors = refused(demo_command, monkeypatch, capsys, "--fault", "everything")
    assert "parachute-silent" in errors


@pytest.mark.parametrize("name", ["/proc/x", "/proc", "file", "file/below"])
def test_a_folder_for_the_logs_that_cannot_be_is_told_in_one_line(
    name, tmp_path, monkeypatch, capsys
):
    """Not even root can write below /proc."""
    (tmp_path / "file").write_text("notes")
    folder = tmp_path / name
    out, err = refused(demo_command, monkeypatch, capsys, "--logs", str(folder))
    assert out == ""
    assert err.startswith(f"demo: --logs {folder}: ")
    assert err.endswith(": name a folder to write in\n")
    assert err.count("\n") == 1
    assert (tmp_path / "file").read_text() == "notes"
