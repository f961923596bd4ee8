"""Bytes of the umbilical to lines and dumps, whatever pieces they come in.

Between the marks of a flash dump the bytes are not lines: a CSV dump has no telemetry in it, a
binary one any bytes at all. The end mark may be lost when the flight computer's queue overflows;
then telemetry simply goes on, which ends the dump as well.

Sources: Umbilical Reference, section 3; the marks as the firmware sends them.
"""

from __future__ import annotations

import enum
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

#: Longest line, bytes; of a longer one only the end is looked at.
MOST_LINE = 8192
#: Longest $TELEM line that a dump is searched for, bytes.
_MOST_TELEM = 4096
_TELEM = b"$TELEM,"
_MARK = b"--- BEGIN"
_BEGIN = re.compile(rb"(?:^|(?<!\] ))--- BEGIN FLASH (CSV|BINARY) DUMP ---$")
_END = re.compile(rb"(?:\[INFO\] )?--- END FLASH (?:CSV|BINARY) DUMP ---")
_END_LONGEST = len(b"[INFO] --- END FLASH BINARY DUMP ---")
_TELEM_LINE = re.compile(rb"\$TELEM,([^\n]*)\n")

TOO_LONG = "line too long"
CUT_LINE = "cut line"


class DumpFormat(enum.Enum):
    """How a flash dump is written."""

    CSV = "csv"
    BINARY = "binary"


class Line(NamedTuple):
    """One line, without its end."""

    data: bytes


@dataclass(frozen=True)
class DumpBegan:
    """The begin mark came."""

    format: DumpFormat


@dataclass(frozen=True)
class DumpBytes:
    """The next bytes of the dump."""

    data: bytes


@dataclass(frozen=True)
class DumpEnded:
    """The dump is over. complete: its end mark came."""

    complete: bool


Item = Line | DumpBegan | DumpBytes | DumpEnded


class StreamReader:
    """One stream from its first byte on. is_telemetry: is this the body of a $TELEM line?"""

    def __init__(self, is_telemetry: Callable[[bytes], bool], counts: Counter[str]) -> None:
        self._is_telemetry = is_telemetry
        self._counts = counts
        self._buffer = b""
        self._cut = False
        #: From where on the buffer of a dump has not been searched for telemetry.
        self._searched = 0
        self.dumping = False

    def feed(self, data: bytes) -> list[Item]:
        """The next bytes; what they complete, in order."""
        self._buffer += data
        items: list[Item] = []
        while self._dump(items) if self.dumping else self._line(items):
            pass
        return items

    def end_dump(self) -> list[Item]:
        """The dump is given up: what was held back belongs to it."""
        if not self.dumping:
            return []
        held, self._buffer = self._buffer, b""
        self.dumping = False
        return [*([DumpBytes(held)] if held else []), DumpEnded(False)]

    # -- inside ----------------------------------------------------------------------------------

    def _line(self, items: list[Item]) -> bool:
        """Take one line off the buffer; False: there is none."""
        line, newline, rest = self._buffer.partition(b"\n")
        if len(line) > MOST_LINE:
            if not self._cut:
                self._counts[TOO_LONG] += 1
            line, self._cut = line[-MOST_LINE:], True
        if not newline:
            self._buffer = line
            return False
        self._buffer, self._cut = rest, False
        line = line.removesuffix(b"\r")
        begin = _BEGIN.search(line) if _MARK in line else None
        if begin is None:
            items.append(Line(line))
            return bool(rest)
        if begin.start():
            self._counts[CUT_LINE] += 1
        self.dumping, self._searched = True, 0
        items.append(DumpBegan(DumpFormat(begin[1].decode().lower())))
        return True

    def _dump(self, items: list[Item]) -> bool:
        """Take dump bytes off the buffer; False: the dump goes on."""
        end = _END.search(self._buffer)
        limit = end.start() if end else len(self._buffer)
        resumed = self._telemetry_before(limit)
        if resumed is not None:
            self._take(items, resumed)
            self.dumping = False
            items.append(DumpEnded(False))
            return True
        if end is not None:
            self._take(items, limit)
            self._buffer = self._buffer[end.end() - limit :]
            self.dumping = False
            items.append(DumpEnded(True))
            return True
        self._take(items, min(self._searched, self._last_safe()))
        return False

    def _telemetry_before(self, limit: int) -> int | None:
        """Where a line of telemetry stands in the dump; None: nowhere before limit."""
        while True:
            start = self._buffer.find(_TELEM, self._searched, limit)
            if start < 0:
                self._searched = max(self._searched, limit - len(_TELEM) + 1)
                return None
            line = _TELEM_LINE.match(self._buffer, start)
            if line is None and len(self._buffer) - start <= _MOST_TELEM:
                self._searched = start  # its end may still come
                return None
            short = line is not None and len(line[0]) <= _MOST_TELEM
            if line is not None and short and self._is_telemetry(line[1].removesuffix(b"\r")):
                return start
            self._searched = start + 1

    def _last_safe(self) -> int:
        """Up to here no end mark can have begun."""
        tail = max(0, len(self._buffer) - _END_LONGEST)
        for start in range(tail, len(self._buffer)):
            if self._buffer[start : start + 1] in (b"[", b"-"):
                return start
        return len(self._buffer)

    def _take(self, items: list[Item], count: int) -> None:
        """The first bytes of the buffer are the dump's."""
        if count > 0:
            items.append(DumpBytes(self._buffer[:count]))
            self._buffer = self._buffer[count:]
            self._searched = max(0, self._searched - count)
