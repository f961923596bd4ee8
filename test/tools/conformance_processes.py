"""Processes of the command conformance, and of what it tries."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[2]
COMMAND = [sys.executable, "-u", "-m", "chute_ros.tools.conformance"]


@contextmanager
def started(
    *arguments: str, environment: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[str]]:
    """A process that is gone afterwards. environment: None: that of the tests."""
    pipe = subprocess.PIPE
    one = subprocess.Popen(
        arguments, stdin=pipe, stdout=pipe, stderr=pipe, text=True, cwd=ROOT, env=environment
    )
    with one:
        try:
            yield one
        finally:
            one.kill()
