"""Draws the stages of a flight as SVG: boxes at fixed places, arrows from the table between them.

What all stages on the ground have in common leaves their frame as one arrow, and every RESET is a
line in its box, since all lead to STARTUP: drawn one by one, they would cover the rest.
"""

from __future__ import annotations

import itertools
import math
from xml.sax.saxutils import escape

from chute_ros.supervisor.machine import ON_GROUND, TRANSITIONS, Stage, StageEvent

Point = tuple[float, float]

_WIDTH, _HEIGHT = 1170, 740
_BOX = (132.0, 52.0)
#: The middle of each box.
_PLACES: dict[Stage, Point] = {
    Stage.STARTUP: (110, 190),
    Stage.BLOCKED: (370, 85),
    Stage.READY: (370, 295),
    Stage.ARMED: (600, 190),
    Stage.LANDED: (780, 190),
    Stage.IN_FLIGHT: (1080, 190),
    Stage.KILLING: (1080, 500),
    Stage.DEPLOYING: (640, 570),
    Stage.DEPLOYED: (110, 500),
    Stage.FAULT: (640, 690),
}
#: Left, top, right, bottom of the frame round the stages on the ground.
_FRAME = (20.0, 35.0, 870.0, 365.0)
#: Corners of the arrows that are not straight.
_CORNERS: dict[tuple[Stage, Stage], tuple[Point, ...]] = {
    (Stage.LANDED, Stage.BLOCKED): ((780, 85),),
    (Stage.LANDED, Stage.READY): ((780, 295),),
    (Stage.IN_FLIGHT, Stage.DEPLOYED): ((1030, 420), (150, 420)),
    (Stage.FAULT, Stage.DEPLOYED): ((110, 690),),
    (Stage.FAULT, Stage.KILLING): ((1080, 690),),
    (Stage.DEPLOYING, Stage.DEPLOYED): ((150, 570),),
    (Stage.KILLING, Stage.DEPLOYING): ((1040, 570),),
}
#: Where an arrow leaves the frame, and its corner.
_EXITS: dict[Stage, tuple[Point, Point]] = {
    Stage.IN_FLIGHT: ((870, 85), (1080, 85)),
    Stage.KILLING: ((870, 335), (1045, 335)),
}
#: Two arrows between the same boxes run this far apart.
_APART = 24.0
_STYLE = """\
  <style>
    text { font: 12px sans-serif; text-anchor: middle; }
    .name { font-weight: bold; font-size: 13px; }
    .label, .inside { font-size: 11px; }
    .label { paint-order: stroke; stroke: white; stroke-width: 5px; }
    .box { fill: #eef3fb; stroke: #27496d; stroke-width: 1.5; }
    .air { fill: #fdf0e3; stroke: #8a4b08; }
    .frame { fill: #fafafa; stroke: #777; stroke-dasharray: 6 4; }
    .arrow { fill: none; stroke: #333; stroke-width: 1.2; marker-end: url(#head); }
    .inside { fill: #555; }
  </style>
  <defs>
    <marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8"
        orient="auto-start-reverse"><path d="M0 0L10 5L0 10z" fill="#333"/></marker>
  </defs>
"""


def drawing() -> str:
    """The whole of docs/reference/states.svg."""
    common = _common()
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}">\n',
        _STYLE,
        f'  <rect width="{_WIDTH}" height="{_HEIGHT}" fill="white"/>\n',
        _rectangle(_FRAME[:2], (_FRAME[2] - _FRAME[0], _FRAME[3] - _FRAME[1]), "frame"),
        _text((445, 25), "on the ground; an arrow from the frame leaves each of them", ""),
    ]
    parts += [_arrow(_frame_path(after), names) for after, names in common.items()]
    inside: dict[Stage, list[str]] = {}
    between: dict[tuple[Stage, Stage], list[str]] = {}
    for (before, event), after in TRANSITIONS.items():
        if event is StageEvent.RESET or before is after:
            where = "stays" if before is after else f"to {after.name}"
            inside.setdefault(before, []).append(f"{event.name}: {where}")
        elif not (before in ON_GROUND and event.name in common.get(after, [])):
            between.setdefault((before, after), []).append(event.name)
    for (before, after), names in between.items():
        # Of two that run side by side each has its label near its beginning.
        beside, along = (_APART / 2, 0.3) if (after, before) in between else (0.0, 0.5)
        parts.append(_arrow(_path(before, after, beside), names, along))
    parts += [_box(stage, inside.get(stage, [])) for stage in Stage]
    return "".join([*parts, "</svg>\n"])


def _common() -> dict[Stage, list[str]]:
    """Stage -> the stimuli that lead there from every stage on the ground."""
    found: dict[Stage, list[str]] = {}
    for event in StageEvent:
        afters = {TRANSITIONS.get((stage, event)) for stage in ON_GROUND}
        after = afters.pop()
        if not afters and after is not None:
            found.setdefault(after, []).append(event.name)
    return found


def _frame_path(after: Stage) -> list[Point]:
    """From the frame to a box."""
    leaves, corner = _EXITS[after]
    return [leaves, corner, _border(after, corner)]


def _path(before: Stage, after: Stage, beside: float) -> list[Point]:
    """From border to border, beside the line through the middles by so much to the right."""
    corners = list(_CORNERS.get((before, after), ()))
    (x1, y1), (x2, y2) = _PLACES[before], _PLACES[after]
    length = math.hypot(x2 - x1, y2 - y1)
    dx, dy = -(y2 - y1) / length * beside, (x2 - x1) / length * beside
    first = corners[0] if corners else (x2 + dx, y2 + dy)
    last = corners[-1] if corners else (x1 + dx, y1 + dy)
    shift = (0.0, 0.0) if corners else (dx, dy)
    return [_border(before, first, shift), *corners, _border(after, last, shift)]


def _border(stage: Stage, towards: Point, shift: Point = (0.0, 0.0)) -> Point:
    """Where an arrow meets the box: straight from a point beside or above it, else along the
    line to its middle, or to what lies beside the middle by shift."""
    (x, y), (px, py) = _PLACES[stage], towards
    half_width, half_height = _BOX[0] / 2, _BOX[1] / 2
    if abs(px - x) < half_width:
        return px, y + math.copysign(half_height, py - y)
    if abs(py - y) < half_height:
        return x + math.copysign(half_width, px - x), py
    mx, my = x + shift[0], y + shift[1]
    over = (math.copysign(half_width, px - x) - shift[0]) / (px - mx)
    beside = (math.copysign(half_height, py - y) - shift[1]) / (py - my)
    scale = min(over, beside)
    return mx + (px - mx) * scale, my + (py - my) * scale


def _arrow(points: list[Point], names: list[str], along: float = 0.5) -> str:
    way = " ".join(f"{x:.0f},{y:.0f}" for x, y in points)
    # On the longest part there is most room for the label.
    (x1, y1), (x2, y2) = max(itertools.pairwise(points), key=lambda ends: math.dist(*ends))
    label = (x1 + (x2 - x1) * along, y1 + (y2 - y1) * along + 4)
    line = f'  <polyline class="arrow" points="{way}"/>\n'
    return line + _text(label, ", ".join(names), "label")


def _box(stage: Stage, inside: list[str]) -> str:
    (x, y), (width, height) = _PLACES[stage], _BOX
    kind = "box" if stage in ON_GROUND else "box air"
    parts = [_rectangle((x - width / 2, y - height / 2), _BOX, kind)]
    top = y + 5 - 7.5 * len(inside)
    parts.append(_text((x, top), stage.name, "name"))
    parts += [_text((x, top + 15 * n), line, "inside") for n, line in enumerate(inside, start=1)]
    return "".join(parts)


def _rectangle(corner: Point, size: Point, kind: str) -> str:
    (x, y), (width, height) = corner, size
    return (
        f'  <rect class="{kind}" x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" rx="6"/>\n'
    )


def _text(at: Point, text: str, kind: str) -> str:
    return f'  <text class="{kind}" x="{at[0]:.0f}" y="{at[1]:.0f}">{escape(text)}</text>\n'
