"""The command without a binary, with a wrong one, and what it lists."""

import subprocess
import sys
from pathlib import Path

import pytest

from sitl.__main__ import main

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture
def refused(monkeypatch, capsys):
    """What the command says to a mistake, before it sets anything up."""

    def call(*arguments):
        monkeypatch.setattr("sys.argv", ["sitl", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 2
        return capsys.readouterr().err

    return call


def test_without_a_binary_it_says_what_to_give_and_fails(refused):
    said = refused("--runs", "3", "--page")
    assert "no autopilot to fly" in said
    assert 'make sitl AUTOPILOT="/path/to/arducopter /path/to/arduplane /path/to/px4"' in said


def test_a_wrong_file_and_an_unknown_story_are_refused(tmp_path, refused):
    assert "no file that can be executed" in refused(tmp_path / "none")
    binary = tmp_path / "arducopter"
    binary.write_bytes(b"ArduCopter V4.6.0")
    binary.chmod(0o755)
    assert "no story is called loop" in refused("--stories", "block", "loop", "--", binary)
    assert refused("--keep", tmp_path, binary) == (
        f"sitl: --keep {tmp_path} is not empty: name a new folder for these records\n"
    )


def test_it_lists_every_story_with_the_autopilots_that_fly_it():
    command = [sys.executable, "-m", "sitl", "--list"]
    rows = subprocess.check_output(command, cwd=ROOT, text=True).splitlines()
    assert any(row.startswith("motor-30 ") and "PX4" in row for row in rows)
    assert len({row.split()[0] for row in rows}) == len(rows) > 30
