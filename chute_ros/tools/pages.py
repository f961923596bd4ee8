"""Pages that tools write: tables, pictures, what they tell of many values, their parts, and files
that are up to date or not."""

from __future__ import annotations

import argparse
import math
import re
import statistics
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Without a line end behind it."""
    return "\n".join([_row(head), "|---" * len(head) + "|", *map(_row, rows)])


def _row(cells: Sequence[str]) -> str:
    return "|" + "|".join(f" {one} " if one else " " for one in cells) + "|"


def drawing(width: int, height: float, parts: Iterable[str]) -> str:
    """These parts on white, as a file of SVG."""
    size = f'viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>'
    ground = f'<rect width="{width}" height="{height}" fill="white"/>'
    return "\n".join([head, ground, *parts, "</svg>"]) + "\n"


def summary(values: Sequence[float]) -> tuple[float, float, float]:
    """Median, 99th percentile (nearest rank: of fewer than 100 the largest), largest."""
    ordered = sorted(values)
    return statistics.median(ordered), ordered[math.ceil(0.99 * len(ordered)) - 1], ordered[-1]


def with_part(page: str, what: str, name: str, text: str, order: Iterable[str]) -> str:
    """The parts of a page with this one written anew; the others as page has them, if it has them.
    what: the word in their marks; order: the names of all that there are."""
    pieces = re.split(rf"^<!-- {what} (\w+) -->\n", page, flags=re.MULTILINE)
    parts = {**dict(zip(pieces[1::2], pieces[2::2], strict=True)), name: text}
    every = [(one, parts[one].rstrip("\n")) for one in order if one in parts]
    return "\n".join(f"<!-- {what} {one} -->\n{part}\n" for one, part in every)


def write_or_check(
    program: str, about: str | None, texts: Callable[[], Mapping[Path, str]]
) -> None:
    """Write these files of the repository in the present folder; with --check only name those
    that are out of date, and exit with 1."""
    options = argparse.ArgumentParser(program, description=about)
    options.add_argument("--check", action="store_true", help="write nothing")
    check = options.parse_args().check
    every = texts()
    old = [str(p) for p, text in every.items() if not p.is_file() or p.read_text() != text]
    if check and old:
        sys.exit(f"out of date: {', '.join(old)}; run: make docs")
    if not check:
        for path, text in every.items():
            path.write_text(text)
