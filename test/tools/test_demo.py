"""The demo flies end to end, and fails loudly where a step cannot happen.

Both run at the same time, which also shows that two runs side by side do not meet.
"""

import os
import re
import subprocess
import sys

import pytest


def start(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "chute_ros.tools.demo", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """(exit code, stdout, stderr, folder of the logs) of a good run and of a spoiled one."""
    good, bad = (tmp_path_factory.mktemp(name) for name in ("good", "bad"))
    children = (
        start("--logs", str(good)),
        start("--logs", str(bad), "--fault", "parachute-mute"),
    )
    ends = []
    for child, folder in zip(children, (good, bad), strict=True):
        out, err = child.communicate(timeout=120.0)
        ends.append((child.returncode, out, err, folder))
    return ends


def test_it_passes_from_the_block_to_the_touchdown(runs):
    code, out, err, _ = runs[0]
    assert code == 0, out + err
    story = [
        "no parachute yet",
        "armed, and disarmed at once: flight is blocked",
        "plugs the parachute in",
        "READY",
        "IN_FLIGHT",
        "MOTOR FAILURE at",
        "calls deploy",
        "CANOPY OPEN",
        "TOUCHDOWN",
        "DEMO PASSED",
    ]
    places = [out.find(step) for step in story]
    assert -1 not in places, out
    assert "FLIGHT_BLOCK_RELEASE" in out
    assert places == sorted(places), "in this order"


def test_its_summary_has_the_kill_before_the_release(runs):
    _, out, _, _ = runs[0]
    times = {
        name: float(seconds)
        for seconds, name in re.findall(r"^ +(\d+\.\d{3}) s  (.+)$", out, re.MULTILINE)
    }
    kill, release = times["kill on the wire"], times["release on the wire"]
    assert 0.0 < kill <= times["deploy decided"] <= release
    assert release <= times["parachute's own status: deployed"]
    assert times["release acknowledged"] < 10.0


def test_it_keeps_the_logs_where_it_is_told_to(runs):
    logs = {file.name: file.read_text() for file in runs[0][3].iterdir()}
    assert set(logs) == {f"{n}.log" for n in ("supervisor", "mavlink", "autopilot", "parachute")}
    assert "RELEASED by" in logs["parachute.log"]
    assert "FLIGHT TERMINATION" in logs["autopilot.log"]
    assert not any("Traceback" in text for text in logs.values())


def test_where_a_step_cannot_happen_it_fails_loudly(runs):
    code, out, err, _ = runs[1]
    assert code == 1, out + err
    assert "DEMO FAILED: arming: " in err
    assert "DEMO PASSED" not in out
    assert "take off" not in out
    assert "Traceback" not in err


def test_a_fault_that_is_none_is_refused():
    done = subprocess.run(
        [sys.executable, "-m", "chute_ros.tools.demo", "--fault", "everything"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "parachute-silent" in done.stderr
