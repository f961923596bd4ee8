"""Ctrl-C while a process only imports: then there is nothing that must be ended."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def at_ctrl_c(end: Callable[..., Any] | signal.Handlers) -> Iterator[None]:
    """A Ctrl-C goes to end meanwhile: Python's own way would tell where in an import it was. Where
    who started us wants something else of it, that stays."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
