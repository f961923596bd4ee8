"""The bytes of an input read as choices: what to say, what to ask for, how long to wait."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

_Kind = TypeVar("_Kind")


class Program:
    """Reads on from the first byte; what is missing at the end is 0."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    @property
    def over(self) -> bool:
        """All of it was read."""
        return self._at >= len(self._data)

    def byte(self) -> int:
        """One byte."""
        return self.some(1)[0]

    def flag(self) -> bool:
        """By the lowest bit of one byte."""
        return bool(self.byte() & 1)

    def whole(self, size: int) -> int:
        """A whole number of so many bytes, with its sign."""
        return int.from_bytes(self.some(size), "little", signed=True)

    def some(self, size: int) -> bytes:
        """So many bytes."""
        taken = self._data[self._at : self._at + size]
        self._at += size
        return taken.ljust(size, b"\0")

    def piece(self) -> bytes:
        """As many bytes as its first byte says, if there are so many."""
        size = self.byte()
        taken = self._data[self._at : self._at + size]
        self._at += size
        return taken

    def rest(self) -> bytes:
        """All that is left."""
        taken, self._at = self._data[self._at :], len(self._data)
        return taken

    def choice(self, options: Sequence[_Kind]) -> _Kind:
        """One of these."""
        return options[self.byte() % len(options)]
