"""The launch files refer to what there is. `launch` itself is not among the wheels."""

import ast
import importlib.util
import itertools
import subprocess
import sys
import tempfile
import time
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import SimpleNamespace

import ament_index_python.packages as ament
import pytest
from launch_files import LAUNCH, Recorded, loaded, made_by
from other_package import OTHERS, changed, other_package

from chute_ros.links import registered
from chute_ros.links.api import Sockets
from chute_ros.links.registered import links, vehicles
from chute_ros.links.upf.protocol.parameters import AUTOMATIC
from chute_ros.links.upf.simulator.memory import CONTROLLER_PARAMETERS
from chute_ros.links.upf.simulator.sim_upf import _parameters
from chute_ros.ros.middleware import LEADS_ELSEWHERE

ROOT = Path(__file__).resolve().parents[2]
SIMULATION, VEHICLE = FILES = sorted(LAUNCH.glob("*.launch.py"))
EVERY = pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Where simulation.launch.py makes the folders of the control sockets and of what is kept."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    return tmp_path


def calls(file, name):
    """The keyword arguments of every call of name, as source."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == name:
            found.append({k.arg: ast.unparse(k.value) for k in node.keywords})
            found[-1] |= {index: ast.unparse(value) for index, value in enumerate(node.args)}
    return found


def executables():
    """What setup.py installs: name -> module."""
    installed = entry_points(group="console_scripts")
    ours = [one for one in installed if one.value.startswith("chute_ros.")]
    return {one.name: one.module for one in ours}


def test_there_are_launch_files_with_and_without_simulators():
    assert [file.name for file in FILES] == ["simulation.launch.py", "vehicle.launch.py"]


@EVERY
def test_every_argument_that_it_uses_is_declared_and_described(file):
    declared = calls(file, "DeclareLaunchArgument")
    used = {call[0] for call in calls(file, "LaunchConfiguration")}
    assert {call[0] for call in declared} == used
    assert all(call.get("description") for call in declared)


def test_the_files_that_they_name_are_installed():
    setup = (ROOT / "setup.py").read_text()
    for pattern in ("launch/*.py", "config/*.yaml", "config/*.xml"):
        folder = pattern.partition("/")[0]
        assert f'"/{folder}", glob("{pattern}")' in setup
    for file in FILES:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.JoinedStr):
                text = ast.unparse(node).strip("f'\"")
                if text.startswith("{share}/"):
                    assert (ROOT / text.removeprefix("{share}/")).is_file(), text


def test_no_link_can_have_an_argument_that_they_have_themselves():
    declared = {
        ast.literal_eval(call[0])
        for file in FILES
        for call in calls(file, "DeclareLaunchArgument")
        if call[0].startswith("'")
    }
    assert declared == {*registered.LAUNCH_ARGUMENTS}


def test_every_parachute_that_can_be_chosen_has_a_parameter_file():
    for parachute in vehicles():
        assert (ROOT / "config" / f"{parachute}_vehicle.yaml").is_file()


def test_the_simulation_stays_on_this_host():
    variables = calls(SIMULATION, "SetEnvironmentVariable")
    set_to = {variable[0]: variable[1] for variable in variables}
    assert set_to["'ROS_AUTOMATIC_DISCOVERY_RANGE'"] == "'LOCALHOST'"
    (variable,) = calls(SIMULATION, "UnsetEnvironmentVariable")
    assert variable[0] == "name"
    assert "for name in LEADS_ELSEWHERE" in SIMULATION.read_text()
    assert {"ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER"} < set(LEADS_ELSEWHERE)
    assert "0.0.0.0" not in SIMULATION.read_text()


def test_the_simulators_take_the_options_that_are_given_to_them():
    sockets = Sockets("127.0.0.1:1", "127.0.0.1:2", "mcast:0:3", "/tmp/none")
    given = {
        command[0]: {word for word in command if word.startswith("--")}
        for vehicle in vehicles().values()
        for link in vehicle.links
        for command in links()[link].simulators(vehicle, sockets)
    }
    assert len(given) >= 4
    for name, options in given.items():
        command = [sys.executable, "-m", executables()[name], "--help"]
        known = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert {one for one in options if one not in known} == set(), name


def nodes_of(monkeypatch, **given):
    """What vehicle.launch.py starts: executable -> with what."""
    made = made_by(VEHICLE, monkeypatch, **given)
    return {one.options["executable"]: one.options for one in made if "executable" in one.options}


def test_the_vehicle_gives_its_nodes_the_namespace_and_the_file(monkeypatch):
    given = {"parachute": "upf", "namespace": "drone1", "bus": "socketcan:can0"}
    for node, options in nodes_of(monkeypatch, **given).items():
        assert options["namespace"] == "drone1"
        file, *more = options["parameters"]
        assert file.endswith("/config/upf_vehicle.yaml")
        assert more == ([{"connection": "socketcan:can0"}] if node == "upf_can" else [])


def install(folder, monkeypatch, code=OTHERS, shares=None):
    """Have a link of another package; shares: ROS package -> its share folder."""
    other_package(folder, code=code)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "other_link", raising=False)
    entry = EntryPoint("rocket_motor", "other_link:LINK", registered.GROUP)
    ours = registered.entry_points(group=registered.GROUP)
    monkeypatch.setattr(registered, "entry_points", lambda group: [*ours, entry])
    for known in (links, vehicles):
        known.cache_clear()
    share = ament.get_package_share_directory

    def share_of(package):
        if package != "other_package":
            return share(package)
        if not shares:
            raise ament.PackageNotFoundError(package)
        return str(shares)

    monkeypatch.setattr(ament, "get_package_share_directory", share_of)


@pytest.fixture
def another(folder, monkeypatch):
    """Call it to install another package."""
    yield lambda **how: install(folder, monkeypatch, **how)
    monkeypatch.undo()
    for known in (links, vehicles):
        known.cache_clear()


def test_a_vehicle_of_another_package_without_a_file_gets_what_its_entry_says(
    another, monkeypatch, capsys
):
    another()
    nodes = nodes_of(monkeypatch, parachute="other", namespace="rocket", motor="file:/tmp/motor")
    named = {key: ["rocket_motor"] for key in ("required_links", "kill_links", "deploy_links")}
    assert nodes["rocket_motor"]["package"] == "other_package"
    assert nodes["rocket_motor"]["parameters"] == [{"connection": "file:/tmp/motor"}]
    assert nodes["safety_supervisor"]["parameters"] == [named]
    told = capsys.readouterr().err
    assert told.startswith("vehicle.launch.py: other_package has no config/other_vehicle.yaml: ")
    assert told.endswith("(or config:=FILE)\n")


FILE = """
/**/rocket_motor:
  ros__parameters:
    pulse_time: 3.0
/**/safety_supervisor:
  ros__parameters:
    required_links: [rocket_motor]
"""


def test_a_vehicle_of_another_package_gets_the_file_that_this_package_has(
    another, folder, monkeypatch, capsys
):
    (folder / "config").mkdir()
    file = folder / "config" / "other_vehicle.yaml"
    file.write_text(FILE)
    another(shares=folder)
    for node in nodes_of(monkeypatch, parachute="other", namespace="rocket").values():
        assert node["parameters"] == [str(file)]
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "SUPERVISOR: NAMED}",
            'SUPERVISOR: NAMED, "rocket_motor": {"pulse_tme": 3.0}}',
            "rocket_motor has no parameter pulse_tme: did you mean pulse_time?",
        ),
        (
            "SUPERVISOR: NAMED}",
            'SUPERVISOR: NAMED, "rocket_motor": {"pulse_time": 3}}',
            "rocket_motor: parameter pulse_time is 3: need a number (1.0, not 1) from ",
        ),
        (
            "SUPERVISOR: NAMED}",
            'SUPERVISOR: {**NAMED, "min_battery": 0.5}}',
            "safety_supervisor has no parameter min_battery",
        ),
    ],
)
def test_an_entry_that_gives_a_parameter_that_cannot_be_ends_the_launch_in_one_line(
    old, new, said, another, monkeypatch, capsys
):
    another(code=changed(old, new))
    with pytest.raises(SystemExit) as ended:
        nodes_of(monkeypatch, parachute="other", namespace="rocket")
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert told.startswith(f"vehicle.launch.py: vehicle other of other_package: {said}")
    assert told.count("\n") == 1


def test_a_wrong_link_ends_the_launch_in_one_line(another, monkeypatch, capsys):
    another(code=changed('name="other"', 'name="mavlink"'))
    for file in FILES:
        space = loaded(file, monkeypatch)
        with pytest.raises(SystemExit) as ended:
            space["generate_launch_description"]()
        assert ended.value.code == 2
        told = capsys.readouterr().err
        assert told.startswith(f"{file.name}: chute_ros.links rocket_motor = other_link:LINK: the")
        assert told.count("\n") == 1


def test_a_simulation_gives_the_vehicle_the_file_that_is_given(monkeypatch):
    for given in ("", "/tmp/mine.yaml"):
        made = made_by(SIMULATION, monkeypatch, parachute="mavlink", config=given)
        (included,) = [one for one in made if type(one).__name__ == "IncludeLaunchDescription"]
        assert dict(included.options["launch_arguments"])["config"] == given


def test_a_vehicle_whose_simulators_have_no_failures_says_so(another, monkeypatch, capsys):
    code = changed(
        "LINK = replace(",
        """
def simulators(vehicle, sockets):
    return (("sim_motor", "--link", sockets.terminal),)

LINK = replace(""",
    ).replace("    package=", "    simulators=simulators, package=")
    another(code=code)
    with pytest.raises(SystemExit):
        made_by(SIMULATION, monkeypatch, parachute="other", fail="motor@5")
    assert capsys.readouterr().err == (
        "simulation.launch.py: fail is 'motor@5': nothing can fail in a vehicle with sim_motor: "
        "leave fail out\n"
    )


#: Parachute -> what vehicle.launch.py starts for it, and simulation.launch.py beside that.
STARTED = {
    "mavlink": ({"mavlink_parachute"}, {"sim_autopilot", "sim_mavlink_parachute", "sim_bench"}),
    "upf": ({"mavlink_parachute", "upf_can"}, {"sim_autopilot", "sim_upf", "sim_bench"}),
    "both": (
        {"mavlink_parachute", "upf_can"},
        {"sim_autopilot", "sim_mavlink_parachute", "sim_upf", "sim_bench"},
    ),
    "umbilical": ({"umbilical"}, {"sim_flight_computer", "sim_bench"}),
}


@pytest.mark.parametrize("parachute", STARTED)
@EVERY
def test_its_function_makes_the_nodes_and_simulators_of_every_parachute(
    file, parachute, monkeypatch
):
    made = made_by(file, monkeypatch, parachute=parachute, namespace="drone1")
    names = {one.options.get("executable") or one.options.get("name") for one in made}
    nodes, simulators = STARTED[parachute]
    assert names - {None} == ({*nodes, "safety_supervisor"} if file == VEHICLE else simulators)
    if file == VEHICLE:
        started = [one for one in made if "executable" in one.options]
        assert all(one.options["respawn"] for one in started), "what dies is started again"


def exits_of(name, monkeypatch):
    """What vehicle.launch.py does as its node name exits, by exit code."""
    made = made_by(VEHICLE, monkeypatch, parachute="mavlink")
    (node,) = [one for one in made if one.options.get("executable") == name]
    return lambda code: node.options["on_exit"](SimpleNamespace(returncode=code), None)


@pytest.mark.parametrize("name", ["mavlink_parachute", "safety_supervisor"])
def test_a_node_that_refuses_to_start_ends_the_launch(name, monkeypatch):
    """It would be started again each 0.5 s, for ever."""
    exited = exits_of(name, monkeypatch)
    with pytest.raises(RuntimeError, match=f"^{name} refuses to start, for the reason"):
        exited(2)


@pytest.mark.parametrize("code", [0, 1, -9, -11])
def test_a_node_that_dies_ends_nothing_and_neither_does_its_next_refusal(code, monkeypatch):
    """The other nodes may be in the air."""
    exited = exits_of("safety_supervisor", monkeypatch)
    exited(code)
    exited(2)


def test_a_node_that_exits_with_2_long_after_the_launch_ends_nothing(monkeypatch):
    exited = exits_of("safety_supervisor", monkeypatch)
    later = time.monotonic() + 61.0
    monkeypatch.setattr(time, "monotonic", lambda: later)
    exited(2)


@pytest.mark.parametrize("parachute", vehicles())
@EVERY
def test_it_starts_what_setup_installs(file, parachute, monkeypatch):
    made = made_by(file, monkeypatch, parachute=parachute)
    names = {one.options.get("executable") or one.options.get("name") for one in made} - {None}
    assert names
    assert names <= executables().keys()


@pytest.mark.parametrize(
    ("given", "who"),
    [
        ({}, "LOCALHOST"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "SUBNET"),
        ({"ROS_STATIC_PEERS": "192.0.2.1"}, "SUBNET"),
        ({"ROS_DISCOVERY_SERVER": "192.0.2.1:11811"}, "SUBNET"),
        (
            {"ROS_STATIC_PEERS": "192.0.2.1", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
            "LOCALHOST",
        ),
    ],
)
def test_a_vehicle_is_heard_on_its_own_computer_unless_it_is_said_otherwise(
    given, who, monkeypatch
):
    for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", *LEADS_ELSEWHERE):
        monkeypatch.delenv(name, raising=False)
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    space = loaded(VEHICLE, monkeypatch)
    Recorded.made.clear()
    space["generate_launch_description"]()
    (argument,) = [one for one in Recorded.made if one.args[:1] == ("range",) and one.options]
    assert argument.options["default_value"] == who


def test_the_range_is_of_the_vehicles_nodes_alone(monkeypatch):
    """Not of what an including launch file starts after them."""
    nodes = nodes_of(monkeypatch, parachute="mavlink", range="SUBNET")
    for node in nodes.values():
        assert node["additional_env"] == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    assert "SetEnvironmentVariable" not in VEHICLE.read_text()


@pytest.mark.parametrize("parachute", ["upf", "both"])
def test_a_simulated_upf_can_be_armed_by_command(parachute, monkeypatch):
    """As delivered it arms by itself, and rejects who tells it to."""
    made = made_by(SIMULATION, monkeypatch, parachute=parachute, namespace="sim")
    (upf,) = [one.options["cmd"] for one in made if one.options.get("name") == "sim_upf"]
    given = [after for before, after in itertools.pairwise(upf) if before == "--parameter"]
    values = {**CONTROLLER_PARAMETERS, **_parameters(given)}
    assert [name for name in AUTOMATIC if values[name]] == []


def test_each_simulator_is_reached_by_sim_bench_and_told_its_part_of_the_flight(
    folder, monkeypatch
):
    given = {"parachute": "mavlink", "fly": "60", "fail": "refuse@0,motor@15", "wind": "5"}
    made = made_by(SIMULATION, monkeypatch, **given)
    commands = {one.options["name"]: one.options["cmd"] for one in made if "cmd" in one.options}
    (bench,) = [one for one in made if one.options.get("executable") == "sim_bench"]
    (parameters,) = bench.options["parameters"]
    assert parameters["vehicle"] == "mavlink"
    assert parameters["folder"].startswith(str(folder))
    for name, command in commands.items():
        at = command.index("--control")
        assert command[at + 1] == f"{parameters['folder']}/{name}.sock"
    assert "26:fail-motor" in commands["sim_autopilot"]
    assert "0:wind=5" in commands["sim_autopilot"]
    assert "11:refuse" in commands["sim_mavlink_parachute"]


def test_what_a_simulated_vehicle_keeps_is_of_that_run_alone(folder, monkeypatch):
    """A run before it left the vehicle without its parachute: the next one never took off. And a
    real vehicle may have the same namespace."""
    made = made_by(SIMULATION, monkeypatch, parachute="mavlink")
    (variable,) = [one for one in made if one.args[:1] == ("ROS_HOME",)]
    home = Path(variable.args[1])
    assert home.parent == folder / "chute_ros" / "simulations"
    assert list(home.iterdir()) == []
    (group,) = [one for one in made if type(one).__name__ == "GroupAction"]
    first, *others = group.args[0]
    assert first is variable
    assert {type(one).__name__ for one in others} >= {"IncludeLaunchDescription", "Node"}


@pytest.mark.parametrize(
    ("pushed", "namespace", "place"),
    [
        (None, "", ""),
        (None, "drone1", "/drone1"),
        (None, "/fleet/drone1", "/fleet/drone1"),
        ("/fleet", "drone1", "/fleet/drone1"),
    ],
)
def test_each_node_of_a_vehicle_gets_its_own_enclave_if_asked_to(
    pushed, namespace, place, monkeypatch
):
    given = {"parachute": "both", "namespace": namespace, "pushed": pushed}
    for enclaves in ("true", "false"):
        made = made_by(VEHICLE, monkeypatch, **given, enclaves=enclaves)
        nodes = [one.options for one in made if "executable" in one.options]
        assert len(nodes) == 3
        for node in nodes:
            own = ["--enclave", f"{place}/{node['executable']}"]
            assert node["ros_arguments"] == (own if enclaves == "true" else [])


def test_the_action_is_started_beside_the_supervisor_if_asked_for(monkeypatch):
    """It takes no file: it has no parameters."""
    for asked, more in (("true", ["deploy_action"]), ("false", []), ("", [])):
        given = {"parachute": "mavlink", "namespace": "drone1", "deploy_action": asked}
        nodes = nodes_of(monkeypatch, **given)
        assert list(nodes) == ["mavlink_parachute", "safety_supervisor", *more]
        for name in more:
            assert (nodes[name]["namespace"], nodes[name]["parameters"]) == ("drone1", [])


@EVERY
def test_it_makes_a_description(file):
    """Really, where `launch` is there; elsewhere at least as Python with that one function."""
    code = compile(file.read_text(), str(file), "exec")
    if all(importlib.util.find_spec(name) for name in ("launch.actions", "launch_ros")):
        space = {}
        exec(code, space)
        description = space["generate_launch_description"]()
        assert len(description.entities) >= 3
    else:
        functions = [n.name for n in ast.parse(file.read_text()).body if hasattr(n, "name")]
        assert "generate_launch_description" in functions
