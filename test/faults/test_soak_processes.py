"""The soak keeps processes alive, reads what they write, takes descriptors, sets clocks."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from faults.soak_clock import WallClock
from faults.soak_faults import fill
from faults.soak_processes import Keeper

LIVES = """
import os, time
print("up", os.getpid(), flush=True)
while True:
    time.sleep(0.01)
"""
OPENS = """
import time
while True:
    try:
        open("/dev/null").close()
        print("opens", flush=True)
    except OSError as error:
        print("cannot", error.errno, flush=True)
    time.sleep(0.01)
"""


@pytest.fixture
def keeper(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("lives", LIVES), ("opens", OPENS)):
        (tmp_path / f"{name}.py").write_text(text)
    (tmp_path / "breaks.py").write_text("1 / 0")
    one = Keeper(tmp_path, {})
    yield one
    for child in one.children.values():
        child.process.kill()
        child.process.wait()


class Lines:
    """What was written, as it is read."""

    def __init__(self, keeper):
        self.keeper, self.all = keeper, []

    def look(self):
        new = self.keeper.look()
        self.keeper.note_troubles(new)
        self.all += new
        return self.all


def test_one_that_is_killed_is_started_again_and_is_no_finding(keeper, await_until):
    keeper.start("one", "lives")
    lines = Lines(keeper)
    await_until(lines.look, "it is up")
    first = keeper.pid("one")
    keeper.kill("one")
    assert not keeper.running()
    await_until(lambda: len(lines.look()) == 2, "it is up again")
    assert keeper.pid("one") != first
    assert keeper.children["one"].life == 2
    assert keeper.findings == []
    assert keeper.sample("one").memory > 1.0


def test_one_that_is_stopped_does_not_count_as_running(keeper, await_until):
    keeper.start("one", "lives")
    await_until(keeper.running, "it runs")
    keeper.signal("one", signal.SIGSTOP)
    await_until(lambda: not keeper.running(), "it is stopped")
    keeper.signal("one", signal.SIGCONT)
    await_until(keeper.running, "it goes on")


def test_one_that_ends_by_itself_is_a_finding_with_what_it_wrote(keeper, await_until):
    keeper.start("one", "breaks")
    lines = Lines(keeper)
    await_until(lambda: lines.look() and len(keeper.findings) > 1, "it is told")
    assert any("ended by itself with code 1" in one for one in keeper.findings)
    assert any("Traceback" in one for one in keeper.findings)


def test_one_without_descriptors_can_open_nothing_until_they_are_back(keeper, await_until):
    keeper.start("one", "opens")
    lines = Lines(keeper)
    await_until(lambda: ("one", "opens") in lines.look(), "it opens")
    keeper.exhaust_descriptors("one")
    await_until(lambda: ("one", "cannot 24") in lines.look(), "it cannot")
    keeper.restore_descriptors("one")
    lines.all.clear()
    await_until(lambda: ("one", "opens") in lines.look(), "it opens again")


def test_a_disk_is_filled_to_the_last_byte_and_no_further():
    """/dev/full takes nothing at all, as a full disk does."""
    fill(Path("/dev/full"))


def test_a_wall_clock_is_set_for_one_process_alone_and_its_monotonic_time_goes_on(tmp_path):
    clock = WallClock(tmp_path, "one")
    ask = "import time; input(); print(time.time(), time.monotonic())"
    with subprocess.Popen(
        [sys.executable, "-c", ask],
        env={**os.environ, **clock.environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        clock.set_by(-3600.0)
        said, _ = process.communicate("\n", timeout=20.0)
    wall, monotonic = map(float, said.split())
    assert wall == pytest.approx(time.time() - 3600.0, abs=20.0)
    assert monotonic == pytest.approx(time.monotonic(), abs=20.0)
    clock.close()
