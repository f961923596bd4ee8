"""False against missed as limits move, and delays of each guard, as pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.sax.saxutils import escape

from chute_ros.campaign.comparison import FACTORS, Compared
from chute_ros.campaign.guards import GUARDS, OURS
from chute_ros.tools.compare_page import shares
from chute_ros.tools.pages import drawing

_WIDTH, _HEIGHT, _LEFT, _TOP, _RIGHT, _BOTTOM = 760, 360, 60, 36, 200, 46
#: By guard, in their order; ours is the thick one.
_COLOURS = ("#c0392b", "#27496d", "#6c9bd2", "#1e7b4f", "#7fc8a0", "#8a6d3b")
#: What the axes of the curves name, %; they are drawn by their roots, so that few are seen.
_PERCENTS = (0.0, 1.0, 5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 100.0)
#: Delays are drawn up to this, s.
_LONGEST = 8

Points = Sequence[tuple[float, float]]


def curves(lines: Sequence[Compared]) -> str:
    """As SVG: a point for each factor, a panel for each profile."""
    panels = []
    for number, profile in enumerate(_profiles(lines)):
        told = [
            [(k, one) for k in FACTORS if (one := shares(lines, profile, guard.name, k))]
            for guard in GUARDS
        ]
        falsest = max((one[1] for points in told for _, one in points), default=0.0)
        most = next(percent for percent in _PERCENTS if percent >= max(10.0, falsest))
        panel = _Panel(f"{profile}: limits scaled by {FACTORS[0]:g} to {FACTORS[-1]:g}", number)
        for percent in _PERCENTS:
            panel.tick_y(math.sqrt(percent / 100.0), f"{percent:g}")
            if percent <= most:
                panel.tick_x(math.sqrt(percent / most), f"{percent:g}")
        panel.axes("false, % of all flights", "missed or late, % of those in need")
        # Ours is on top.
        for guard, colour, points in reversed(list(zip(GUARDS, _COLOURS, told, strict=True))):
            at = [(math.sqrt(f / most), math.sqrt(m / 100.0)) for _, (m, f) in points]
            panel.line(at, colour, guard is OURS)
            for (x, y), (factor, _) in zip(at, points, strict=True):
                panel.dot(x, y, colour, 5.0 if factor == 1.0 else 2.5)
        panels += panel.parts
    return drawing(_WIDTH, max(1, len(_profiles(lines))) * _HEIGHT, panels)


def delays(lines: Sequence[Compared]) -> str:
    """As SVG: the share of those in need that is released within a time, a panel for each
    profile."""
    panels = []
    plain = [one for one in lines if one.factor == 1.0]
    for number, profile in enumerate(_profiles(lines)):
        panel = _Panel(f"{profile}: released of those that only a parachute saves", number)
        for second in range(_LONGEST + 1):
            panel.tick_x(second / _LONGEST, f"{second}")
        for percent in range(0, 101, 20):
            panel.tick_y(percent / 100.0, f"{percent}")
        panel.axes("s from the failure to the release", "released, %")
        for guard, colour in reversed(list(zip(GUARDS, _COLOURS, strict=True))):
            of = [one for one in plain if (one.profile, one.guard) == (profile, guard.name)]
            panel.line(_steps(of), colour, guard is OURS)
        panels += panel.parts
    return drawing(_WIDTH, max(1, len(_profiles(lines))) * _HEIGHT, panels)


def _profiles(lines: Sequence[Compared]) -> list[str]:
    return sorted({one.profile for one in lines})


def _steps(of: Sequence[Compared]) -> Points:
    """Up at each release, as parts of the axes."""
    needed = max(1, sum(one.needed for one in of))
    released = sorted(one.delay for one in of if one.delay <= _LONGEST)
    points = [(0.0, 0.0)]
    for number, delay in enumerate(released):
        x = max(0.0, delay) / _LONGEST
        points += [(x, number / needed), (x, (number + 1) / needed)]
    return [*points, (1.0, len(released) / needed)]


class _Panel:
    """One of some, one below the other; positions are parts of its axes, 0 to 1."""

    def __init__(self, title: str, number: int) -> None:
        self._top = number * _HEIGHT + _TOP
        self._wide, self._high = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
        self.parts = [
            f'<text x="{_LEFT}" y="{self._top - 14}" font-weight="bold">{escape(title)}</text>'
        ]
        for row, (guard, colour) in enumerate(zip(GUARDS, _COLOURS, strict=True)):
            x, y = _WIDTH - _RIGHT + 20, self._top + 12 + row * 20
            self.parts.append(
                f'<line x1="{x}" y1="{y - 4}" x2="{x + 24}" y2="{y - 4}" stroke="{colour}" '
                f'stroke-width="{3.5 if guard is OURS else 1.8}"/>'
                f'<text x="{x + 30}" y="{y}">{escape(guard.name)}</text>'
            )

    def _at(self, x: float, y: float) -> tuple[float, float]:
        return _LEFT + x * self._wide, self._top + (1.0 - y) * self._high

    def tick_x(self, x: float, text: str) -> None:
        """A number below the axis."""
        at, floor = self._at(x, 0.0)
        self.parts.append(
            f'<text x="{at:.1f}" y="{floor + 16:.1f}" text-anchor="middle">{text}</text>'
        )

    def tick_y(self, y: float, text: str) -> None:
        """A number beside the axis, and a line."""
        left, at = self._at(0.0, y)
        self.parts.append(
            f'<text x="{left - 6:.1f}" y="{at + 4:.1f}" text-anchor="end">{text}</text>'
            f'<line x1="{left:.1f}" y1="{at:.1f}" x2="{left + self._wide:.1f}" y2="{at:.1f}" '
            'stroke="#e4e4e4"/>'
        )

    def axes(self, below: str, beside: str) -> None:
        """What they are of."""
        left, floor = self._at(0.0, 0.0)
        middle = self._top + self._high / 2.0
        self.parts.append(
            f'<text x="{left + self._wide / 2.0:.1f}" y="{floor + 34:.1f}" '
            f'text-anchor="middle">{escape(below)}</text>'
            f'<text x="14" y="{middle:.1f}" text-anchor="middle" '
            f'transform="rotate(-90 14 {middle:.1f})">{escape(beside)}</text>'
            f'<polyline points="{left:.1f},{self._top} {left:.1f},{floor:.1f} '
            f'{left + self._wide:.1f},{floor:.1f}" fill="none" stroke="#333"/>'
        )

    def line(self, points: Points, colour: str, thick: bool) -> None:
        """From point to point."""
        drawn = " ".join("{:.1f},{:.1f}".format(*self._at(x, y)) for x, y in points)
        self.parts.append(
            f'<polyline points="{drawn}" fill="none" stroke="{colour}" '
            f'stroke-width="{3.5 if thick else 1.8}"/>'
        )

    def dot(self, x: float, y: float, colour: str, radius: float) -> None:
        """At a point."""
        at, level = self._at(x, y)
        self.parts.append(f'<circle cx="{at:.1f}" cy="{level:.1f}" r="{radius}" fill="{colour}"/>')
