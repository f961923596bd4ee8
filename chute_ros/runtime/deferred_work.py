"""Deferred work after a decision: done once the device nodes had the processor.

To tell of a decision (log, safety/state, the file of what is remembered) takes the processor for
longer than to make it, and just when the device nodes need it (docs/evidence/speed.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack

#: A decision is on its wire this long (s) after it left, on a computer with two cores.
QUIET = 0.005


class DeferredWork:
    """Holds back what is to be told while those who carry a decision out are at work."""

    def __init__(self) -> None:
        self._steps: list[Callable[[], None]] = []
        #: Until when (monotonic s) nothing is told; infinity: it is told at once.
        self.until = math.inf

    @property
    def quiet(self) -> bool:
        """What is to be told waits."""
        return self.until < math.inf

    def decided(self, now: float) -> None:
        """A decision left. One that left just before does not make it longer."""
        self.until = min(self.until, now + QUIET)

    def tell(self, step: Callable[[], None]) -> None:
        """Do it now, or once it is no longer quiet, in order."""
        if self.quiet:
            self._steps.append(step)
        else:
            step()

    def look(self, now: float) -> None:
        """Tell what waits, if it has waited long enough."""
        if now < self.until:
            return
        self.until = math.inf
        steps, self._steps = self._steps, []
        with ExitStack() as each:  # whatever another one raises
            for step in reversed(steps):
                each.callback(step)
