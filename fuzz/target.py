"""What is fuzzed: one reader of foreign bytes each, with what must hold whatever it reads."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import FrameType
from typing import Any, Protocol

from fuzz.size import size_of

#: No input may take longer, s of the processor: far more than any does, also under the
#: instruments of a fuzzer.
LONGEST_TIME = 4.0
#: So many variations of an input are fed to one instance to see whether it grows.
VARIATIONS = 40


class WrongError(Exception):
    """What must not be: said by a target of the reader that it watches."""


class HangError(BaseException):
    """An input took too long. No Exception, so that no reader can take it for its own."""


class Subject(Protocol):
    """One instance of a reader, and what watches it."""

    def feed(self, data: bytes) -> None:
        """Have it read one input; WrongError, or whatever the reader raises: a finding."""

    def held(self) -> object:
        """What must not grow."""


@dataclass(frozen=True)
class Target:
    """begin: makes an instance; most: the size that it may have at the end of a long life, by
    size.py, 0: that is not looked at; longest: of an input, bytes."""

    name: str
    what: str
    begin: Callable[[], Subject]
    most: int
    longest: int = 1024


def attempt(target: Target, data: bytes) -> float:
    """Have a new instance read data. How long it took, s of the processor."""
    began = time.process_time()
    with _Limit(LONGEST_TIME):
        target.begin().feed(data)
    return time.process_time() - began


def live_long(target: Target, data: bytes, variations: int = VARIATIONS) -> int:
    """Have one instance read data and many variations of it. Its size then; WrongError: it is
    larger than it may be."""
    subject = target.begin()
    for one in varied(data, variations):
        with _Limit(LONGEST_TIME):
            subject.feed(one)
    return check_size(target, subject)


def check_size(target: Target, subject: Subject) -> int:
    """The size of an instance; WrongError: it is larger than it may be."""
    size = size_of(subject.held()) if target.most else 0
    if size > target.most:
        raise WrongError(f"grows: it holds {size} objects, {target.most} are allowed")
    return size


def varied(data: bytes, times: int) -> Iterator[bytes]:
    """data, then the same with other bytes here and there: other ids, names and numbers."""
    for number in range(times):
        changed = bytearray(data)
        for at in range(number % 7, len(changed), 7) if number else ():
            changed[at] = (changed[at] + number) % 256
        yield bytes(changed)


class _Limit:
    """Raises HangError in whatever takes longer, s of the processor."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._before: Any = None

    def __enter__(self) -> None:
        self._before = signal.signal(signal.SIGVTALRM, self._over)
        signal.setitimer(signal.ITIMER_VIRTUAL, self._seconds)

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, self._before)

    def _over(self, number: int, frame: FrameType | None) -> None:
        raise HangError(f"hangs: it is not done after {self._seconds:g} s of the processor")
