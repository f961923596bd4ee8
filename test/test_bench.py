"""The bench runs end to end and writes its table; how fast anything is, is not asserted."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROW = re.compile(
    r"^\| (to the [a-zA-Z ]+): (chute_ros|bare relay) \| ([\d.]+) ms \| ([\d.]+) ms "
    r"\| ([\d.]+) ms \| ([\d.]+) \|$",
    re.MULTILINE,
)


def rows(text):
    return {(m[1], m[2]): tuple(map(float, m.groups()[2:])) for m in ROW.finditer(text)}


def test_it_measures_both_hops_of_both_peers(tmp_path):
    output = tmp_path / "bench.md"
    command = [sys.executable, "-m", "bench.kill_switch", "--rounds", "3"]
    done = subprocess.run(
        [*command, "--output", str(output)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=120.0,
    )
    assert done.returncode == 0, done.stderr
    measured = rows(output.read_text())
    assert len(measured) == 4
    for median, late, largest, ratio in measured.values():
        assert 0.0 < median <= late <= largest
        assert ratio > 0.0
    assert "3 of 3 rounds" in done.stderr, "it says how far it is"


def test_what_is_in_docs_is_what_the_command_writes():
    assert len(rows((ROOT / "docs" / "bench.md").read_text())) == 4
