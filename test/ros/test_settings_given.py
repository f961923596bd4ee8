"""No node and no launch file starts on settings that nobody gave: one line, and exit code 2."""

import importlib.util
import itertools
import os
import subprocess
import sys
import tempfile
from functools import partial

import pytest
from launch_files import LAUNCH, Recorded, made_by
from starts import starts

from chute_ros.errors import ParameterError
from chute_ros.ros.parameter_file import files_of, given_in, taken
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch) -> None:
    """Where simulation.launch.py makes the folder of the control sockets."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "home"))


def refused_starts(node: str, *cases: list[str]) -> list[list[str]]:
    """What a node says of each of these arguments, none of which is to start it: its lines."""
    told = starts(node, *cases)
    assert [(code, out) for code, out, _ in told] == [(2, "")] * len(cases), told
    return [err.splitlines() for _, _, err in told]


#: Arguments, and what is told of them.
REFUSED = [
    (("--params-file", "FOLDER/none.yaml"), "Couldn't parse params file: '--params-file"),
    (("--params-file", "FOLDER/broken.yaml"), "Couldn't parse params file: '--params-file"),
    (("--params-file", "FOLDER/fifo"), "fifo: no regular file but a FIFO"),
    (("--params-file",), "Couldn't parse trailing --params-file flag"),
    (("-r",), "Couldn't parse trailing -r flag"),
    (("-r", "word"), "Couldn't parse remap rule: '-r word': need OLD:=NEW, names of letters, dig"),
    (("-r", "parachute/status:=of-drone-1"), "names of letters, digits and _ alone, a namespace"),
    (("--log-level", "loud"), "'--log-level loud': need debug, info, warn, error or fatal"),
    (
        ("mode:=SHADOW",),
        "ROS has no argument 'mode:=SHADOW': a parameter is set by -p NAME:=VALUE",
    ),
    (("-p", "call_tries"), "rule: '-p call_tries': need PARAMETER:=VALUE, an empty text as"),
    (("--params-file", "FOLDER/other.yaml"), "other.yaml has no ros__parameters for /"),
    (("-p", "nobody:mode:=SHADOW"), "'-p nobody:mode:=SHADOW' is for a node /nobody, this"),
    (("-p", "url:=x"), "'-p url:=x': /"),
    (("--param", "url:=x"), "has no parameter url: correct its name, or leave it out"),
    (("--params-file", "FOLDER/unknown.yaml"), "has no parameter url: correct its name, or"),
]


@pytest.mark.parametrize("node", ["upf_can", "safety_supervisor"])
def test_a_node_does_not_start_on_what_cannot_be_read_or_is_not_for_it(node, tmp_path):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "broken.yaml").write_text("upf_can: [")
    (tmp_path / "unknown.yaml").write_text(f"/**/{node}:\n  ros__parameters:\n    url: x\n")
    (tmp_path / "other.yaml").write_text("somebody:\n  ros__parameters:\n    call_tries: 4\n")
    given = [
        ["--ros-args", *(one.replace("FOLDER", str(tmp_path)) for one in arguments)]
        for arguments, _ in REFUSED
    ]
    told = refused_starts(node, *given)
    for arguments, (_, words), (line,) in zip(given, REFUSED, told, strict=True):
        assert line.startswith(f"{node}: "), arguments
        assert words in line, arguments


def test_a_name_that_does_not_fit_its_namespace_is_told_with_the_fix(tmp_path):
    path = tmp_path / "settings.yaml"
    path.write_text("upf_can:\n  ros__parameters:\n    call_tries: 4\n")
    (*_of_ros, unreadable), (rooted,), (named,) = refused_starts(
        "upf_can",
        ["--ros-args", "-r", "__ns:=/drone-1"],
        ["--ros-args", "--params-file", str(path), "-r", "__ns:=/drone1"],
        ["--ros-args", "-p", "upf_can:call_tries:=4", "-r", "__ns:=/drone1"],
    )
    assert unreadable == (
        "upf_can: Failed to parse ROS arguments: Couldn't parse remap rule: '-r __ns:=/drone-1': "
        "need OLD:=NEW, names of letters, digits and _ alone, a namespace with / before it"
    )
    assert rooted == (
        f"upf_can: {path} has no ros__parameters for /drone1/upf_can (it has some for /upf_can): "
        "need for example '/**/upf_can:' with 'ros__parameters:' below"
    )
    # ROS knows no namespace there.
    assert named == (
        "upf_can: '-p upf_can:call_tries:=4' is for a node /upf_can, this one is /drone1/upf_can: "
        "leave 'upf_can:' out"
    )


def test_a_setting_that_is_given_as_something_else_is_told():
    (renames,), (unknown, usage) = refused_starts(
        "safety_supervisor",
        ["--ros-args", "-r", "mode:=SHADOW"],
        ["--ros-args", "--", "mode:=SHADOW"],
    )
    assert renames == (
        "safety_supervisor: '-r mode:=SHADOW' gives topics another name: mode is set by '-p'"
    )
    assert unknown == (
        "safety_supervisor: unknown argument mode:=SHADOW: the settings of a node follow "
        "--ros-args"
    )
    assert "[-p PARAMETER:=VALUE]" in usage


def test_what_a_file_has_for_others_or_for_all_and_what_is_ros_own_does_not_stop_a_start(
    bench, tmp_path, capfd
):
    path = tmp_path / "settings.yaml"
    path.write_text(
        "/**/safety_supervisor:\n  ros__parameters:\n    mode: SHADOW\n    use_sim_time: false\n"
        "    qos_overrides: {/safety/state: {publisher: {depth: 1}}}\n"
        "/**:\n  ros__parameters:\n    of_all: 1\n"
        "/**/somebody:\n  ros__parameters:\n    url: x\n"
    )
    arguments = ["--ros-args", "--params-file", str(path), "-p", "use_sim_time:=false"]
    started = partial(SafetySupervisorNode, cli_args=arguments, started_with=arguments)
    node = bench.add(started)
    assert node.values["mode"] == "SHADOW"
    told = capfd.readouterr().err
    assert "has no parameter of_all, its value is not used" in told
    assert "url" not in told


def test_what_a_node_takes_from_where_is_told(tmp_path):
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text("/**/upf_can:\n  ros__parameters:\n    b: 1\n    c: 1\n    foreign: 2\n")
    second.write_text("/**:\n  ros__parameters:\n    c: 2\n    nested:\n      d: 3\n")
    files = ["--ros-args", "--params-file", str(first), "--params-file", str(second)]
    assert files_of([*files, "--", "--params-file", "not ROS's"]) == [first, second]
    given = ["b", "c", "e", "nested.d"]
    told = taken(files, "/a/upf_can", ["a", *given], given)
    assert told == (
        f"5 parameters: 1 from {first}, 2 from {second}, 1 from the command line, 1 by default"
    )
    assert taken([], "/a/upf_can", ["a", "b"], []) == "2 parameters: 2 by default"
    launched = second.rename(tmp_path / "launch_params_x7")
    told = taken(["--ros-args", "--params-file", str(launched)], "/a/upf_can", ["c"], ["c"])
    assert told == "1 parameters: 1 from the launch file, 0 by default"


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("upf_can", True),
        ("/upf_can", True),
        ("/**", True),
        ("/**/upf_can", True),
        ("/*/upf_can", False),
        ("/drone1/upf_can", False),
        ("/**/upf", False),
    ],
)
def test_names_of_nodes_count_as_with_ros(name, found, tmp_path):
    path = tmp_path / "settings.yaml"
    path.write_text(f"{name}:\n  ros__parameters:\n    a: 1\n")
    if found:
        assert given_in(path, "/upf_can") == {"a": 1}
    else:
        with pytest.raises(ParameterError, match="has no ros__parameters for /upf_can"):
            given_in(path, "/upf_can")


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("system_id: 010", "line 3: system_id is 010, which YAML reads as 8: write 8"),
        ("names: [a, 1_0]", "line 3: names is 1_0, which YAML reads as 10"),
        ("on_lost: no", "line 3: on_lost is no, which YAML reads as false"),
        ("a: {b: 1:30}", "line 3: a.b is 1:30, which YAML reads as 90"),
        ("a: 1\n    a: 2", "line 4: a is there twice: leave one of them"),
    ],
)
def test_a_value_that_yaml_reads_as_another_is_refused_where_it_is_ours(line, told, tmp_path):
    """Other nodes' sections are their own matter."""
    path = tmp_path / "settings.yaml"
    section = f"  ros__parameters:\n    {line}\n"
    path.write_text(f"/**/upf_can:\n{section}/**/other:\n  ros__parameters: {{}}\n")
    with pytest.raises(ParameterError) as caught:
        given_in(path, "/upf_can")
    assert told in str(caught.value)
    assert given_in(path, "/other") == {}


# -- launch files ---------------------------------------------------------------------------------

VEHICLE, SIMULATION = "vehicle.launch.py", "simulation.launch.py"
GOOD = "/**/mavlink_parachute:\n  ros__parameters:\n    {}\n/**/safety_supervisor:\n"
GOOD += "  ros__parameters:\n    mode: SHADOW\n"


AS_ROS2_LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import AnyLaunchDescriptionSource
source = AnyLaunchDescriptionSource(sys.argv[1])
given = [tuple(one.split(":=", 1)) for one in sys.argv[2:]]
service = LaunchService(argv=sys.argv[2:])
include = IncludeLaunchDescription(source, launch_arguments=given)
service.include_launch_description(LaunchDescription([include]))
sys.exit(service.run())
"""


def nodes_of(made: list[Recorded]) -> list[Recorded]:
    return [one for one in made if "executable" in one.options]


def refused(monkeypatch, capsys, file: str, **arguments: str) -> str:
    """What a launch file says that starts nothing."""
    with pytest.raises(SystemExit) as ended:
        made_by(LAUNCH / file, monkeypatch, **arguments)
    assert ended.value.code == 2
    assert not nodes_of(Recorded.made)
    (line,) = capsys.readouterr().err.splitlines()
    return line.removeprefix(f"{file}: ")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "settings.yaml: No such file or directory"),
        ("a: [", "settings.yaml cannot be read: while parsing"),
        (GOOD.format("rate: 1").replace("/**/m", "m"), "no ros__parameters for /drone1/mavlink_p"),
        (GOOD.format("conection: x"), "has no parameter conection: did you mean connection?"),
        (GOOD.format("connection: 7"), "mavlink_parachute: parameter connection is 7: need"),
    ],
)
def test_a_vehicle_does_not_start_with_a_file_that_is_not_all_for_it(
    text, words, tmp_path, monkeypatch, capsys
):
    path = tmp_path / "settings.yaml"
    if text is not None:
        path.write_text(text)
    given = {"parachute": "mavlink", "namespace": "drone1", "config": str(path)}
    line = refused(monkeypatch, capsys, VEHICLE, **given)
    assert str(path) in line
    assert words in line


@pytest.mark.parametrize(
    ("parachute", "argument", "value", "words"),
    [
        ("mavlink", "connection", "x", "connection 'x' is not understood: need udpin:HOST:PORT"),
        ("mavlink", "connection", "udpin:0.0.0.0:99999", "port '99999' is no number from 0 to"),
        ("mavlink", "connection", "/dev/ttyUSB0", "did you mean 'serial:/dev/ttyUSB0'?"),
        ("upf", "bus", "can0", "connection 'can0' is not understood: need mcast:BUS[:PORT]"),
        ("upf", "bus", "mcast:256", "bus '256' is no number from 0 to 255"),
        ("umbilical", "cable", "udpin:0.0.0.0:1", "is no serial port: need serial:PATH[:BAUD]"),
        ("relay", "output", "gpio17", "connection 'gpio17' is no output: need file:PATH"),
    ],
)
def test_a_connection_that_no_node_would_take_is_told_by_the_launch_file(
    parachute, argument, value, words, monkeypatch, capsys
):
    line = refused(monkeypatch, capsys, VEHICLE, parachute=parachute, **{argument: value})
    assert line.startswith(f"launch argument {argument}: ")
    assert words in line


def test_a_connection_in_a_file_is_looked_at_unless_an_argument_overrides_it(
    tmp_path, monkeypatch, capsys
):
    path = tmp_path / "settings.yaml"
    path.write_text(GOOD.format("connection: to be filled in"))
    given = {"parachute": "mavlink", "config": str(path)}
    line = refused(monkeypatch, capsys, VEHICLE, **given)
    assert line.startswith(f"{path}: mavlink_parachute: connection 'to be filled in' is not")
    made = made_by(LAUNCH / VEHICLE, monkeypatch, **given, connection="udpin:0.0.0.0:1")
    assert len(nodes_of(made)) == 2


def test_a_profile_that_no_supervisor_would_take_is_told_before_anything_starts(
    tmp_path, monkeypatch, capsys
):
    path = tmp_path / "settings.yaml"
    path.write_text(
        GOOD.format("connection: udpin:0.0.0.0:1").replace("mode: SHADOW", "profile: by_hnd")
    )
    line = refused(monkeypatch, capsys, VEHICLE, parachute="mavlink", config=str(path))
    assert line.startswith(f"{path}: safety_supervisor: parameter profile is 'by_hnd': ")
    assert line.endswith(
        "need one of by_hand, fixed_wing, multirotor, rocket, or the path of a file"
    )


def test_with_a_file_that_is_for_it_it_starts(tmp_path, monkeypatch):
    path = tmp_path / "settings.yaml"
    path.write_text(GOOD.format("connection: udpin:0.0.0.0:1"))
    given = {"parachute": "mavlink", "namespace": "drone1", "config": str(path)}
    made = made_by(LAUNCH / VEHICLE, monkeypatch, **given)
    assert len(nodes_of(made)) == 2


@pytest.mark.parametrize(
    ("file", "name", "meant"),
    [
        (VEHICLE, "conection", "connection"),
        (VEHICLE, "name_space", "namespace"),
        (SIMULATION, "parachut", "parachute"),
    ],
)
def test_a_launch_argument_that_is_misspelt_is_told(file, name, meant, monkeypatch, capsys):
    foreign = {"launched": "/parent.launch.py", "somebody_elses": "too", "parachute": "mavlink"}
    told = f"there is no launch argument {name}: did you mean {meant}?"
    assert refused(monkeypatch, capsys, file, **{name: "given"}) == told
    assert refused(monkeypatch, capsys, file, **{name: "given"}, **foreign) == told
    assert nodes_of(made_by(LAUNCH / file, monkeypatch, **foreign))


@pytest.mark.parametrize("file", [VEHICLE, SIMULATION])
@pytest.mark.parametrize("name", ["configs", "namespaces", "connections", "ports"])
def test_an_argument_that_an_including_file_declares_is_its_own_however_like_one_of_ours(
    file, name, monkeypatch
):
    theirs = {"launched": "/fleet.launch.py", "declares": [name], name: "their own"}
    assert nodes_of(made_by(LAUNCH / file, monkeypatch, **theirs, parachute="mavlink"))


@pytest.mark.parametrize(
    ("pushed", "namespace", "place"),
    [
        ("/fleet", "drone1", "/fleet/drone1"),
        ("/drone1", "", "/drone1"),
        ("/", "drone1", "/drone1"),
        ("/fleet", "/drone1", "/drone1"),
    ],
)
def test_a_file_for_a_whole_name_is_for_the_node_in_the_namespace_that_was_pushed(
    pushed, namespace, place, tmp_path, monkeypatch, capsys
):
    """As PushRosNamespace does it, in an including launch file."""
    given = {"parachute": "mavlink", "namespace": namespace, "pushed": pushed}
    path = tmp_path / "settings.yaml"
    given |= {"launched": "/fleet.launch.py", "config": str(path)}
    theirs = GOOD.format("connection: udpin:0.0.0.0:1")
    path.write_text(theirs.replace("/**", place))
    assert len(nodes_of(made_by(LAUNCH / VEHICLE, monkeypatch, **given))) == 2
    path.write_text(theirs.replace("/**", "/elsewhere"))
    line = refused(monkeypatch, capsys, VEHICLE, **given)
    assert f"has no ros__parameters for {place}/mavlink_parachute" in line


@pytest.mark.parametrize("file", [VEHICLE, SIMULATION])
@pytest.mark.parametrize(
    "name", ["config_file", "params_file", "conn", "ns", "cfg", "use_sim_time", "x"]
)
def test_a_launch_argument_that_it_does_not_have_is_told_with_those_it_has(
    file, name, monkeypatch, capsys
):
    line = refused(monkeypatch, capsys, file, **{name: "given"})
    assert line.startswith(f"there is no launch argument {name}: need one of ")
    assert {"namespace", "parachute"} < {one.strip(",") for one in line.split()}


def test_capitals_do_not_hide_what_was_meant(monkeypatch, capsys):
    line = refused(monkeypatch, capsys, VEHICLE, CONFIG="my.yaml")
    assert line == "there is no launch argument CONFIG: did you mean config?"


def test_what_ros2_launch_adds_for_its_own_options_is_let_by(monkeypatch):
    given = {"parachute": "mavlink", "launch-prefix": "gdb", "launch-prefix-filter": "x"}
    assert nodes_of(made_by(LAUNCH / VEHICLE, monkeypatch, **given))


@pytest.mark.parametrize(
    ("parachute", "argument", "node", "fits"),
    [
        ("mavlink", "bus", "upf_can", "parachute:=upf or parachute:=both"),
        ("mavlink", "cable", "umbilical", "parachute:=umbilical"),
        ("upf", "output", "relay", "parachute:=relay"),
        ("umbilical", "connection", "mavlink_parachute", "parachute:=mavlink or "),
    ],
)
def test_the_argument_of_a_link_that_is_not_started_is_told_with_the_fix(
    parachute, argument, node, fits, monkeypatch, capsys
):
    """The vehicle would start without its parachute, on the defaults of another link."""
    given = {"parachute": parachute, argument: "socketcan:can0"}
    line = refused(monkeypatch, capsys, VEHICLE, **given)
    told = f"launch argument {argument} is 'socketcan:can0', and parachute:={parachute} starts no "
    assert line.startswith(f"{told}{node}: need {fits}")
    assert line.endswith(f", or leave {argument} out")
    # An argument of this name may be the including file's own.
    assert nodes_of(made_by(LAUNCH / VEHICLE, monkeypatch, "/parent.launch.py", **given))
    assert capsys.readouterr().err == f"{told}{node}: it is not used\n"


if importlib.util.find_spec("launch.actions"):  # where ROS is installed; there is no wheel of it

    @pytest.mark.parametrize("argument", ["ns:=drone1", "bus:=socketcan:can0"])
    def test_the_real_launch_ends_with_the_line(argument):
        """As `ros2 launch` does it."""
        done = subprocess.run(
            [sys.executable, "-c", AS_ROS2_LAUNCH, str(LAUNCH / VEHICLE), argument],
            capture_output=True,
            text=True,
            timeout=30.0,
            check=False,
        )
        assert done.returncode == 2
        assert f"{VEHICLE}: " in done.stderr
        assert "process started" not in done.stderr


@pytest.mark.parametrize("port", ["abc", "", "0", "65534", "-1", "1.5"])
def test_a_port_that_is_none_is_told(port, monkeypatch, capsys):
    line = refused(monkeypatch, capsys, SIMULATION, parachute="mavlink", port=port)
    assert line == f"port is {port!r}: need a whole number from 1 to 65533"


def flown(monkeypatch, **arguments: str) -> list[str]:
    """What the autopilot of a simulation is told to do."""
    made = made_by(LAUNCH / SIMULATION, monkeypatch, **arguments)
    (command,) = [one.options["cmd"] for one in made if one.options.get("name") == "sim_autopilot"]
    return [after for before, after in itertools.pairwise(command) if before == "--at"]


@pytest.mark.parametrize("parachute", ["mavlink", "upf", "relay"])
def test_a_simulation_flies_and_fails_as_it_is_told(parachute, monkeypatch):
    assert flown(monkeypatch, parachute=parachute) == ["0:wind=0.5"]
    start = ["10:arm", "11:takeoff=60", "0:wind=0.5"]
    assert flown(monkeypatch, parachute=parachute, fly="60") == start
    told = flown(monkeypatch, parachute=parachute, fly="60", fail="motor@15.5")
    assert told == [*start, "26.5:fail-motor"]


@pytest.mark.parametrize(
    ("fly", "fail", "words"),
    [
        ("high", "", "fly is 'high': need a height from 1 to 500 (m), for example 60"),
        ("0.5", "", "fly is '0.5': need a height"),
        ("501", "", "fly is '501': need a height"),
        ("nan", "", "fly is 'nan': need a height"),
        ("", "motor@15", "fail is 'motor@15': need fly too"),
        ("60", "motor", "fail is 'motor': need one of motor, autopilot, telemetry, link, "),
        ("60", "wing@15", "fail is 'wing@15': need one of"),
        ("60", "motor@-1", "fail is 'motor@-1': need one of"),
        ("60", "motor@nan", "fail is 'motor@nan': need one of"),
    ],
)
def test_a_flight_that_cannot_be_flown_is_told(fly, fail, words, monkeypatch, capsys):
    line = refused(monkeypatch, capsys, SIMULATION, parachute="mavlink", fly=fly, fail=fail)
    assert line.startswith(words)


def test_a_rocket_is_flown_by_its_flight_computer(monkeypatch, capsys):
    line = refused(monkeypatch, capsys, SIMULATION, parachute="umbilical", fly="60")
    words = "need a vehicle with sim_autopilot; this one has sim_flight_computer"
    assert line == f"fly is '60': {words}"
