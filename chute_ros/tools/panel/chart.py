"""Height and vertical speed as curves, with the decisions on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from nicegui import ui

from chute_ros.tools.panel.trace import DecisionMark, MotionPoint

_AXES = (("height", "m", "#2f74c0"), ("vertical speed", "m/s", "#b06a00"))


class Curves:
    """The element; empty until something is drawn."""

    def __init__(self) -> None:
        with ui.element("section").classes("card"):
            ui.html("<h2>Height and vertical speed</h2>", sanitize=False)
            self._chart = ui.echart(_options()).classes("curves")

    def draw(self, points: Sequence[MotionPoint], marks: Sequence[DecisionMark]) -> None:
        """All of it."""
        heights = [[one.at * 1000.0, _number(one.height)] for one in points]
        speeds = [[one.at * 1000.0, _number(one.vertical_speed)] for one in points]
        lines = [
            {"xAxis": one.at * 1000.0, "name": one.text, "label": {"formatter": one.text}}
            for one in marks
            if points and one.at >= points[0].at
        ]
        series = self._chart.options["series"]
        if series[0]["data"] == heights and len(series[0]["markLine"]["data"]) == len(lines):
            return
        series[0]["data"], series[1]["data"] = heights, speeds
        series[0]["markLine"]["data"] = lines
        self._chart.update()


def _number(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 2)


def _options() -> dict[str, Any]:
    def axis(place: int) -> dict[str, Any]:
        name, unit, colour = _AXES[place]
        return {
            "type": "value",
            "name": f"{name}, {unit}",
            "gridIndex": place,
            "nameTextStyle": {"color": colour, "align": "left"},
            "scale": place == 1,
        }

    def line(place: int) -> dict[str, Any]:
        return {
            "type": "line",
            "name": _AXES[place][0],
            "xAxisIndex": place,
            "yAxisIndex": place,
            "showSymbol": False,
            "data": [],
            "lineStyle": {"width": 2},
            "color": _AXES[place][2],
        }

    marks = {
        "symbol": "none",
        "silent": True,
        "lineStyle": {"type": "dashed", "color": "#8f1220"},
        "label": {"show": True, "rotate": 90, "position": "insideEndBottom", "fontSize": 10},
        "data": [],
    }
    return {
        "animation": False,
        "grid": [
            {"left": 50, "right": 12, "top": 30, "height": 120},
            {"left": 50, "right": 12, "top": 200, "height": 90},
        ],
        "xAxis": [
            {"type": "time", "gridIndex": 0, "show": False},
            {"type": "time", "gridIndex": 1, "axisLabel": {"hideOverlap": True}},
        ],
        "yAxis": [axis(0), axis(1)],
        "series": [{**line(0), "markLine": marks}, line(1)],
        "tooltip": {"trigger": "axis"},
        "axisPointer": {"link": [{"xAxisIndex": "all"}]},
    }
