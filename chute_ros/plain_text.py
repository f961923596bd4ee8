"""Words that came over a wire or from ROS, for a log, a terminal or a message that people read."""

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
