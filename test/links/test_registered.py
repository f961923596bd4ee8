"""A link is found by its entry: ours, and one of somebody's own package."""

import ast
import inspect
import json
import os
import subprocess
import sys
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from chute_ros.campaign.scenario import part
from chute_ros.errors import NotRegisteredError
from chute_ros.links import api, registered
from chute_ros.links.api import Link, LinkKind, load
from chute_ros.links.registered import links, module_of, vehicles
from chute_ros.runtime.device import DeviceRuntime

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {module_of(name).rpartition(".")[2]: name for name in links()}


def test_each_folder_is_registered():
    found = {path.parent.name for path in (ROOT / "chute_ros" / "links").glob("*/__init__.py")}
    assert found == FOLDERS.keys()
    assert len(found) == 4


@pytest.mark.parametrize("name", links())
def test_what_it_names_is_there(name):
    kind = links()[name]
    assert inspect.isclass(load(kind.node))
    assert load(kind.parameters)
    assert part(name).ways(next(iter(kind.vehicles)))
    installed = {one.name for one in entry_points(group="console_scripts")}
    assert name in installed


@pytest.mark.parametrize("folder", FOLDERS)
def test_its_protocol_is_a_link(folder):
    module = import_module(f"chute_ros.links.{folder}.protocol.link")
    (made,) = [
        one
        for one in vars(module).values()
        if inspect.isclass(one) and one.__module__ == module.__name__ and "Link" in one.__name__
    ]
    runtimes = vars(import_module(f"chute_ros.links.{folder}.runtime")).values()
    (runtime,) = [
        one
        for one in runtimes
        if inspect.isclass(one) and issubclass(one, DeviceRuntime) and one is not DeviceRuntime
    ]
    wanted = {
        name: list(inspect.signature(one).parameters)
        for name, one in inspect.getmembers(Link, inspect.isfunction)
        if not name.startswith("_")
    }
    if runtime.BLOCKS_FLIGHT:
        wanted["flight_block"] = ["self", "reason", "now"]
    for name, takes in wanted.items():
        has = list(inspect.signature(getattr(made, name)).parameters)
        assert has[: len(takes)] == takes, f"{made.__name__}.{name}"


@pytest.mark.parametrize("folder", FOLDERS)
def test_its_node_passes_the_stories_of_all_device_nodes(folder):
    (file,) = (ROOT / "test" / "links" / folder).glob("test_*_device_suite.py")
    suites = [
        node
        for node in ast.parse(file.read_text()).body
        if isinstance(node, ast.ClassDef)
        and {ast.unparse(base) for base in node.bases} & {"DeviceSuite", "NodeSuite"}
    ]
    named = [
        ast.literal_eval(line.value)
        for suite in suites
        for line in suite.body
        if isinstance(line, ast.Assign) and ast.unparse(line.targets[0]) == "name"
    ]
    assert named == [FOLDERS[folder]]


def test_each_vehicle_carries_links_that_there_are():
    for vehicle in vehicles().values():
        assert {*vehicle.links} <= links().keys()
        for name in ("required_links", "kill_links", "deploy_links"):
            assert {*vehicle.supervised(name)} <= {*vehicle.links}, (vehicle.name, name)


OTHERS = """
from dataclasses import replace
from chute_ros.links.relay import LINK as RELAY

LINK = replace(
    RELAY,
    name="rocket_motor",
    node="other_link.node:Node",
    package="other_package",
    vehicles=(replace(RELAY.vehicles[0], name="other", links=("rocket_motor",), replaces=""),),
)
"""
TELL = """
import json
from chute_ros.links.registered import links, module_of, vehicles
from chute_ros.runtime.device import DeviceRuntime
print(json.dumps([list(links()), list(vehicles()), module_of("rocket_motor")]))
"""


def python(code, folder):
    path = os.pathsep.join([str(folder), *filter(None, sys.path)])
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def other_package(folder, entry, code=OTHERS):
    (folder / "other_link").mkdir()
    (folder / "other_link" / "__init__.py").write_text(code)
    information = folder / "other_package-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(f"[chute_ros.links]\n{entry}\n")


def test_a_link_of_another_package_is_found_behind_ours(tmp_path):
    other_package(tmp_path, "rocket_motor = other_link:LINK")
    done = python(TELL, tmp_path)
    assert done.returncode == 0, done.stderr
    names, carried, module = json.loads(done.stdout)
    assert names == [*links(), "rocket_motor"]
    assert carried == [*vehicles(), "other"]
    assert module == "other_link"


def test_a_link_that_the_campaign_cannot_fly_leaves_its_flights_as_they_are(tmp_path):
    code = OTHERS.replace('name="rocket_motor"', 'name="rocket_motor", part=""')
    tell = (
        "from pathlib import Path; from chute_ros.campaign.draw import draw; "
        "from chute_ros.campaign.shipped import Shipped; "
        "Shipped(Path()).read_all(); print([draw(n) for n in range(50)])"
    )
    (tmp_path / "without").mkdir()
    other_package(tmp_path, "rocket_motor = other_link:LINK", code)
    beside, alone = python(tell, tmp_path), python(tell, tmp_path / "without")
    assert alone.returncode == 0, alone.stderr
    assert (beside.returncode, beside.stdout) == (0, alone.stdout), beside.stderr


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("rocket_motor = no_module:LINK", "chute_ros.links rocket_motor = no_module:LINK: No mod"),
        ("rocket_motor = other_link:NONE", "chute_ros.links rocket_motor = other_link:NONE: "),
        ("another = other_link:LINK", "need a LinkKind with the name 'another'"),
        ("rocket_motor = other_link:RELAY", "need a LinkKind with the name 'rocket_motor'"),
        ("rocket_motor = other_link:replace", "need a LinkKind with the name 'rocket_motor'"),
    ],
)
def test_an_entry_that_is_none_is_named(tmp_path, entry, said):
    other_package(tmp_path, entry)
    done = python(TELL, tmp_path)
    assert done.returncode == 1
    (line,) = [one for one in done.stderr.splitlines() if "NotRegisteredError: " in one]
    assert said in line


def test_without_any_it_says_what_to_do(monkeypatch):
    monkeypatch.setattr(registered, "entry_points", lambda group: ())
    links.cache_clear()
    try:
        with pytest.raises(NotRegisteredError, match=r"build chute_ros and source install/setup"):
            links()
    finally:
        monkeypatch.undo()
        links.cache_clear()


def test_a_kind_is_made_of_texts_and_functions_alone():
    """It is read by launch files and by the campaign, which have no ROS."""
    code = "import sys; from chute_ros.links.registered import links; links(); print(*sys.modules)"
    done = python(code, ROOT)
    assert done.returncode == 0, done.stderr
    assert not {"rclpy", "dronecan", "pymavlink", "serial"} & {*done.stdout.split()}
    assert isinstance(links()[api.AUTOPILOT_LINK], LinkKind)
