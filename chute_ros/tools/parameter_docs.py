"""Writes config/ and the parameter tables of the docs from the table in the nodes (make docs).

The tables stand between marks in docs/reference/parameters.md and docs/reference/rules.md.
With --check it only names the files that are out of date.
"""

from __future__ import annotations

import argparse
import sys
import textwrap
from pathlib import Path

from chute_ros.links.mavlink.parameters import PARAMETERS as MAVLINK_PARAMETERS
from chute_ros.links.umbilical.parameters import PARAMETERS as UMBILICAL_PARAMETERS
from chute_ros.links.upf.parameters import PARAMETERS as UPF_PARAMETERS
from chute_ros.nodes.device_node import COMMON_PARAMETERS
from chute_ros.nodes.parameters import Parameter, Value
from chute_ros.nodes.supervisor_parameters import PARAMETERS as SUPERVISOR_PARAMETERS
from chute_ros.supervisor.measurements import STANDARD_LIMITS, UNITS

NODES: dict[str, tuple[Parameter, ...]] = {
    "mavlink_parachute": (*MAVLINK_PARAMETERS, *COMMON_PARAMETERS),
    "upf_can": (*UPF_PARAMETERS, *COMMON_PARAMETERS),
    "umbilical": (*UMBILICAL_PARAMETERS, *COMMON_PARAMETERS),
    "safety_supervisor": SUPERVISOR_PARAMETERS,
}
PARAMETERS = Path("docs/reference/parameters.md")
RULES = Path("docs/reference/rules.md")
_MAVLINK, _UPF, _UMBILICAL, _SUPERVISOR = NODES
_BOTH_LINKS = [_MAVLINK, _UPF]
#: File -> what its vehicle carries, its nodes, and what differs from the defaults.
CONFIGS: dict[Path, tuple[str, tuple[str, ...], dict[tuple[str, str], Value]]] = {
    Path("config/mavlink_vehicle.yaml"): (
        "a MAVLink parachute, all as delivered",
        (_MAVLINK, _SUPERVISOR),
        {},
    ),
    Path("config/upf_vehicle.yaml"): (
        "a UPF parachute on DroneCAN and a MAVLink autopilot",
        (_MAVLINK, _UPF, _SUPERVISOR),
        {
            (_MAVLINK, "expect_parachute"): False,
            (_SUPERVISOR, "required_links"): _BOTH_LINKS,
            (_SUPERVISOR, "deploy_links"): [_UPF],
            (_SUPERVISOR, "deploy_ladder"): [_UPF, f"{_UPF}:trigger"],
        },
    ),
    Path("config/both_vehicle.yaml"): (
        "a MAVLink parachute and a UPF parachute on DroneCAN",
        (_MAVLINK, _UPF, _SUPERVISOR),
        {
            (_SUPERVISOR, "required_links"): _BOTH_LINKS,
            (_SUPERVISOR, "deploy_links"): _BOTH_LINKS,
            (_SUPERVISOR, "deploy_ladder"): [*_BOTH_LINKS, f"{_UPF}:trigger"],
        },
    ),
    Path("config/umbilical_vehicle.yaml"): (
        "a flight computer on a serial umbilical",
        (_UMBILICAL, _SUPERVISOR),
        {
            (_UMBILICAL, "publish_vehicle_state"): True,
            (_SUPERVISOR, "required_links"): [_UMBILICAL],
            (_SUPERVISOR, "kill_links"): [_UMBILICAL],
            (_SUPERVISOR, "deploy_links"): [_UMBILICAL],
            (_SUPERVISOR, "profile"): "rocket",
        },
    ),
}
_HEAD = """\
# Parameters of one vehicle with {}. The keys
# match the nodes in any namespace. Give this file with --params-file, or as config:= of
# vehicle.launch.py. Written by `make docs` from the tables in chute_ros/nodes.
"""
_BEGIN, _END = "<!-- parameters of {} -->", "<!-- end of parameters of {} -->"


def config_text(path: Path) -> str:
    """The whole of one file of CONFIGS."""
    what, nodes, differs = CONFIGS[path]
    lines = [_HEAD.format(what)]
    for node in nodes:
        lines += [f"/**/{node}:", "  ros__parameters:"]
        for parameter in NODES[node]:
            text = f"{parameter.description}; {_allowed(parameter)}"
            lines += [f"    # {line}" for line in textwrap.wrap(text, 92)]
            value = differs.get((node, parameter.name), parameter.default)
            lines.append(f"    {parameter.name}: {_yaml(value)}")
        lines.append("")
    return "\n".join(lines)


def parameters_text(before: str) -> str:
    """docs/reference/parameters.md with its tables made anew."""
    for node, parameters in NODES.items():
        rows = ["| parameter | default | meaning | allowed |", "|---|---|---|---|"]
        rows += [
            f"| `{p.name}` | `{_yaml(p.default)}` | {p.description} | {_allowed(p)} |"
            for p in parameters
        ]
        before = _between(before, PARAMETERS, _BEGIN.format(node), _END.format(node), rows)
    return before


def rules_text(before: str) -> str:
    """docs/reference/rules.md with its table of measurements made anew."""
    rows = [
        "| name | unit | range | rate (1/s) | jump | max_age (s) | stuck_after (s) |",
        "|---|---|---|---|---|---|---|",
    ]
    rows += [
        f"| `{name}` | {UNITS[name]} | {one.minimum:g} to {one.maximum:g} | {one.rate:g} "
        f"| {one.jump:g} | {one.max_age:g} | {one.stuck_after:g} |"
        for name, one in STANDARD_LIMITS.items()
    ]
    return _between(before, RULES, "<!-- measurements -->", "<!-- end of measurements -->", rows)


def _between(before: str, path: Path, begin: str, end: str, rows: list[str]) -> str:
    head, found, rest = before.partition(begin)
    _, found_end, tail = rest.partition(end)
    if not found or not found_end:
        sys.exit(f"{path}: the marks {begin} and {end} are missing")
    return head + begin + "\n" + "\n".join(rows) + "\n" + end + tail


def main() -> None:
    """Write, or check, the files of the repository in the present folder."""
    options = argparse.ArgumentParser("parameter_docs", description=__doc__)
    options.add_argument("--check", action="store_true", help="write nothing")
    check = options.parse_args().check
    texts = {path: config_text(path) for path in CONFIGS}
    texts[PARAMETERS] = parameters_text(PARAMETERS.read_text())
    texts[RULES] = rules_text(RULES.read_text())
    old = [str(p) for p, text in texts.items() if not p.is_file() or p.read_text() != text]
    if check and old:
        sys.exit(f"out of date: {', '.join(old)}; run: make docs")
    if not check:
        for path, text in texts.items():
            path.write_text(text)


def _allowed(parameter: Parameter) -> str:
    changeable = "; may be changed while running" if parameter.changeable else ""
    return parameter.allowed() + changeable


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list):
        return "[" + ", ".join(_yaml(one) for one in value) + "]"
    return repr(value)


if __name__ == "__main__":
    main()
