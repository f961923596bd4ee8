"""Ctrl-C while a process only imports, and while what must be ended is being made."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


@contextmanager
def at_ctrl_c(
    end: Callable[..., Any] | signal.Handlers, also: Iterable[signal.Signals] = ()
) -> Iterator[None]:
    """A Ctrl-C goes to end meanwhile: Python's own way would tell where in an import it was. also:
    what else ends us, and goes there as well. Where who started us wants something else of one,
    that stays."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, *also)}
    ours = {number for number, handler in before.items() if _is_usual(number, handler)}
    for number in ours:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, before[number])


def _is_usual(number: signal.Signals, handler: object) -> bool:
    usual = signal.default_int_handler if number is signal.SIGINT else signal.SIG_DFL
    return handler is usual or isinstance(handler, CtrlC)


class CtrlC:
    """A handler of SIGINT that raises KeyboardInterrupt, as Python's own does, but may be held.

    last_resort: called so many seconds later, in a thread of its own, where that was swallowed on
    its way or the end itself hangs.
    """

    def __init__(self, last_resort: tuple[float, Callable[[], Any]] | None = None) -> None:
        self._held, self._last_resort = False, last_resort
        #: Somebody pressed it.
        self.came = False

    def install(self) -> None:
        """Where who started us wants something else of it, that stays."""
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Python calls this, in the main thread."""
        if self._last_resort is not None and not self.came:
            timer = threading.Timer(*self._last_resort)
            timer.daemon = True
            timer.start()
        self.came = True
        if not self._held:
            raise KeyboardInterrupt

    @contextmanager
    def held(self) -> Iterator[None]:
        """It comes afterwards: what has begun and nobody knows yet would never be ended."""
        self._held = True
        try:
            yield
        finally:
            self._held = False
        if self.came:
            raise KeyboardInterrupt
