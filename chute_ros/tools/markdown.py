"""Markdown that tools write: tables, and pages of which each part is written by itself."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Without a line end behind it."""
    return "\n".join([_row(head), "|---" * len(head) + "|", *map(_row, rows)])


def _row(cells: Sequence[str]) -> str:
    return "|" + "|".join(f" {one} " if one else " " for one in cells) + "|"


def with_part(page: str, what: str, name: str, text: str, order: Iterable[str]) -> str:
    """The parts of a page with this one written anew; the others as page has them, if it has them.
    what: the word in their marks; order: the names of all that there are."""
    pieces = re.split(rf"^<!-- {what} (\w+) -->\n", page, flags=re.MULTILINE)
    parts = {**dict(zip(pieces[1::2], pieces[2::2], strict=True)), name: text}
    every = [(one, parts[one].rstrip("\n")) for one in order if one in parts]
    return "\n".join(f"<!-- {what} {one} -->\n{part}\n" for one, part in every)
