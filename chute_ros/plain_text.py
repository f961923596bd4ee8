"""Words for a log, a terminal or a message that people read, also those that came over a wire."""

from __future__ import annotations


def plain(text: object) -> str:
    r"""One line without what would move a cursor, colour a terminal or begin another line: each
    character that cannot be seen is written out, as \x1b, \n or \u202e."""
    words = str(text)
    if words.isprintable():
        return words
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode() for one in words
    )


def span_text(seconds: float) -> str:
    """A span of time in the unit that suits it."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    if seconds < 7200.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.0f} h" if seconds < 172800.0 else f"{seconds / 86400.0:.0f} days"
