"""The height that each failure needs, as a picture."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from xml.sax.saxutils import escape

from chute_ros.campaign.heights import CaseFlights
from chute_ros.tools.pages import drawing

_WIDTH, _LEFT, _RIGHT, _TOP, _ROW, _BOTTOM = 880, 210, 110, 62, 34, 44
_BAR, _DOT = 18, 1.7
#: What takes the height: its colour.
_PARTS = {
    "until it is noticed": "#c98b2b",
    "until the release": "#8a3b3b",
    "until the canopy carries": "#6c9bd2",
}
_DOTS, _BOUND = "#1d2b3a", "#c0392b"


def picture(every: Sequence[CaseFlights], minimum_height: float) -> str:
    """As SVG, a row for each failure. minimum_height: of the rules, m; 0: they have none."""
    most = max((h for one in every for h in one.needed if math.isfinite(h)), default=0.0)
    tick = next(step for step in (5, 10, 20, 50) if most <= 10 * step)
    scale = (_WIDTH - _LEFT - _RIGHT) / (tick * math.ceil(most / tick + 1e-9) or tick)
    floor = _TOP + _ROW * len(every)
    parts = _legend() + _axis(tick, most, scale, floor)
    if minimum_height:
        parts.append(
            f'<rect x="{_LEFT}" y="{_TOP}" width="{minimum_height * scale:.1f}" '
            f'height="{floor - _TOP}" fill="#000" opacity="0.07"/>'
        )
    for row, found in enumerate(every):
        parts += _row(found, scale, _TOP + _ROW * row)
    return drawing(_WIDTH, floor + _BOTTOM, parts)


def _legend() -> list[str]:
    parts, x = [], _LEFT
    for words, colour in _PARTS.items():
        parts.append(f'<rect x="{x}" y="12" width="14" height="12" fill="{colour}"/>')
        parts.append(f'<text x="{x + 20}" y="22">{words}</text>')
        x += 30 + 7 * len(words)
    parts.append(f'<circle cx="{_LEFT + 7}" cy="40" r="2.5" fill="{_DOTS}"/>')
    parts.append(f'<text x="{_LEFT + 20}" y="44">one flight</text>')
    x = _LEFT + 100
    parts.append(_line(x, 34, x, 48, _BOUND, 3.0))
    parts.append(f'<text x="{x + 10}" y="44">bound (the table says for how many)</text>')
    x += 240
    parts.append(f'<rect x="{x}" y="34" width="14" height="12" fill="#000" opacity="0.07"/>')
    parts.append(f'<text x="{x + 20}" y="44">no rule releases as low as that</text>')
    return parts


def _axis(tick: int, most: float, scale: float, floor: float) -> list[str]:
    parts = []
    for number in range(max(1, math.ceil(most / tick + 1e-9)) + 1):
        x = _LEFT + number * tick * scale
        parts.append(_line(x, _TOP, x, floor, "#e4e4e4", 1.0))
        parts.append(
            f'<text x="{x:.1f}" y="{floor + 16}" text-anchor="middle">{number * tick}</text>'
        )
    middle = (_LEFT + _WIDTH - _RIGHT) / 2.0
    text = "height above the ground at the failure that is needed, m"
    parts.append(f'<text x="{middle:.1f}" y="{floor + 34}" text-anchor="middle">{text}</text>')
    return parts


def _row(found: CaseFlights, scale: float, top: float) -> list[str]:
    case, middle = found.case, top + _ROW / 2.0
    name = f"{case.name}, {case.flown}"
    parts = [f'<text x="{_LEFT - 8}" y="{middle + 4}" text-anchor="end">{escape(name)}</text>']
    x, bar = float(_LEFT), middle - _BAR / 2.0
    for colour, lost in zip(_PARTS.values(), _lost(found), strict=True):
        parts.append(
            f'<rect x="{x:.1f}" y="{bar:.1f}" width="{lost * scale:.1f}" height="{_BAR}" '
            f'fill="{colour}" opacity="0.75"/>'
        )
        x += lost * scale
    for number, height in enumerate(one.height for one in found.every if one.counts):
        if not 0.0 < height < math.inf:
            continue
        y = middle + (number % 5 - 2) * 3.2
        at = _LEFT + height * scale
        parts.append(
            f'<circle cx="{at:.1f}" cy="{y:.1f}" r="{_DOT}" fill="{_DOTS}" opacity="0.7"/>'
        )
    if math.isfinite(found.bound):
        at = _LEFT + found.bound * scale
        parts.append(_line(at, middle - 13, at, middle + 13, _BOUND, 3.0))
    lost = sum(math.isinf(h) for h in found.needed)
    if lost:
        share = "none saved" if lost == len(found.needed) else f"{lost} never saved"
        parts.append(f'<text x="{_WIDTH - _RIGHT + 8}" y="{middle + 4}">{share}</text>')
    return parts


def _lost(found: CaseFlights) -> list[float]:
    """The height that each part takes, m, in the mean of the flights from the least height."""
    parts = zip(*(fall.parts for fall in found.lowest), strict=True)
    return [statistics.mean(values) for values in parts] or [0.0] * len(_PARTS)


def _line(x: float, y: float, to_x: float, to_y: float, colour: str, wide: float) -> str:
    return (
        f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{to_x:.1f}" y2="{to_y:.1f}" stroke="{colour}" '
        f'stroke-width="{wide}"/>'
    )
