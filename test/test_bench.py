"""The bench runs end to end and writes its table; how fast anything is, is not asserted."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
COMMAND = [sys.executable, "-m", "bench.kill_switch"]
PEERS = ("chute_ros", "ROS alone", "bare relay")
HOPS = ("to the kill on MAVLink", "to the answer on the bus")
NUMBER = r"(\d+\.\d+)"
ROW = re.compile(
    rf"^\| (to the [a-zA-Z ]+): ([a-zA-Z_ ]+) \| {NUMBER} ms \| {NUMBER} ms \| {NUMBER} ms "
    rf"\| {NUMBER} \| {NUMBER} \| (\d+) \|$",
    re.MULTILINE,
)


def rows(text):
    return {(m[1], m[2]): tuple(map(float, m.groups()[2:])) for m in ROW.finditer(text)}


def check(text):
    """The whole file is of the form that the command writes; how many requests it is of."""
    measured = rows(text)
    assert set(measured) == {(hop, peer) for hop in HOPS for peer in PEERS}
    assert text.count("\n|") == len(measured) + 2, "no other rows"
    for (_, peer), (median, late, largest, *ratios, _missed) in measured.items():
        assert 0.0 < median <= late <= largest
        assert all(ratio > 0.0 for ratio in ratios)
        if peer == "bare relay":
            assert ratios == [1.0, 1.0]
    for peer in PEERS:
        assert measured[HOPS[0], peer][0] <= measured[HOPS[1], peer][0], "first the kill"
    assert re.search(r"^.+, \d+ cores; Linux \S+; Python 3\.\S+; ROS 2 \w+\.$", text, re.M)
    assert re.search(r"^Load before the run: \d+\.\d ", text, re.M)
    assert re.search(
        r"Kills that came: chute_ros \d+, ROS alone \d+, bare relay \d+\.$", text, re.M
    )
    return int(re.search(r"^(\d+) requests to each, taking turns, in one run", text, re.M)[1])


def test_it_measures_both_hops_of_all_peers(tmp_path):
    output = tmp_path / "bench.md"
    done = subprocess.run(
        [*COMMAND, "--requests", "5", "--output", str(output)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=150.0,
    )
    assert done.returncode == 0, done.stderr
    assert check(output.read_text()) == 5
    assert output.read_text() in done.stdout, "it prints what it writes"
    assert "5 of 5 rounds" in done.stderr, "it says how far it is"


def test_what_is_in_docs_is_what_the_command_writes():
    text = (ROOT / "docs" / "bench.md").read_text()
    # Of fewer the 99th percentile would be the largest.
    assert check(text) >= 200
    # All but the numbers and the machine's line is the command's own text.
    program = (
        "from types import SimpleNamespace\n"
        "from bench.kill_switch import BARE, OURS, ROS, Peer, report\n"
        "from bench.wire_ends import Round\n"
        "ends, rounds = SimpleNamespace(kills=0), [Round(1.0, 2.0)]\n"
        "print(report([Peer(name, ends, rounds) for name in (OURS, ROS, BARE)], '0.0'), end='')\n"
    )
    made = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert words(made.stdout) == words(text)


def words(text):
    """A report without what differs from run to run: the machine's line and all numbers."""
    lines = [line for line in text.splitlines() if " cores; Linux " not in line]
    return re.sub(r"\d+(\.\d+)?", "N", "\n".join(lines))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_its_children_end_with_it(tmp_path, number):
    marker = f"CHUTE_ROS_BENCH_TEST_{os.getpid()}_{number.value}"
    child = subprocess.Popen(
        [*COMMAND, "--output", str(tmp_path / "bench.md")],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, marker: "1"},
    )
    end = time.monotonic() + 30.0
    settled = 0
    while settled < 25:  # all there, and none is just being started
        settled = settled + 1 if len(running(marker)) >= 8 else 0
        assert child.poll() is None, child.stderr.read()
        assert time.monotonic() < end, f"the peers are not all there: {running(marker)}"
        time.sleep(0.02)
    child.send_signal(number)
    _, said = child.communicate(timeout=60.0)
    assert child.returncode == 1, said
    assert "Traceback" not in said
    while left := running(marker):
        assert time.monotonic() < end + 30.0, f"still there: {left}"
        time.sleep(0.02)
    assert not (tmp_path / "bench.md").exists()


def running(marker):
    """Processes that have this in their environment: the bench and its children."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if marker.encode() in (folder / "environ").read_bytes():
                found.append(folder.name)
        except OSError:
            pass  # it has just ended, or is somebody else's
    return found


@pytest.mark.parametrize("wrong", [("--requests", "1"), ("--output", "/nowhere/at/all.md")])
def test_a_mistake_is_said_before_anything_is_started(wrong):
    done = subprocess.run(
        [*COMMAND, *wrong], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert wrong[0] in done.stderr.splitlines()[-1]
