"""Words that came over a wire, for a page."""

from __future__ import annotations

import html

from chute_ros.plain_text import plain


def escaped(text: object) -> str:
    """Plain, and as HTML and SVG need it, in text and in quotes."""
    return html.escape(plain(text), quote=True)
