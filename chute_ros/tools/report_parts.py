"""Parts of a report's HTML. Texts are escaped here, or by the caller where inner HTML is asked."""

from __future__ import annotations

from collections.abc import Iterable

from chute_ros.tools.flight_story import Asked
from chute_ros.tools.timeline import escaped


def section(heading: str, inner: str) -> str:
    """A card with a heading."""
    return f"<section>\n<h2>{escaped(heading)}</h2>\n{inner}\n</section>\n"


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table of cells that are HTML; without rows the word none."""
    body = "".join(f"<tr>{''.join(cells)}</tr>\n" for cells in rows)
    if not body:
        return '<p class="dim">none</p>'
    head = "".join(f"<th>{escaped(one)}</th>" for one in heads)
    return (
        f'<div class="wide"><table>\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}</tbody></table></div>"
    )


def cell(inner: str) -> str:
    """A cell of a table."""
    return f"<td>{inner}</td>"


def words(inner: str) -> str:
    """A cell with text of any length: it may be parted anywhere."""
    return f'<td class="words">{inner}</td>'


def number(text: str) -> str:
    """A cell with a number."""
    return f'<td class="number">{escaped(text)}</td>'


def listing(texts: Iterable[str]) -> str:
    """A list of texts; empty without any."""
    items = "".join(f"<li>{escaped(one)}</li>" for one in texts)
    return f"<ul>{items}</ul>" if items else ""


def answer_of(asked: Asked) -> str:
    """The answer to a request."""
    if asked.answer is None:
        return '<span class="dim">no answer</span>'
    after, finish = asked.answer
    tone, word = ("good", "success") if finish.success else ("bad", "no success")
    accepted = ", accepted" if finish.accepted else ""
    told = f'<b class="{tone}">{word}</b>{accepted} after {after:.3f} s: '
    return told + escaped(finish.message)
