"""Height and vertical speed as curves, with the decisions on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from nicegui import ui

from chute_ros.model import Action
from chute_ros.tools.panel.trace import LANES, DecisionMark, MotionPoint, PlacedMark, placed

_AXES = (("height", "m", "#2f74c0"), ("vertical speed", "m/s", "#b06a00"))
#: Name of an action -> what is written on the curves, and the colour of its line: in the dark as
#: well as in the light.
_MARKS = {
    Action.FLIGHT_BLOCK.name: ("BLOCK", "#b5850f"),
    Action.FLIGHT_BLOCK_RELEASE.name: ("UNBLOCK", "#2f9e6b"),
    Action.KILL.name: ("KILL", "#d0404f"),
    Action.DEPLOY.name: ("DEPLOY", "#9a63d0"),
}
_GRID = "#8b949c"
#: px: a row of names, the room below them, and the two curves.
_LANE, _ROOM, _HEIGHTS, _SPEEDS = 14, 34, 120, 90


class Curves:
    """The element; empty until something is drawn."""

    def __init__(self) -> None:
        with ui.element("section").classes("card"):
            ui.html("<h2>Height and vertical speed</h2>", sanitize=False)
            # As SVG its texts have the page's colours, in the dark as well.
            self._chart = ui.echart(_options(), renderer="svg").classes("curves")
        self._drawn: tuple[Sequence[MotionPoint], Sequence[PlacedMark]] = ((), ())

    def draw(self, points: Sequence[MotionPoint], marks: Sequence[DecisionMark]) -> None:
        """All of it."""
        if not points:
            return
        start, end = points[0].at, points[-1].at
        named = [DecisionMark(one.at, _MARKS.get(one.text, (one.text,))[0]) for one in marks]
        found = placed(named, start, end)
        if (points, found) == self._drawn:
            return
        self._drawn = points, found
        heights, speeds, names = self._chart.options["series"]
        heights["data"] = [[one.at * 1000.0, _number(one.height)] for one in points]
        speeds["data"] = [[one.at * 1000.0, _number(one.vertical_speed)] for one in points]
        for curve in (heights, speeds):
            curve["markLine"]["data"] = [_line(one) for one in found]
        names["data"] = [_name(one) for one in found if one.lane >= 0]
        for axis in self._chart.options["xAxis"]:
            axis["min"], axis["max"] = start * 1000.0, max(end, start + 1.0) * 1000.0
        self._chart.update()


def _number(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 2)


def _colour(one: PlacedMark) -> str:
    return dict(_MARKS.values()).get(one.mark.text, _GRID)


def _line(one: PlacedMark) -> dict[str, Any]:
    return {"xAxis": one.mark.at * 1000.0, "lineStyle": {"color": _colour(one)}}


def _name(one: PlacedMark) -> dict[str, Any]:
    return {
        "value": [one.mark.at * 1000.0, one.lane],
        "itemStyle": {"color": _colour(one)},
        "label": {"formatter": one.mark.text, "position": "left" if one.leftwards else "right"},
    }


def _options() -> dict[str, Any]:
    top = LANES * _LANE + 8
    below = top + _ROOM + _HEIGHTS + _ROOM

    def across(place: int) -> dict[str, Any]:
        labels = {"hideOverlap": True}
        return {"type": "time", "gridIndex": place, "show": place == 1, "axisLabel": labels}

    def upright(place: int) -> dict[str, Any]:
        name, unit, _ = _AXES[place]
        return {
            "type": "value",
            "name": f"{name}, {unit}",
            "gridIndex": place,
            "nameTextStyle": {"align": "left"},
            "scale": place == 1,
            "splitLine": {"lineStyle": {"color": _GRID, "opacity": 0.35}},
        }

    def line(place: int) -> dict[str, Any]:
        return {
            "type": "line",
            "name": _AXES[place][0],
            "xAxisIndex": place,
            "yAxisIndex": place,
            "showSymbol": False,
            "connectNulls": False,
            "data": [],
            "lineStyle": {"width": 2},
            "color": _AXES[place][2],
            "markLine": {
                "symbol": "none",
                "silent": True,
                "lineStyle": {"type": "dashed"},
                "label": {"show": False},
                "data": [],
            },
        }

    names = {
        "type": "scatter",
        "xAxisIndex": 2,
        "yAxisIndex": 2,
        "symbol": "rect",
        "symbolSize": [4, 10],
        "silent": True,
        "label": {"show": True, "fontSize": 11, "distance": 3},
        "tooltip": {"show": False},
        "data": [],
    }
    lanes = {"type": "value", "gridIndex": 2, "show": False, "inverse": True}
    return {
        "animation": False,
        "grid": [
            {"left": 50, "right": 12, "top": top + _ROOM, "height": _HEIGHTS},
            {"left": 50, "right": 12, "top": below, "height": _SPEEDS},
            {"left": 50, "right": 12, "top": 10, "height": (LANES - 1) * _LANE},
        ],
        "xAxis": [across(0), across(1), across(2)],
        "yAxis": [upright(0), upright(1), {**lanes, "min": 0, "max": LANES - 1}],
        "series": [line(0), line(1), names],
        "tooltip": {"trigger": "axis"},
        "axisPointer": {"link": [{"xAxisIndex": "all"}]},
    }
