"""What the processes of the soak held, loop by loop, as SVG."""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import escape

from faults.soak_report import OURS, Series, longest_lives
from faults.soak_run import Result

_WIDTH, _ROW, _LEFT = 720, 130, 60
_COLOURS = ("#27496d", "#b5651d", "#3a7d44", "#8e3b6f", "#5c5c5c")


def picture(results: Sequence[Result]) -> str:
    """Memory and descriptors of the longest lives over the loops, as SVG."""
    measures = (("memory", "MB"), ("descriptors", ""))
    height = len(measures) * _ROW + 30
    size = f'viewBox="0 0 {_WIDTH} {height}"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="12">',
        f'<rect width="{_WIDTH}" height="{height}" fill="white"/>',
    ]
    for number, name in enumerate(OURS):
        x = _LEFT + number * 130
        parts.append(
            f'<rect x="{x}" y="{height - 18}" width="10" height="10" fill="{_COLOURS[number]}"/>'
        )
        parts.append(f'<text x="{x + 14}" y="{height - 9}">{name}</text>')
    for row, (measure, unit) in enumerate(measures):
        parts += _curves(
            longest_lives(results, measure),
            f"{measure} {unit}",
            row * _ROW,
            max(1, len(results) - 1),
        )
    return "\n".join([*parts, "</svg>"]) + "\n"


def _curves(series: Series, title: str, top: float, last: int) -> list[str]:
    most = max((value for points in series.values() for _, value in points), default=1.0)
    floor, room, wide = top + _ROW - 12, _ROW - 40, _WIDTH - _LEFT - 20
    parts = [
        f'<text x="{_LEFT}" y="{top + 16}" font-weight="bold">{escape(title.strip())}</text>',
        f'<line x1="{_LEFT}" y1="{floor}" x2="{_LEFT + wide}" y2="{floor}" stroke="#333"/>',
        f'<text x="{_LEFT - 6}" y="{floor}" text-anchor="end">0</text>',
        f'<text x="{_LEFT - 6}" y="{floor - room + 4}" text-anchor="end">{most:.0f}</text>',
    ]
    for name, points in series.items():
        line = " ".join(
            f"{_LEFT + at / last * wide:.1f},{floor - value / most * room:.1f}"
            for at, value in points
        )
        colour = _COLOURS[OURS.index(name)]
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}"/>')
    return parts
