"""A link is found by its entry: ours, and one of somebody's own package."""

import ast
import importlib
import inspect
import sys
from contextlib import contextmanager
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from other_package import OTHERS, changed, other_package, python

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
    module = importlib.import_module(f"chute_ros.links.{folder}.protocol.link")
    (made,) = [
        one
        for one in vars(module).values()
        if inspect.isclass(one) and one.__module__ == module.__name__ and "Link" in one.__name__
    ]
    runtimes = vars(importlib.import_module(f"chute_ros.links.{folder}.runtime")).values()
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


@contextmanager
def installed(folder, first=True):
    """As in a program that has the packages of this folder; first: before all others."""
    with pytest.MonkeyPatch.context() as patch:
        path = [str(folder), *sys.path] if first else [*sys.path, str(folder)]
        patch.setattr(sys, "path", path)
        patch.setattr(registered, "entry_points", entry_points)
        importlib.invalidate_caches()
        read_anew()
        try:
            yield
        finally:
            sys.modules.pop("other_link", None)
            read_anew()


def read_anew():
    links.cache_clear()
    vehicles.cache_clear()


def test_a_link_of_another_package_is_found_behind_ours(tmp_path):
    ours = [*links()], [*vehicles()]
    other_package(tmp_path)
    with installed(tmp_path):
        names, carried, module = [*links()], [*vehicles()], module_of("rocket_motor")
    assert names[: len(ours[0])] == ours[0]
    assert carried[: len(ours[1])] == ours[1]
    assert "rocket_motor" in names
    assert "other" in carried
    assert module == "other_link"


def refusal(folder, first=True):
    """What is said once a program has met the links of this folder."""
    with installed(folder, first), pytest.raises(NotRegisteredError) as raised:
        vehicles()
    return str(raised.value)


MAVLINK = "chute_ros.links mavlink_parachute = chute_ros.links.mavlink:LINK"
#: A name that is taken -> what of OTHERS is otherwise, and whose it is.
TAKEN = {
    "node relay": (
        *('"rocket_motor"', '"relay"'),
        "chute_ros.links relay = chute_ros.links.relay:LINK",
    ),
    "node safety_supervisor": (
        *('"rocket_motor"', '"safety_supervisor"'),
        "the supervisor",
    ),
    "vehicle mavlink": ('"other"', '"mavlink"', MAVLINK),
    "launch argument connection": ('"motor"', '"connection"', MAVLINK),
    "device upf": (
        *("    package=", '    device="upf", kit="other_link:KIT", package='),
        "chute_ros.links upf_can = chute_ros.links.upf:LINK",
    ),
    **{
        f"launch argument {name}": ('"motor"', f'"{name}"', "the launch files of chute_ros")
        for name in registered.LAUNCH_ARGUMENTS
    },
}


@pytest.mark.parametrize("what", TAKEN)
@pytest.mark.parametrize("first", [True, False])
def test_a_name_that_is_taken_is_refused_with_both_owners_wherever_they_are_on_the_path(
    tmp_path, what, first
):
    old, new, whose = TAKEN[what]
    kind, _, name = what.rpartition(" ")
    entry = f"{name if kind == 'node' else 'rocket_motor'} = other_link:LINK"
    other_package(tmp_path, entry, changed(old, new))
    theirs = f"chute_ros.links {entry}"
    end = "give one of them another name, or remove its package"
    assert refusal(tmp_path, first) in {
        f"{one}: the {what} is also that of {other}: {end}"
        for one, other in ((theirs, whose), (whose, theirs))
    }


def test_an_entry_that_is_found_twice_is_one_link(tmp_path):
    other_package(tmp_path, "relay = chute_ros.links.relay:LINK")
    with installed(tmp_path):
        assert [*links()].count("relay") == 1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'links=("rocket_motor",)',
            'links=("mavlink_parachut", "rocket_motor")',
            "there is no link mavlink_parachut: need links of mavlink_parachute, relay, ",
        ),
        (
            "parameters={SUPERVISOR: NAMED}",
            'parameters={SUPERVISOR: NAMED, "relay": {}}',
            "parameters has relay, which it does not start: need one of rocket_motor, safety_sup",
        ),
        (
            '{"required_links": LINKS',
            '{"required_link": LINKS',
            "safety_supervisor has no parameter required_link: did you mean required_links?",
        ),
        (
            '"kill_links": LINKS, ',
            "",
            "kill_links of safety_supervisor has mavlink_parachute, which it does not start: ",
        ),
        (
            'LINKS = ["rocket_motor"]',
            'LINKS = ("rocket_motor",)',
            "required_links of safety_supervisor is ('rocket_motor',): need a list of links",
        ),
        ('replaces=""', 'replaces="mavlnk"', "replaces is 'mavlnk': need one of mavlink, relay, "),
    ],
)
def test_a_vehicle_that_names_what_is_not_there_is_refused(tmp_path, old, new, said):
    other_package(tmp_path, code=changed(old, new))
    assert f"vehicle other of other_package: {said}" in refusal(tmp_path)


def test_a_place_that_is_not_there_is_named_to_who_needs_it(tmp_path):
    code = changed("    package=", '    parameters="other_link.none:Settings", package=')
    other_package(tmp_path, code=code)
    with installed(tmp_path), pytest.raises(NotRegisteredError) as raised:
        load(links()["rocket_motor"].parameters)
    assert str(raised.value) == (
        "other_link.none:Settings, which a link names, cannot be imported: No module named "
        "'other_link.none': correct the place in its LinkKind, or install what it needs"
    )


def test_a_campaign_with_a_part_that_is_not_there_ends_in_one_line(tmp_path):
    code = changed("    package=", '    part="other_link.none:Part", package=')
    other_package(tmp_path, code=code)
    tell = (
        "import sys; sys.argv = ['campaign', '--flights', '1']; "
        "from chute_ros.tools.campaign import main; main()"
    )
    done = python(tell, tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("campaign: other_link.none:Part, which a link names, cannot be ")


def test_a_tool_that_is_started_beside_a_wrong_link_ends_in_one_line(tmp_path):
    other_package(tmp_path, code=changed('"other"', '"mavlink"'))
    tell = "import sys; from chute_ros.tools.{0} import main; sys.argv = ['{0}', '--help']; main()"
    for tool in ("campaign", "sim"):
        done = python(tell.format(tool), tmp_path)
        assert done.returncode == 2
        (line,) = done.stderr.splitlines()
        assert line.startswith(f"{tool}: chute_ros.links rocket_motor = other_link:LINK: the ")


def test_the_defaults_of_a_node_need_no_settings_of_another(tmp_path):
    code = changed("    package=", '    parameters="other_link.none:Settings", package=')
    other_package(tmp_path, code=code)
    tell = (
        "from chute_ros.tools.chute.parameter_list import defaults_for as told; "
        "from chute_ros.tools.parameter_docs import NODES\n"
        "for node in ('safety_supervisor', 'relay'):\n"
        "    names = [one.name for one in NODES[node]]\n"
        "    print(len(told(node, names)) == len(told('by_another_name', names)) == len(names))\n"
        "print(told('rocket_motor', ['connection']))"
    )
    done = python(tell, tmp_path)
    assert done.stdout.splitlines() == ["True", "True", "{}"], done.stderr


def test_a_link_that_the_campaign_cannot_fly_leaves_its_flights_as_they_are(tmp_path):
    code = OTHERS.replace('name="rocket_motor"', 'name="rocket_motor", part=""')
    tell = (
        "from pathlib import Path; from chute_ros.campaign.draw import draw; "
        "from chute_ros.campaign.shipped import Shipped; "
        "Shipped(Path()).read_all(); print([draw(n) for n in range(50)])"
    )
    (tmp_path / "without").mkdir()
    other_package(tmp_path, code=code)
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
    assert said in refusal(tmp_path)


def test_without_any_it_says_what_to_do(monkeypatch):
    monkeypatch.setattr(registered, "entry_points", lambda group: ())
    read_anew()
    with pytest.raises(NotRegisteredError, match=r"build chute_ros and source install/setup"):
        links()


def test_a_kind_is_made_of_texts_and_functions_alone():
    """It is read by launch files and by the campaign, which have no ROS."""
    code = "import sys; from chute_ros.links.registered import links; links(); print(*sys.modules)"
    done = python(code, ROOT)
    assert done.returncode == 0, done.stderr
    assert not {"rclpy", "dronecan", "pymavlink", "serial"} & {*done.stdout.split()}
    assert isinstance(links()[api.AUTOPILOT_LINK], LinkKind)
