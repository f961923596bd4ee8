"""Runs targets under libFuzzer, each in a process of its own, and reads what it says."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from fuzz.child import FOUND, LARGEST, SLOWEST
from fuzz.stored import store, unpack

HERE = Path(__file__).resolve().parent
#: Ignored by git: what runs add to it, and what they find.
GROWN, FOUND_FOLDER = HERE / "grown", HERE / "found"
#: A process larger than this is a finding, MB; so is an input that takes longer than this, s, in
#: code that is not Python's.
MOST_MEMORY, HANGS_AFTER = 2048, 120
#: Where files cost no disk.
_MEMORY = Path("/dev/shm")
#: How long it may take besides, on a busy machine, s.
_PATIENCE = 900
_STATUS = re.compile(r"^#\d+\s+(\w+)\s+cov: (\d+) ft: (\d+) corp: (\d+)/\S+ .*?rss: (\d+)Mb", re.M)
_RUNS = re.compile(r"^stat::number_of_executed_units:\s*(\d+)", re.M)
_PEAK = re.compile(r"^stat::peak_rss_mb:\s*(\d+)", re.M)
_ARTIFACT = re.compile(r"Test unit written to (\S+)")


@dataclass
class Outcome:
    """What became of one target. slowest: ms of the processor; largest: entries of the largest
    store of one instance, by size.py; memory: of the process at the start and at most, MB."""

    name: str
    seconds: float
    inputs: int = 0
    edges: int = 0
    features: int = 0
    new: int = 0
    slowest: float = 0.0
    largest: int = 0
    memory: tuple[int, int] = (0, 0)
    found: list[Path] = field(default_factory=list)
    #: Why it ended before its time; empty: it did not.
    died: str = ""

    def line(self) -> str:
        """For whoever watches."""
        end = f"{len(self.found)} findings" if self.found else "nothing found"
        return (
            f"{self.name}: {self.inputs} inputs, {self.edges} edges, {self.new} new entries, "
            f"slowest {self.slowest:.0f} ms, {self.memory[1]} MB: {self.died or end}"
        )


def why_not() -> str:
    """Why there can be no fuzzing here; empty: there can."""
    try:
        import atheris  # type: ignore[import-untyped]
    except ImportError as error:
        version = ".".join(map(str, sys.version_info[:2]))
        return (
            f"atheris cannot be imported by Python {version} ({error}): it has wheels for Linux "
            "on x86_64 and Python 3.10 to 3.13; call make fuzz, or rm -r .venv-fuzz if Python "
            "has changed since"
        )
    return "" if atheris else "atheris is empty"


def fuzz(name: str, seconds: int) -> Outcome:
    """Fuzz one target for so long."""
    grown = GROWN / name
    grown.mkdir(parents=True, exist_ok=True)
    before = {one.name for one in grown.iterdir()}
    with tempfile.TemporaryDirectory(prefix="fuzz_stored_") as begins_with:
        unpack(name, Path(begins_with))
        said, code = _child(
            name,
            f"-max_total_time={seconds}",
            f"-timeout={HANGS_AFTER}",
            # Otherwise each that takes ten seconds is written as if it were a finding.
            f"-report_slow_units={HANGS_AFTER}",
            f"-rss_limit_mb={MOST_MEMORY}",
            f"-artifact_prefix={FOUND_FOLDER / name}/",
            # Long inputs from the first: a program of few bytes gets nowhere.
            "-len_control=0",
            "-print_final_stats=1",
            str(grown),
            begins_with,
            patience=seconds + _PATIENCE,
        )
    outcome = outcome_of(name, seconds, said, code)
    outcome.new = len({one.name for one in grown.iterdir()} - before)
    return outcome


def outcome_of(name: str, seconds: float, said: str, code: int) -> Outcome:
    """What libFuzzer and our own lines say of a run."""
    outcome = Outcome(name, seconds)
    statuses = _STATUS.findall(said)
    if statuses:
        outcome.edges, outcome.features = int(statuses[-1][1]), int(statuses[-1][2])
        peak = _PEAK.search(said)
        outcome.memory = (int(statuses[0][4]), int(peak[1]) if peak else int(statuses[-1][4]))
    runs = _RUNS.search(said)
    outcome.inputs = int(runs[1]) if runs else 0
    for line in said.splitlines():
        if line.startswith(FOUND):
            outcome.found.append(Path(line.removeprefix(FOUND)))
        elif line.startswith(SLOWEST):
            outcome.slowest = float(line.removeprefix(SLOWEST))
        elif line.startswith(LARGEST):
            outcome.largest = int(line.removeprefix(LARGEST))
    outcome.found += [Path(one) for one in _ARTIFACT.findall(said)]
    if code != 0 or not runs:
        last = next((one for one in reversed(said.splitlines()) if one.strip()), "nothing said")
        outcome.died = f"it died (code {code}): {last.strip()[:200]}"
    return outcome


def merge(name: str) -> tuple[int, int]:
    """Replace the stored corpus by the least that covers as much as it and what runs added; inputs
    and bytes of it then."""
    with (
        tempfile.TemporaryDirectory(prefix="fuzz_merge_") as folder,
        tempfile.TemporaryDirectory(prefix="fuzz_stored_") as before,
    ):
        unpack(name, Path(before))
        old = [before, *([str(GROWN / name)] if (GROWN / name).is_dir() else [])]
        # By edges alone: how often each is taken would make it ten times as large.
        said, code = _child(name, "-merge=1", "-use_counters=0", folder, *old, patience=_PATIENCE)
        inputs = [one.read_bytes() for one in Path(folder).iterdir()]
        if code != 0 or not inputs:
            raise RuntimeError(f"{name} cannot be merged (code {code}): {said[-500:]}")
    store(name, inputs)
    return len(inputs), sum(map(len, inputs))


def _child(name: str, *arguments: str, patience: float) -> tuple[str, int]:
    """What a process with one target says, and how it ends."""
    found = FOUND_FOLDER / name
    found.mkdir(parents=True, exist_ok=True)
    memory = _MEMORY if _MEMORY.is_dir() else None
    with (
        tempfile.TemporaryDirectory(prefix="fuzz_call_") as folder,
        tempfile.TemporaryDirectory(prefix="fuzz_", dir=memory) as left,
    ):
        call = Path(folder) / name
        command = shlex.join([sys.executable, "-m", "fuzz.child", str(call), name, str(found)])
        call.write_text(f'#!/bin/sh\nexec {command} "$@"\n')
        call.chmod(0o700)
        try:
            done = subprocess.run(
                [str(call), *arguments],
                cwd=HERE.parent,
                # libFuzzer ends it in the middle of things: what it leaves goes with the folder.
                env={**os.environ, "TMPDIR": left},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                timeout=patience,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            told = (error.stdout or b"").decode(errors="replace")
            return f"{told}\nit was not done after {patience:.0f} s", -1
    return done.stdout.decode(errors="replace"), done.returncode
