"""A timeline as SVG: bands of states, curves with their units, counters and numbered marks, one
below the other over one axis of time. Nothing in it moves or is fetched from elsewhere."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

from chute_ros.plain_text import plain
from chute_ros.tools.timeline_axis import (
    is_long,
    label_of,
    nice_steps,
    thinned,
    time_label,
    time_steps,
    within,
)
from chute_ros.tools.timeline_rows import Band, Curve, Level, Marks, Row, Window

WIDTH = 1000
LEFT, RIGHT = 190, 22
#: Heights, px.
_BAND, _CURVE, _LEVEL, _LANE, _GAP, _AXIS = 22, 110, 34, 17, 9, 40
#: Of the numbers at a curve, px.
_NUMBERS = 52
_LETTER = 6.6  # px, of the text in bands and labels
#: Marks at the same place stand below one another in this many lanes at most.
_LANES = 8
#: A curve is not drawn over a gap in its values that is longer, s.
_CURVE_GAP = 5.0


def draw(rows: Sequence[Row], windows: Sequence[Window], about: str) -> str:
    """One <svg> with these rows, once for each window. about: what it shows, in words."""
    y, groups = 0.0, []
    for window in windows:
        sheet = _Sheet(window)
        for row in rows:
            sheet.add(row)
        groups.append(f'<g transform="translate(0 {y:.0f})">\n{sheet.drawn()}\n</g>')
        y += sheet.height
    space = 'xmlns="http://www.w3.org/2000/svg"'
    return "\n".join(
        [
            f'<svg {space} class="timeline" role="img" viewBox="0 0 {WIDTH} {y:.0f}">',
            f"<title>{escaped(about)}</title>",
            *groups,
            "</svg>",
        ]
    )


def escaped(text: object) -> str:
    """Words that came over a wire: plain, and as HTML and SVG need them, in text and in quotes."""
    return html.escape(plain(text), quote=True)


def close_up(moments: Sequence[float], end: float) -> list[Window]:
    """The window around these moments (s), if it shows more than all from 0 to end does."""
    if not moments:
        return []
    around = max(0.5, (max(moments) - min(moments)) / 2)
    start, stop = max(0.0, min(moments) - around), min(end, max(moments) + around)
    return [Window("close up", start, stop)] if stop - start < end / 3 else []


class _Sheet:
    """Grows downwards, row by row."""

    def __init__(self, window: Window) -> None:
        self._start, self._end = window.start, max(window.end, window.start + 1e-3)
        self._parts = [_text(LEFT, 14, window.title, "soft", "start")]
        #: x, from y, tone: of lines that go down to the end.
        self._drops: list[tuple[float, float, str]] = []
        self._y = 24.0

    @property
    def height(self) -> float:
        """With the axis, px."""
        return self._y + _AXIS

    def add(self, row: Row) -> None:
        if isinstance(row, Band):
            self._band(row)
        elif isinstance(row, Curve):
            self._curve(row)
        elif isinstance(row, Level):
            self._level(row)
        else:
            self._marks(row)
        self._y += _GAP

    def drawn(self) -> str:
        """All of it, with the axis below."""
        bottom, span = self._y, self._end - self._start
        behind = []
        for at in time_steps(self._start, self._end):
            x = self._x(at)
            behind.append(_line(x, 20, x, bottom, "grid"))
            behind.append(_text(x, bottom + 13, time_label(at, span), "soft", "middle"))
        unit = "min:s" if is_long(span) else "s"
        middle = (LEFT + WIDTH - RIGHT) / 2
        behind.append(_text(middle, bottom + 28, f"time from the start, {unit}", "soft", "middle"))
        drops = [_line(x, y, x, bottom, f"drop {tone}") for x, y, tone in self._drops]
        return "\n".join([*behind, *drops, *self._parts])

    def _x(self, at: float) -> float:
        share = (at - self._start) / (self._end - self._start)
        return LEFT + min(1.0, max(0.0, share)) * (WIDTH - RIGHT - LEFT)

    def _shown(self, start: float, end: float) -> bool:
        return end >= self._start and start <= self._end

    def _label(self, text: str, height: float, unit: str = "") -> None:
        right = LEFT - (_NUMBERS if unit else 10)
        most = int((right - 4) / _LETTER)
        short = text if len(text) <= most else f"{text[: most - 1]}…"
        y = self._y + height / 2 + (-2 if unit else 4)
        self._parts.append(_text(right, y, short, "", "end", text))
        if unit:
            self._parts.append(_text(right, y + 14, unit, "soft", "end"))

    def _band(self, band: Band) -> None:
        self._label(band.label, _BAND)
        for one in band.segments:
            if not self._shown(one.start, one.end):
                continue
            x, right = self._x(one.start), self._x(one.end)
            wide = max(right - x, 1.2)  # a moment can be seen, too
            tip = f"{band.label}: {one.text}, {one.start:.3f} to {one.end:.3f} s"
            self._parts.append(
                f'<rect x="{x:.1f}" y="{self._y:.1f}" width="{wide:.1f}" height="{_BAND}" rx="2" '
                f'class="{one.tone}"><title>{escaped(tip)}</title></rect>'
            )
            if len(one.text) * _LETTER + 4 <= wide:
                self._parts.append(_text(x + wide / 2, self._y + 15, one.text, "inside", "middle"))
        self._y += _BAND

    def _curve(self, curve: Curve) -> None:
        points = within(curve.points, self._start, self._end)
        known = [value for _, value in points if math.isfinite(value)]
        low, high = (min(known), max(known)) if known else (0.0, 0.0)
        steps = nice_steps(min(low, 0.0), max(high, 0.0), 4)
        low, high = min(low, steps[0]), max(high, steps[-1])
        inner = _CURVE - 12

        def y_of(value: float) -> float:
            return self._y + 6 + inner * (1 - (value - low) / (high - low))

        self._label(curve.label, _CURVE, f"{curve.unit}")
        for step in steps:
            y = y_of(step)
            self._parts.append(_line(LEFT, y, WIDTH - RIGHT, y, "grid"))
            self._parts.append(_text(LEFT - 6, y + 4, label_of(step, steps), "soft", "end"))
        path, last = [], -math.inf
        for at, value in thinned(points, self._start, self._end):
            if not math.isfinite(value):
                last = -math.inf
                continue
            command = "L" if at - last <= _CURVE_GAP else "M"
            path.append(f"{command}{self._x(at):.1f} {y_of(value):.1f}")
            last = at
        if path:
            self._parts.append(f'<path class="line" d="{"".join(path)}"/>')
        else:
            self._nothing(_CURVE)
        self._y += _CURVE

    def _level(self, level: Level) -> None:
        self._label(level.label, _LEVEL)
        points = within(level.points, self._start, self._end, steps=True)
        bottom, inner = self._y + _LEVEL, _LEVEL - 6
        path: list[str] = []
        x = y = 0.0
        for at, share in thinned(points, self._start, self._end):
            x = self._x(at)
            # A counter keeps its value until it says another.
            path.append(f"H{x:.1f}" if path else f"M{x:.1f} {bottom:.1f}")
            y = bottom - inner * min(1.1, max(0.0, share))
            path.append(f"V{y:.1f}")
        if path:
            path.append(f"V{bottom:.1f}Z")
            self._parts.append(f'<path class="warn" d="{"".join(path)}"/>')
        top = bottom - inner
        self._parts.append(_line(LEFT, top, WIDTH - RIGHT, top, "limit"))
        self._parts.append(_line(LEFT, bottom, WIDTH - RIGHT, bottom, "grid"))
        self._y += _LEVEL

    def _marks(self, row: Marks) -> None:
        ends = [-math.inf] * _LANES
        used = 1
        placed = []
        for mark in sorted(row.marks, key=lambda one: one.at):
            if not self._shown(mark.at, mark.at):
                continue
            x = self._x(mark.at)
            half = max(8.0, len(mark.sign) * _LETTER / 2 + 4)
            middle = min(max(x, LEFT + half), WIDTH - RIGHT - half)
            lane = next((n for n, end in enumerate(ends) if middle - half >= end), None)
            if lane is not None:
                ends[lane] = middle + half + 1
                used = max(used, lane + 1)
            placed.append((mark, x, middle, half, lane))
        self._label(row.label, used * _LANE)
        for mark, x, middle, half, lane in placed:
            y = self._y + (lane or 0) * _LANE
            self._drops.append((x, y + _LANE - 1, mark.tone))
            if lane is None:
                continue  # too many in one place: the line stands for it
            self._parts.append(
                f"<g><title>{escaped(f'{mark.at:.3f} s: {mark.text}')}</title>"
                f'<rect x="{middle - half:.1f}" y="{y:.1f}" width="{2 * half:.1f}" '
                f'height="{_LANE - 2}" rx="7" class="{mark.tone}"/>'
                + _text(middle, y + 11.5, mark.sign, "inside", "middle")
                + "</g>"
            )
        if not placed:
            self._nothing(_LANE)
        self._y += used * _LANE

    def _nothing(self, height: float) -> None:
        self._parts.append(_text(LEFT + 40, self._y + height / 2 + 4, "nothing", "soft", "start"))


def _text(x: float, y: float, text: str, style: str, anchor: str, tip: str = "") -> str:
    named = f' class="{style}"' if style else ""
    where = f'x="{x:.1f}" y="{y:.1f}"'
    title = f"<title>{escaped(tip)}</title>" if tip and tip != text else ""
    return f'<text {where}{named} text-anchor="{anchor}">{title}{escaped(text)}</text>'


def _line(x: float, y: float, right: float, bottom: float, style: str) -> str:
    return f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{right:.1f}" y2="{bottom:.1f}" class="{style}"/>'
