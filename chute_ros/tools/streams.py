"""The standard streams of a tool: what nobody can read ends no order and looks like no result."""

from __future__ import annotations

import io
import os
import sys
from typing import TextIO

_STDIN, _STDOUT, _STDERR = 0, 1, 2


class NotPrintedError(OSError):
    """Standard output takes nothing: a full disk, or its reader has gone. instead: what must be
    told all the same, on standard error; empty: nothing."""

    instead = ""


class _Output(io.TextIOWrapper):
    """Standard output."""

    def write(self, text: str) -> int:
        try:
            return super().write(text)
        except OSError as error:
            raise NotPrintedError(error.errno, error.strerror) from None

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            raise NotPrintedError(error.errno, error.strerror) from None


class _Complaints(io.TextIOWrapper):
    """Standard error: there is nowhere to tell that it takes nothing."""

    def write(self, text: str) -> int:
        try:
            return super().write(text)
        except OSError:
            _give_up(self)
            return len(text)

    def flush(self) -> None:
        try:
            super().flush()
        except OSError:
            _give_up(self)


def set_up_streams() -> None:
    """Before all else. Descriptors 0 to 2 that are closed become /dev/null: the next file that is
    opened would be one of them. From then on descriptor 1 is standard error, as ROS's middleware
    writes to it by itself; what a tool prints goes to standard output alone."""
    for number in (_STDIN, _STDOUT, _STDERR):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    if sys.stdin is None:
        sys.stdin = open(_STDIN, encoding="utf-8", closefd=False)  # noqa: SIM115
    flush()
    output = os.dup(_STDOUT)
    os.dup2(_STDERR, _STDOUT)
    # sys.__stdout__ as well: the width of the terminal is that of its descriptor.
    sys.stdout = sys.__stdout__ = _made(_Output, output, sys.stdout)  # type: ignore[misc]
    sys.stderr = _made(_Complaints, _STDERR, sys.stderr)


def flush() -> None:
    """NotPrintedError: what was printed cannot go where it should."""
    if sys.stdout is not None:
        sys.stdout.flush()


def give_up_output() -> None:
    """What is still to be printed goes nowhere, and complains no more."""
    _give_up(sys.stdout)


def _give_up(stream: TextIO) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def _made(
    kind: type[io.TextIOWrapper], descriptor: int, before: TextIO | None
) -> io.TextIOWrapper:
    """As Python made it, if it could."""
    raw = open(descriptor, "wb", closefd=False)  # noqa: SIM115
    complains = kind is _Complaints
    if not isinstance(before, io.TextIOWrapper):
        return kind(raw, "utf-8", "backslashreplace", line_buffering=complains)
    lines = complains or before.line_buffering or before.write_through
    return kind(raw, before.encoding, before.errors, line_buffering=lines)
