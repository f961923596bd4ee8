"""Ctrl-C while a process only imports, and while what must not be cut in two is being done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
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
    """A handler of a signal that raises KeyboardInterrupt, as Python's own of SIGINT does, but may
    be held.

    last_resort: called so many seconds later, in a thread of its own, where that was swallowed on
    its way or the end itself hangs. error: what it raises instead.
    """

    def __init__(
        self,
        last_resort: tuple[float, Callable[[], Any]] | None = None,
        error: Callable[[], BaseException] = KeyboardInterrupt,
    ) -> None:
        self._held, self._last_resort, self._error = False, last_resort, error
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
            raise self._error()

    @contextmanager
    def held(self) -> Iterator[None]:
        """It comes afterwards: what has begun and nobody knows yet would never be ended."""
        before, self._held = self._held, True
        try:
            yield
        finally:
            self._held = before
        if self.came and not before:
            raise self._error()


def once_more() -> None:
    """A Ctrl-C that came and did not end what it should is raised again: Python drops what is
    raised while an object is being deleted. For loops that run for hours."""
    handler = signal.getsignal(signal.SIGINT)
    if isinstance(handler, CtrlC):
        with handler.held():
            pass


@contextmanager
def in_one_piece() -> Iterator[None]:
    """What ends this process comes afterwards, if a CtrlC takes it: raised where rclpy makes one
    of its objects it leaves half of it behind, which complains when it is collected."""
    ends = {signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    with ExitStack() as held:
        for one in ends:
            if isinstance(one, CtrlC):
                held.enter_context(one.held())
        yield
