"""Tells a person on standard error how far long work has come."""

from __future__ import annotations

import sys
import time

from chute_ros.plain_text import plain

#: Work that takes no longer (s) says nothing; after that this often.
_EVERY = 2.0


class Progress:
    """what: the work, in words, of which a file's name may be a part; whole: how much there is of
    it, in any unit."""

    def __init__(self, what: str, whole: int) -> None:
        self._what, self._whole = plain(what), max(1, whole)
        self._say_at = time.monotonic() + _EVERY

    def at(self, done: int) -> None:
        """So much is done."""
        if time.monotonic() >= self._say_at:
            self._say_at = time.monotonic() + _EVERY
            share = min(100, 100 * done // self._whole)
            print(f"{self._what}: {share} %", file=sys.stderr, flush=True)
