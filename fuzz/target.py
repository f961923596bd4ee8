"""What is fuzzed: one reader of foreign bytes each, with what must hold whatever it reads."""

from __future__ import annotations

import itertools
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import FrameType
from typing import Any, Protocol

from fuzz.size import stores_of

#: No input may take longer, s of the processor: far more than any does, also under the
#: instruments of a fuzzer.
LONGEST_TIME = 4.0
#: A store of a reader or link has so many entries at most, unless its target says otherwise.
MOST_ENTRIES = 256
#: After so many variations of an input it is looked at for the first time what an instance holds;
#: then after twice as many, and so on while it grows.
_FIRST_LOOK = 5
#: A store that a bound ends soon slows down; one that grows so much with each variation does not.
_GROWTH = 0.5
#: No instance lives longer for that, s of the processor.
_LONGEST_LIFE = 20.0


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
    """begin: makes an instance; most: entries that a store of it may have, 0: that is not looked
    at; longest: of an input, bytes; larger: the places, by size.py, of stores that may have more
    than the others, and how many."""

    name: str
    what: str
    begin: Callable[[], Subject]
    most: int = MOST_ENTRIES
    longest: int = 1024
    larger: Mapping[str, int] = field(default_factory=dict)


def attempt(target: Target, data: bytes) -> float:
    """Have a new instance read data. How long it took, s of the processor."""
    began = time.process_time()
    with _Limit(LONGEST_TIME):
        target.begin().feed(data)
    return time.process_time() - began


def live_long(target: Target, data: bytes) -> int:
    """Have one instance read data and variations of it for as long as it grows with them. The
    entries of its largest store then; WrongError: it never stops."""
    end = time.process_time() + _LONGEST_LIFE
    subject = target.begin()
    look, before = _FIRST_LOOK, dict[str, int]()
    for number, one in enumerate(varied(data), 1):
        with _Limit(LONGEST_TIME):
            subject.feed(one)
        over = time.process_time() > end
        if number < look and not over:
            continue
        stores = check_size(target, subject)
        grew = max((size - before.get(place, 0) for place, size in stores.items()), default=0)
        if over or (look > _FIRST_LOOK and grew < _GROWTH * look / 2):
            break
        look, before = 2 * look, stores
    return max(stores.values(), default=0)


def check_size(target: Target, subject: Subject) -> dict[str, int]:
    """Where an instance holds something, and how many entries; WrongError: more than it may."""
    stores = stores_of(subject.held()) if target.most else {}
    for place, entries in stores.items():
        most = target.larger.get(place, target.most)
        if entries > most:
            raise WrongError(f"grows: {place} has {entries} entries, {most} are allowed")
    return stores


def varied(data: bytes) -> Iterator[bytes]:
    """data, then the same with other bytes here and there: other ids, names and numbers. They come
    again after some two thousand."""
    for number in itertools.count():
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
