"""The HTML of all reports: a page that needs nothing else (no script, no font, no picture), and
its parts. Texts are escaped here, or by the caller where inner HTML is asked. Without ROS."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from chute_ros.tools.timeline import escaped
from chute_ros.tools.timeline_rows import STYLE as TIMELINE_STYLE

_STYLE = """
:root { color-scheme: light dark; --page:#f4f6f8; --card:#ffffff; --text:#1c2733; --dim:#5b6b7b;
  --edge:#dfe5ea; --good:#2f9e5b; --warn:#b97d0c; --bad:#cc3d3d; --quiet:#7c8a97;
  --plain:#2f74c0; --act:#8a4fc4; }
@media (prefers-color-scheme: dark) { :root { --page:#0b1015; --card:#11181f; --text:#e6edf3;
  --dim:#9fb0c0; --edge:#2b3742; --good:#46bd77; --warn:#dda03a; --bad:#f06a6a; --quiet:#8795a3;
  --plain:#5b9ee8; --act:#b184f0; } }
@media print { :root { --page:#fff; --card:#fff; --text:#000; --dim:#444; --edge:#ccc; }
  section { break-inside: avoid-page; } tr { break-inside: avoid; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--text);
  font: 14px/1.45 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 20px 16px 40px; }
h1 { font-size: 22px; margin: 4px 0 2px; } h2 { font-size: 16px; margin: 0 0 10px; }
h3 { font-size: 14px; margin: 14px 0 4px; }
p { margin: 4px 0; } .dim { color: var(--dim); }
section { background: var(--card); border: 1px solid var(--edge); border-radius: 8px;
  padding: 14px 16px; margin: 14px 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 5px 10px 5px 0;
  border-bottom: 1px solid var(--edge); overflow-wrap: break-word; }
td.words { overflow-wrap: anywhere; min-width: 14em; }
th { color: var(--dim); font-weight: 600; font-size: 12px; }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; text-align: right; }
td.motion { white-space: nowrap; }
td.blank { width: 60%; height: 2.4em; }
td ul { margin: 0; padding-left: 16px; }
b.good { color: var(--good); } b.warn { color: var(--warn); } b.bad { color: var(--bad); }
b.quiet { color: var(--quiet); } b.plain { color: var(--plain); } b.act { color: var(--act); }
code { font: 12px/1.4 ui-monospace, "DejaVu Sans Mono", monospace; overflow-wrap: anywhere; }
summary { cursor: pointer; }
"""


def document(title: str, parts: Sequence[str]) -> str:
    """A whole page with these parts, which needs nothing else. title: plain."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escaped(title)}</title>\n<style>{_STYLE}{TIMELINE_STYLE}</style>\n</head>\n"
        f"<body>\n<main>\n{''.join(parts)}</main>\n</body>\n</html>\n"
    )


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
