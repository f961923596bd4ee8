"""The part of a rocket's page that shows its flight computer: valves, stages, target, memory."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape
from typing import Any

from chute_ros.links.umbilical.protocol.modes import FlightMode
from chute_ros.model import name_of
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.chute.words import age_text, is_old, value_text
from chute_ros.tools.panel.sections import broken

_AIR_BRAKE = {0: "idle", 1: "deployed", 2: "retracted"}
_NOT_THERE = -1
#: The task of the umbilical's diagnostics that tells of dumps and wipes.
_MEMORY = "memory"


def rocket(telem: Any, age: float, tasks: Iterable[Task]) -> str:
    """telem: the newest chute_msgs/Telem; age: since it was received, s."""
    mode = telem.flight_mode
    rows = [
        ("key", _key(mode)),
        ("flight mode", name_of(FlightMode, mode)),
        ("altitude", value_text(telem.altitude, "m")),
        ("predicted apogee", value_text(telem.predicted_apogee, "m")),
        ("solenoid valve", _switch(telem.sv_open, "OPEN", "closed")),
        ("main valve", _switch(telem.mav_open, "OPEN", "closed")),
        ("drogue", _switch(telem.ssa_drogue_deployed, "DEPLOYED", "not deployed")),
        ("main parachute", _switch(telem.ssa_main_deployed, "DEPLOYED", "not deployed")),
        ("air brake", _air_brake(telem)),
        ("satellites", "not reported" if telem.num_satellites < 0 else str(telem.num_satellites)),
        ("BLiMS target", _target(telem)),
        ("telemetry", f"{telem.layout}, {age_text(age)}"),
    ]
    told = "".join(_row(name, text) for name, text in rows)
    told += "".join(
        _memory(task) for task in tasks if task.node == "umbilical" and task.task == _MEMORY
    )
    old = " old" if is_old(age) else ""
    return f'<section class="card{old}"><h2>Rocket</h2>{told}</section>'


def _row(name: str, text: str) -> str:
    return f'<div class="row"><span>{escape(name)}</span><span>{broken(text)}</span></div>'


def _key(mode: int) -> str:
    """It gates the mode: STARTUP ends once it is turned. In FAULT nobody knows."""
    if mode == FlightMode.STARTUP:
        return "not armed"
    known = FlightMode._value2member_map_.keys() - {FlightMode.FAULT}
    return "ARMED" if mode in known else "not reported"


def _memory(task: Task) -> str:
    """A dump or a wipe of the flash; a bar while one is under way."""
    progress, percent = (
        task.values.get(name, "") for name in ("newest progress", "newest progress (%)")
    )
    what = f"{task.message}{f' ({progress})' if progress else ''}"
    row = _row("memory", f"{what}, {age_text(task.age)}")
    if task.level == "OK":
        return row
    # Of a dump nobody knows how long it will be.
    now = f' aria-valuenow="{escape(percent)}"' if percent else ""
    style = f' style="width:{escape(percent)}%"' if percent else ' class="unknown"'
    return (
        f'{row}<div class="bar" role="progressbar" aria-label="memory" aria-valuemin="0" '
        f'aria-valuemax="100"{now}><i{style}></i></div>'
    )


def _switch(value: int, on: str, off: str) -> str:
    if value == _NOT_THERE:
        return "not reported"
    return {0: off, 1: on}.get(value, f"number {value}")


def _air_brake(telem: Any) -> str:
    if telem.airbrake_state == _NOT_THERE:
        return "not reported"
    state = _AIR_BRAKE.get(telem.airbrake_state, f"number {telem.airbrake_state}")
    opening = telem.airbrake_deployment
    return state if math.isnan(opening) else f"{state}, {opening * 100.0:.0f} % open"


def _target(telem: Any) -> str:
    if math.isnan(telem.blims_dist_to_target):
        return "not reported"
    distance = value_text(telem.blims_dist_to_target, "m", 0)
    return f"{distance} at {value_text(telem.blims_bearing_deg, '°', 0)}"
