"""Processes of the command conformance, and of what it tries."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[2]
SIMULATOR = [sys.executable, "-u", "-m"]
COMMAND = [*SIMULATOR, "chute_ros.tools.conformance"]


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


class Bench:
    """A simulated device, and the kit that tries it, by their command lines. plugged_first: the
    kit finds no wire before the device has told that it runs."""

    def __init__(
        self, device: Sequence[str], kit: Sequence[str], plugged_first: bool = False
    ) -> None:
        self._device, self._kit, self._plugged_first = device, kit, plugged_first

    @contextmanager
    def trying(self, *options: str) -> Iterator[subprocess.Popen[str]]:
        """The device runs; the kit."""
        with ExitStack() as both:
            device = both.enter_context(started(*SIMULATOR, *self._device))
            assert device.stdout is not None
            if self._plugged_first:
                device.stdout.readline()
            yield both.enter_context(started(*COMMAND, *self._kit, *options))

    def run(self, *options: str, typed: str = "") -> tuple[int, str, str]:
        """(exit code, output, errors) of the kit."""
        with self.trying(*options) as kit:
            out, errors = kit.communicate(typed, timeout=60.0)
            return kit.returncode, out, errors
