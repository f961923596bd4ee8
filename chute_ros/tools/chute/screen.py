"""The terminal as a full screen: only lines that changed are sent, so that it is readable over a
slow ssh."""

from __future__ import annotations

import os
import select
import shutil
import signal
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from rich.console import Console
from rich.text import Text

from chute_ros.interrupts import CtrlC
from chute_ros.tools.chute.status_text import StatusLine
from chute_ros.tools.chute.watch_text import KEYS, Page

#: The tones of timeline_rows.py in colours that the colour-blind can tell (Okabe and Ito).
_COLOURS = {
    "good": "#009e73", "warn": "#e69f00", "bad": "#d55e00", "act": "#cc79a7", "plain": "#56b4e9",
    "quiet": "#808080", "live": "#f0e442",
}  # fmt: skip
_GREY = "#808080"
#: So often all lines are sent (s): something else may have written to the terminal.
_ANEW = 10.0
#: Columns by which the second row of a line, and those after it, are moved in.
_HANGING = 8
#: The end of a line that needs more rows than it may take.
_CUT = " ..."
#: The exit code of what a SIGTERM ended, as shells have it.
_ENDED = 128 + signal.SIGTERM
_OPEN, _CLOSE = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"


class Screen:
    """Shows pages on standard output; use full_screen."""

    def __init__(self) -> None:
        self._drawn: list[str] = []
        self._size = (0, 0)
        self._all_at = 0.0

    def show(self, page: Page, now: float) -> None:
        """Send what differs from what is there. now: monotonic s."""
        size = shutil.get_terminal_size()
        whole = size != self._size or now >= self._all_at
        rows = _rows(page, *size)
        before = [] if whole else self._drawn
        parts = ["\x1b[2J"] if size != self._size else []
        for number, row in enumerate(rows):
            if number >= len(before) or before[number] != row:
                parts.append(f"\x1b[{number + 1};1H{row}\x1b[K")
        if parts:
            sys.stdout.write("".join(parts))
            sys.stdout.flush()
        self._drawn, self._size = rows, size
        if whole:
            self._all_at = now + _ANEW


def wants_to_quit() -> bool:
    """q was pressed."""
    if not sys.stdin.isatty() or not select.select([sys.stdin], [], [], 0.0)[0]:
        return False
    return b"q" in os.read(sys.stdin.fileno(), 100)


@contextmanager
def full_screen() -> Iterator[Screen]:
    """The terminal is as before at the end, whatever ends it."""
    keys = termios.tcgetattr(sys.stdin) if sys.stdin.isatty() else None
    before = signal.signal(signal.SIGTERM, CtrlC(error=partial(SystemExit, _ENDED)))
    try:
        if keys is not None:
            tty.setcbreak(sys.stdin)
        sys.stdout.write(_OPEN)
        yield Screen()
    finally:
        sys.stdout.write(_CLOSE)
        sys.stdout.flush()
        if keys is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, keys)
        signal.signal(signal.SIGTERM, before)


def _rows(page: Page, width: int, height: int) -> list[str]:
    """What each row of the terminal is sent, as many as it has."""
    console = Console(width=width, force_terminal=True, highlight=False, file=sys.stdout)
    colour = _GREY if page.grey else _COLOURS[page.banner.tone]
    style = f"bold white on {_GREY}" if page.grey else f"bold black on {colour}"
    rows = [Text(" " * width, style), _banner(page.banner.text, width, style)]
    rows.append(rows[0])
    for line in page.lines:
        rows += _wrapped(console, Text(line.text, _style(line, page.grey)), width, line.rows)
    most = max(1, height - 1)
    if len(rows) > most:
        left_out = len(rows) - most + 1
        rows[most - 1 :] = [Text(f"... {left_out} more rows: make the terminal taller", "bold")]
    rows += [Text("")] * (most - len(rows))
    rows.append(Text(f"{KEYS}", _GREY))
    return [_ansi(console, row) for row in rows[:height]]


def _wrapped(console: Console, text: Text, width: int, most: int) -> list[Text]:
    """As it is if it fits, else in a few rows that show that they belong together; one that is cut
    ends with a sign of it."""
    if text.cell_len <= width or width <= 2 * _HANGING:
        return list(text.wrap(console, width))[:most]
    if most == 1:
        text.truncate(width, overflow="ellipsis")
        return [text]
    rows = list(text.wrap(console, width - _HANGING))
    if len(rows) > most:
        rows = rows[:most]
        rows[-1].truncate(width - _HANGING - len(_CUT))
        rows[-1].append(_CUT)
    for row in rows[1:]:
        row.pad_left(_HANGING)
    return rows


def _banner(words: str, width: int, style: str) -> Text:
    text = Text(words, style)
    text.truncate(width)
    text.align("center", width)
    return text


def _style(line: StatusLine, grey: bool) -> str:
    if grey:
        return _GREY
    if line.tone == "head":
        return "bold"
    # Most lines are as they should be: colour is for those that are not.
    return "default" if line.tone in ("plain", "good") else _COLOURS[line.tone]


def _ansi(console: Console, row: Text) -> str:
    with console.capture() as captured:
        console.print(row, end="", no_wrap=True, overflow="crop", crop=True)
    return captured.get()
