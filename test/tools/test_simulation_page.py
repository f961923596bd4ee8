"""docs/guide/simulation.md says of the actions what their table says."""

import re
from pathlib import Path

from chute_ros.links.registered import vehicles
from chute_ros.sim.bench_actions import ACTIONS, actions_of
from chute_ros.tools.launch_checks import FAILURES
from chute_ros.tools.simulated_vehicle import simulators_of

PAGE = (Path(__file__).parents[2] / "docs/guide/simulation.md").read_text()


def part(name):
    """The lines between the marks of this name."""
    found = re.search(rf"<!-- {name}: [^>]*-->\n(.*?)<!-- end of {name} -->", PAGE, re.S)
    assert found is not None
    return found[1]


def carried_by(action):
    """The vehicles that have it, in words."""
    having = [name for name in vehicles() if action in _names(name)]
    if having == ["umbilical"]:
        return "rocket"
    drones = [name for name in vehicles() if name != "umbilical"]
    if having == list(vehicles()):
        return "all"
    return "drone" if having == drones else f"drone: {', '.join(having)}"


def _names(vehicle):
    return [one.name for one in actions_of(simulators_of(vehicle))]


def test_its_table_of_actions_is_that_of_the_code():
    rows = ["| action | vehicle | what happens |", "|---|---|---|"]
    rows += [f"| `{one.name}` | {carried_by(one.name)} | {one.effect} |" for one in ACTIONS]
    assert part("actions") == "\n".join(rows) + "\n"


def test_its_table_of_failures_is_that_of_the_code():
    rows = ["| `fail:=` | action |", "|---|---|"]
    rows += [f"| `{word}` | `{action}` |" for word, action in FAILURES.items()]
    assert part("failures") == "\n".join(rows) + "\n"


def test_it_names_each_argument_of_the_launch_file_that_makes_a_flight():
    for name in ("fly", "launch", "fail", "wind"):
        assert f"| `{name}:=" in PAGE
