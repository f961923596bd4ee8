"""The command without a binary, with a wrong one, and what it lists."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent


def sitl(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sitl", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def test_without_a_binary_it_says_what_to_give_and_fails():
    done = sitl("--runs", "3", "--page")
    assert done.returncode == 2
    assert "no autopilot to fly" in done.stderr
    assert (
        'make sitl AUTOPILOT="/path/to/arducopter /path/to/arduplane /path/to/px4"' in done.stderr
    )


def test_a_wrong_file_and_an_unknown_story_are_refused(tmp_path):
    done = sitl(str(tmp_path / "none"))
    assert done.returncode == 2
    assert "no file that can be executed" in done.stderr
    binary = tmp_path / "arducopter"
    binary.write_bytes(b"ArduCopter V4.6.0")
    binary.chmod(0o755)
    done = sitl("--stories", "block", "loop", "--", str(binary))
    assert done.returncode == 2
    assert "no story is called loop" in done.stderr
    done = sitl("--keep", str(tmp_path), str(binary))
    assert (done.returncode, done.stderr) == (
        2,
        f"sitl: --keep {tmp_path} is not empty: name a new folder for these records\n",
    )


def test_it_lists_every_story_with_the_autopilots_that_fly_it():
    done = sitl("--list")
    assert done.returncode == 0
    rows = done.stdout.splitlines()
    assert any(row.startswith("motor-30 ") and "PX4" in row for row in rows)
    assert len({row.split()[0] for row in rows}) == len(rows) > 30
