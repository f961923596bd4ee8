"""Writes what is said of parameters elsewhere from the one table in the nodes (make docs).

config/mavlink_vehicle.yaml and the tables between the marks in README.md. With --check it only
says which of them is out of date.
"""

from __future__ import annotations

import argparse
import sys
import textwrap
from pathlib import Path

from chute_ros.nodes.device_node import COMMON_PARAMETERS
from chute_ros.nodes.mavlink_parameters import PARAMETERS as MAVLINK_PARAMETERS
from chute_ros.nodes.parameters import Parameter
from chute_ros.nodes.supervisor_parameters import PARAMETERS as SUPERVISOR_PARAMETERS

NODES: dict[str, tuple[Parameter, ...]] = {
    "mavlink_parachute": (*MAVLINK_PARAMETERS, *COMMON_PARAMETERS),
    "safety_supervisor": SUPERVISOR_PARAMETERS,
}
CONFIG = Path("config/mavlink_vehicle.yaml")
README = Path("README.md")
_HEAD = """\
# Parameters of one vehicle with a MAVLink parachute, as delivered. The keys match the nodes in any
# namespace. Give this file with --params-file, or as config:= of vehicle.launch.py.
# Written by `make docs` from the tables in chute_ros/nodes.
"""
_BEGIN, _END = "<!-- parameters of {} -->", "<!-- end of parameters of {} -->"


def config_text() -> str:
    """The whole of config/mavlink_vehicle.yaml."""
    lines = [_HEAD]
    for node, parameters in NODES.items():
        lines += [f"/**/{node}:", "  ros__parameters:"]
        for parameter in parameters:
            text = f"{parameter.description}; {_allowed(parameter)}"
            lines += [f"    # {line}" for line in textwrap.wrap(text, 92)]
            lines.append(f"    {parameter.name}: {_yaml(parameter.default)}")
        lines.append("")
    return "\n".join(lines)


def readme_text(before: str) -> str:
    """README.md with its tables made anew."""
    for node, parameters in NODES.items():
        begin, end = _BEGIN.format(node), _END.format(node)
        head, found, rest = before.partition(begin)
        _, found_end, tail = rest.partition(end)
        if not found or not found_end:
            sys.exit(f"{README}: the marks {begin} and {end} are missing")
        rows = ["| parameter | default | meaning | allowed |", "|---|---|---|---|"]
        rows += [
            f"| `{p.name}` | `{_yaml(p.default)}` | {p.description} | {_allowed(p)} |"
            for p in parameters
        ]
        before = head + begin + "\n" + "\n".join(rows) + "\n" + end + tail
    return before


def main() -> None:
    """Write, or check, both files of the repository in the present folder."""
    options = argparse.ArgumentParser("parameter_docs", description=__doc__)
    options.add_argument("--check", action="store_true", help="write nothing")
    check = options.parse_args().check
    texts = {CONFIG: config_text(), README: readme_text(README.read_text())}
    old = [str(path) for path, text in texts.items() if path.read_text() != text]
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
