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
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "evidence" / "long_tests.md"
_HEAD = """\
# Tests that are long by nature

Written by `make test-long`, which is run before a release; `make test` runs shorter forms of them.
Last run: {date}, commit {commit}, ROS 2 {distro}, {result}.

| test | passed | failed | s |
|---|---|---|---|
"""


def commit() -> str:
    """The commit that is tested, and whether the tree differs from it."""

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no")
    return git("rev-parse", "--short", "HEAD") + (" with changes" if changed else "")


class Row(NamedTuple):
    """All tests of one function. skipped and errors count as failed."""

    name: str
    passed: int
    failed: int
    seconds: float

    def text(self) -> str:
        """Of the page's table."""
        return f"| `{self.name}` | {self.passed} | {self.failed} | {self.seconds:.0f} |"


def rows(result: ET.Element) -> list[Row]:
    """A row for each function, in order."""
    found: dict[str, Row] = {}
    for case in result.iter("testcase"):
        name = f"{case.get('classname')}::{case.get('name', '').partition('[')[0]}"
        name = name.partition("@")[0]
        bad = bool({child.tag for child in case} & {"failure", "error", "skipped"})
        _, passed, failed, seconds = found.get(name, Row(name, 0, 0, 0.0))
        seconds += float(case.get("time", 0.0))
        found[name] = Row(name, passed + (not bad), failed + bad, seconds)
    return sorted(found.values())


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
    failed = sum(row.failed for row in found)
    result = f"{sum(row.passed for row in found)} passed, {failed} failed"
    head = _HEAD.format(
        date=datetime.datetime.now(datetime.timezone.utc).date(),
        commit=commit(),
        distro=os.environ.get("ROS_DISTRO", "unknown"),
        result=result,
    )
    PAGE.write_text(head + "\n".join(row.text() for row in found) + "\n")
    print(result)
    return int(failed > 0 or not found)


if __name__ == "__main__":
    sys.exit(main())
