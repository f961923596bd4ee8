"""Words that came over a wire, for a terminal or a page."""

from __future__ import annotations

import html


def plain(text: object) -> str:
    """One line without what would move a cursor: control characters are written out."""
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode() for one in str(text)
    )


def escaped(text: object) -> str:
    """The same for HTML and SVG, in text and in quotes."""
    return html.escape(plain(text), quote=True)
