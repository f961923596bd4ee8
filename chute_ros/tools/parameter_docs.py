"""Writes config/ and the tables of docs/reference/ from the settings (make docs).

The tables stand between marks in docs/reference/parameters.md, docs/reference/rules.md and
docs/guide/minimum_height.md.
With --check it only names the files that are out of date.
"""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path

from chute_ros.campaign.description import FIELDS
from chute_ros.links.api import SUPERVISOR, VehicleKind, load
from chute_ros.links.registered import links, package_of, vehicles
from chute_ros.ros.supervisor_parameters import PARAMETERS as SUPERVISOR_PARAMETERS
from chute_ros.settings import Parameter, parameters_of
from chute_ros.supervisor.measurements import STANDARD_LIMITS, UNITS
from chute_ros.tools.pages import table, write_or_check
from chute_ros.tools.panel.parameters import NODE as PANEL
from chute_ros.tools.panel.parameters import PARAMETERS as PANEL_PARAMETERS

NODES: dict[str, tuple[Parameter, ...]] = {
    **{
        name: parameters_of(load(kind.parameters))
        for name, kind in links().items()
        if kind.package == "chute_ros"
    },
    SUPERVISOR: SUPERVISOR_PARAMETERS,
    PANEL: PANEL_PARAMETERS,
}
PARAMETERS = Path("docs/reference/parameters.md")
RULES = Path("docs/reference/rules.md")
DESCRIPTION = Path("docs/guide/minimum_height.md")
#: File -> its vehicle.
CONFIGS: dict[Path, VehicleKind] = {
    Path(f"config/{name}_vehicle.yaml"): vehicle
    for name, vehicle in vehicles().items()
    if package_of(name) == "chute_ros"
}
_HEAD = """\
# Parameters of one vehicle with {}. The keys
# match the nodes in any namespace. Give this file with --params-file, or as config:= of
# vehicle.launch.py. Written by `make docs` from the settings in chute_ros.
"""


def config_text(path: Path) -> str:
    """The whole of one file of CONFIGS."""
    vehicle = CONFIGS[path]
    lines = [_HEAD.format(vehicle.description)]
    for node in (*vehicle.links, SUPERVISOR):
        lines += [f"/**/{node}:", "  ros__parameters:"]
        for parameter in NODES[node]:
            text = f"{parameter.meaning}; {_allowed(parameter)}"
            lines += [f"    # {line}" for line in textwrap.wrap(text, 92)]
            value = vehicle.given(node, parameter.name, parameter.default)
            lines.append(f"    {parameter.name}: {_yaml(value)}")
        lines.append("")
    return "\n".join(lines)


def parameters_text(before: str) -> str:
    """docs/reference/parameters.md with the tables of all nodes made anew."""
    rows: list[str] = []
    for node, parameters in NODES.items():
        told = [
            (f"`{p.name}`", f"`{_yaml(p.default)}`", p.meaning, _allowed(p)) for p in parameters
        ]
        rows += [f"## {node}", "", table(("parameter", "default", "meaning", "allowed"), told), ""]
    return _with_part(before, PARAMETERS, "parameters", rows[:-1])


def rules_text(before: str) -> str:
    """docs/reference/rules.md with its table of measurements made anew."""
    head = ("name", "unit", "range", "rate (1/s)", "jump", "max_age (s)", "stuck_after (s)")
    rows = []
    for name, one in STANDARD_LIMITS.items():
        numbers = (one.rate, one.jump, one.max_age, one.stuck_after)
        span = f"{one.minimum:g} to {one.maximum:g}"
        rows.append((f"`{name}`", UNITS[name], span, *(f"{number:g}" for number in numbers)))
    return _with_part(before, RULES, "measurements", [table(head, rows)])


def description_text(before: str) -> str:
    """docs/guide/minimum_height.md with the table of a description's fields made anew."""
    rows = [
        (f"`{name}`", one.meaning, one.allowed, one.default or "needed")
        for name, one in FIELDS.items()
    ]
    head = ("field", "meaning", "allowed", "if left out")
    return _with_part(before, DESCRIPTION, "description", [table(head, rows)])


def _with_part(before: str, path: Path, name: str, rows: list[str]) -> str:
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    head, found, rest = before.partition(begin)
    _, found_end, tail = rest.partition(end)
    if not found or not found_end:
        sys.exit(f"{path}: the marks {begin} and {end} are missing")
    return head + begin + "\n" + "\n".join(rows) + "\n" + end + tail


def main() -> None:
    """Write, or check, all of them."""
    write_or_check("parameter_docs", __doc__, _texts)


def _texts() -> dict[Path, str]:
    texts = {path: config_text(path) for path in CONFIGS}
    texts[PARAMETERS] = parameters_text(PARAMETERS.read_text())
    texts[RULES] = rules_text(RULES.read_text())
    texts[DESCRIPTION] = description_text(DESCRIPTION.read_text())
    return texts


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
