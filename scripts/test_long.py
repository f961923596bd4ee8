"""Run the tests that are long by nature (marked long), and write docs/evidence/long_tests.md.

Needs the environment sourced after a build: make test-long.
"""

from __future__ import annotations

import argparse
import datetime
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "evidence" / "long_tests.md"
_HEAD = """\
# Tests that are long by nature

Written by `make test-long`, which is run before a release; `make test` runs shorter forms of them.
Last run: {date}, commit {commit}, ROS 2 {distro}, {result}.

| test | result | s |
|---|---|---|
"""


def commit() -> str:
    """The commit that is tested, and whether the tree differs from it."""

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no")
    return git("rev-parse", "--short", "HEAD") + (" with changes" if changed else "")


def rows(result: ET.Element) -> list[tuple[str, str, float]]:
    """Name, result and seconds of each test, in order."""
    found = []
    for case in result.iter("testcase"):
        bad = {child.tag for child in case} & {"failure", "error", "skipped"}
        name = f"{case.get('classname')}::{case.get('name')}"
        found.append((name, bad.pop() if bad else "passed", float(case.get("time", 0.0))))
    return sorted(found)


def main() -> int:
    """Run them; the code to exit with."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "long.xml"
        command = [sys.executable, "-m", "pytest", "-m", "long", "-p", "no:cacheprovider"]
        jobs = ["--numprocesses", str(os.cpu_count()), "--dist", "loadgroup"]
        done = subprocess.run(
            [*command, *jobs, f"--junit-xml={told}", "test"], cwd=ROOT, check=False
        )
        if not told.is_file():
            return done.returncode or 1
        found = rows(ET.parse(told).getroot())
    passed = sum(result == "passed" for _, result, _ in found)
    result = f"{passed} passed, {len(found) - passed} failed"
    head = _HEAD.format(
        date=datetime.datetime.now(datetime.timezone.utc).date(),
        commit=commit(),
        distro=os.environ.get("ROS_DISTRO", "unknown"),
        result=result,
    )
    lines = [f"| `{name}` | {result} | {seconds:.0f} |" for name, result, seconds in found]
    PAGE.write_text(head + "\n".join(lines) + "\n")
    print(result)
    return int(passed < len(found) or not found)


if __name__ == "__main__":
    sys.exit(main())
