"""How long it took and how much height was lost, by vehicle and profile, as a picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape

from chute_ros.campaign.campaign import FlightSummary
from chute_ros.tools.pages import drawing

#: Bars of each.
_BARS = 60
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 720, 150, 50, 30


class _Axis(NamedTuple):
    """What is drawn, up to where, with a number at each tick; rockets fall longer and deeper."""

    title: str
    span: float
    tick: float
    for_rocket: float


_AXES = {
    "release_delay": _Axis("s from the failure to the release", 3.0, 0.5, 4.0),
    "height_lost": _Axis("m of height lost before the release", 60.0, 10.0, 5.0),
}


def groups_of(lines: Iterable[FlightSummary]) -> dict[str, list[FlightSummary]]:
    """By vehicle and profile, in a fixed order."""
    groups: dict[str, list[FlightSummary]] = {}
    for line in sorted(lines, key=lambda one: (one.profile, one.vehicle, one.seed)):
        name = line.vehicle if line.vehicle == line.profile else f"{line.vehicle}, {line.profile}"
        groups.setdefault(name, []).append(line)
    return groups


def picture(lines: Sequence[FlightSummary], what: str) -> str:
    """As SVG. what: a number of a line that is known for each."""
    groups = groups_of(lines)
    parts: list[str] = []
    for number, (name, some) in enumerate(groups.items()):
        axis = _AXES[what]
        scale = axis.for_rocket if name == "rocket" else 1.0
        values = [getattr(line, what) for line in some]
        parts += _bars(f"{name}: {len(some)}, {axis.title}", values, axis, scale, number * _HEIGHT)
    return drawing(_WIDTH, max(1, len(groups)) * _HEIGHT, parts)


def _bars(title: str, values: Sequence[float], axis: _Axis, scale: float, top: float) -> list[str]:
    counts, span = [0] * _BARS, axis.span * scale
    for value in values:
        counts[min(_BARS - 1, max(0, int(value / span * _BARS)))] += 1
    most, wide = max(counts), (_WIDTH - _LEFT - 20) / _BARS
    floor, room = top + _HEIGHT - _BOTTOM, _HEIGHT - _BOTTOM - 30
    parts = [f'<text x="{_LEFT}" y="{top + 18}" font-weight="bold">{escape(title)}</text>']
    for number, count in enumerate(counts):
        tall = room * count / most
        parts.append(
            f'<rect x="{_LEFT + number * wide:.1f}" y="{floor - tall:.1f}" '
            f'width="{wide - 1:.1f}" height="{tall:.1f}" fill="#27496d"/>'
        )
    ticks = round(axis.span / axis.tick)
    for tick in range(ticks + 1):
        x = _LEFT + tick / ticks * wide * _BARS
        more = " and more" if tick == ticks else ""
        text = f"{tick * axis.tick * scale:g}{more}"
        parts.append(f'<text x="{x:.1f}" y="{floor + 16}" text-anchor="middle">{text}</text>')
    parts.append(
        f'<line x1="{_LEFT}" y1="{floor}" x2="{_WIDTH - 20}" y2="{floor}" stroke="#333"/>'
    )
    parts.append(f'<text x="{_LEFT - 6}" y="{top + 42}" text-anchor="end">{most}</text>')
    return parts
