"""Parameters: a bad value stops the start and is named; the file in config/ is all there is."""

import itertools
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from mavlink_bench import Autopilot, Network, quick
from rclpy.parameter import Parameter
from starts import starts

from chute_ros.errors import ParameterError
from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.links.registered import module_of
from chute_ros.links.umbilical.node import UmbilicalNode
from chute_ros.links.upf.node import UpfCanNode
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.ros.parameters import MISSPELT, nearest
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode
from chute_ros.tools.parameter_docs import NODES as NODE_PARAMETERS

NODES = {"mavlink_parachute": MavlinkParachuteNode, "safety_supervisor": SafetySupervisorNode}
CONFIG = Path(__file__).parents[2] / "config" / "mavlink_vehicle.yaml"
NAN, INF = float("nan"), float("inf")
MAVLINK, SUPERVISOR = NODES
UPF, UMBILICAL = "upf_can", "umbilical"

# node, parameter, value, what is allowed
BAD = [
    (MAVLINK, "connection", "udp:14550", "udpin:HOST:PORT"),
    (MAVLINK, "connection", "", "udpin:HOST:PORT"),
    (MAVLINK, "connection", "udpin:127.0.0.1:70000", "from 0 to 65535"),
    (MAVLINK, "connection", 14550, "text"),
    (MAVLINK, "system_id", 0, "a whole number from 1 to 255"),
    (MAVLINK, "system_id", 256, "a whole number from 1 to 255"),
    (MAVLINK, "system_id", "1", "a whole number from 1 to 255"),
    (MAVLINK, "component_id", -1, "a whole number from 1 to 255"),
    (MAVLINK, "parachute_system_id", 256, "a whole number from 0 to 255"),
    (MAVLINK, "autopilot_component_id", 1.0, "a whole number from 0 to 255"),
    (MAVLINK, "parachute_stale_after", 0.0, "from 0.1 to 600"),
    (MAVLINK, "parachute_lost_after", NAN, "from 0.1 to 600"),
    (MAVLINK, "autopilot_lost_after", INF, "from 0.1 to 600"),
    (MAVLINK, "ack_timeout", 1, "a number (1.0, not 1) from 0.02 to 60"),
    (MAVLINK, "ack_tries", 0, "a whole number from 1 to 100"),
    (MAVLINK, "give_up_after", -5.0, "from 0.1 to 600"),
    (MAVLINK, "default_triggers", 0, "a whole number from 1 to 255"),
    (MAVLINK, "ignored_error_flags", -1, "a whole number from 0 to"),
    (MAVLINK, "kill_method", "gently", "one of auto, flight_termination, forced_disarm"),
    (MAVLINK, "deploy_arms_trigger", "yes", "true or false"),
    (MAVLINK, "disarm_when_blocked", 1, "true or false"),
    (MAVLINK, "autopilot_message_rate", 1000.0, "from 0 to 100"),
    (MAVLINK, "max_decision_age", 60.0, "from 0.05 to 10"),
    (MAVLINK, "heartbeat_rate", 0.0, "from 1 to 100"),
    (MAVLINK, "signing_link_id", 256, "a whole number from 0 to 255"),
    (SUPERVISOR, "mode", "active", "one of ACTIVE, SHADOW, INHIBITED"),
    (SUPERVISOR, "required_links", "mavlink_parachute", "a list of texts"),
    (SUPERVISOR, "required_links", [1, 2], "a list of texts"),
    (SUPERVISOR, "kill_links", [""], "need at least one link's name"),
    (SUPERVISOR, "kill_links", ["upf_can"], "upf_can stops no motors; need links that do"),
    (SUPERVISOR, "kill_links", [MAVLINK, "relay"], "relay stops no motors"),
    (SUPERVISOR, "heartbeat_lost_after", 0.0, "from 0.05 to 600"),
    (SUPERVISOR, "deploy_timeout", NAN, "from 0.1 to 60"),
]


def test_a_bad_value_is_named_with_what_is_allowed(bench):
    for node, name, value, allowed in BAD:
        good = quick() if node == MAVLINK else {}
        with pytest.raises(ParameterError) as caught:
            bench.add(NODES[node], **(good | {name: value}))
        text = str(caught.value)
        assert re.search(rf"\b{name}\b|^{name.replace('_', ' ')} ", text), text
        assert repr(value) in text
        assert allowed in text
        assert "\n" not in text


@pytest.mark.parametrize(
    ("node", "name"), [(MAVLINK, "parachute"), (MAVLINK, "autopilot"), (SUPERVISOR, "heartbeat")]
)
def test_two_that_contradict_each_other_are_both_named(bench, node, name):
    stale, lost = f"{name}_stale_after", f"{name}_lost_after"
    with pytest.raises(ParameterError) as caught:
        bench.add(NODES[node], **{stale: 5.0, lost: 5.0})
    assert f"{stale} is 5.0" in str(caught.value)
    assert f"{lost} is 5.0" in str(caught.value)


@pytest.mark.parametrize("kind", [MavlinkParachuteNode, UpfCanNode, UmbilicalNode])
@pytest.mark.parametrize("bad", [{"heartbeat_rate": 0.0}, {"connection": "x"}])
def test_a_device_node_that_was_not_built_to_the_end_can_be_destroyed(bench, kind, bad):
    """As Kilted does with every node that it knows, once ROS is shut down."""
    destroy_half_built(bench, kind, bad)


@pytest.mark.parametrize("bad", [{"mode": "on"}, {"profile": "none"}])
def test_a_supervisor_that_was_not_built_to_the_end_can_be_destroyed(bench, bad):
    destroy_half_built(bench, SafetySupervisorNode, bad)


def destroy_half_built(bench, kind, bad):
    node = kind.__new__(kind)
    given = [Parameter(name, value=value) for name, value in bad.items()]
    with pytest.raises(ParameterError):
        node.__init__(namespace=bench.namespace, parameter_overrides=given)
    node.destroy_node()


def run(node, *parameters, namespace="/"):
    """A real process: its exit code and stderr."""
    done = subprocess.run(
        [sys.executable, "-m", module_of(node), "--ros-args", "-r", f"__ns:={namespace}"]
        + [word for parameter in parameters for word in ("-p", parameter)],
        capture_output=True,
        text=True,
        timeout=30.0,
        check=False,
    )
    return done.returncode, done.stderr


#: Node, parameter, what is said of it.
REFUSED = [
    (MAVLINK, "ack_tries:=0", "parameter ack_tries of {ns}/mavlink_parachute is 0: need a "),
    (MAVLINK, "connection:=udp", "connection 'udp' is not understood: need udpin:HOST:PORT"),
    (MAVLINK, "signing_key_file:=/none", "parameter signing_key_file: /none: No such file"),
    (SUPERVISOR, "mode:=on", "parameter mode of {ns}/safety_supervisor is "),
    (SUPERVISOR, "kill_links:=[]", "kill_links"),
    (
        SUPERVISOR,
        "require_vehicle_state:=[]",
        "vehicle_state of {ns}/safety_supervisor is []: need",
    ),
    (
        MAVLINK,
        "system_id:=[]",
        "system_id of {ns}/mavlink_parachute is []: need a whole number",
    ),
    (SUPERVISOR, "profile:=~nobody_at_all/x.yaml", "profile is '~nobody_at_all/x.yaml': "),
    (UMBILICAL, "telem_path:=~nobody_at_all", "parameter telem_path is '~nobody_at_all': "),
    (MAVLINK, "signing_key_file:=~nobody_at_all/key", "is '~nobody_at_all/key': "),
    (UPF, "dsdl_path:=~nobody_at_all", "parameter dsdl_path is '~nobody_at_all': "),
]


def assert_told(node, said, namespace, code, text):
    assert code == 2, text
    (line,) = text.splitlines()
    assert line.startswith(f"{node}: ")
    assert said.format(ns=namespace) in line


def test_a_real_start_ends_in_one_line(namespace):
    node, given, said = REFUSED[0]
    assert_told(node, said, namespace, *run(node, given, namespace=namespace))


@pytest.mark.parametrize("node", [*NODES, UPF, UMBILICAL])
def test_and_so_it_ends_whatever_is_wrong(namespace, node):
    mine = [(given, said) for whose, given, said in REFUSED if whose == node]
    cases = [["--ros-args", "-r", f"__ns:={namespace}", "-p", given] for given, _ in mine]
    for (_, said), (code, _, text) in zip(mine, starts(node, *cases), strict=True):
        assert_told(node, said, namespace, code, text)


@pytest.mark.parametrize("node", NODES)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_real_node_ends_cleanly_when_told_to(node, number, namespace, tmp_path, await_until):
    log = tmp_path / "log"
    connection = ["-p", "connection:=udpin:127.0.0.1:0"] if node == MAVLINK else []
    command = [sys.executable, "-m", module_of(node), "--ros-args"]
    with log.open("w") as output:
        process = subprocess.Popen(
            [*command, "-r", f"__ns:={namespace}", *connection],
            stderr=output,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        sign = "is open" if node == MAVLINK else "decision"
        await_until(lambda: sign in log.read_text(), "it runs")
        process.send_signal(number)
        assert process.wait(20.0) == 0, log.read_text()
    assert "Traceback" not in log.read_text()


@pytest.mark.parametrize("node", NODES)
def test_ctrl_c_while_a_node_is_being_loaded_ends_it_without_a_word(node):
    command = [sys.executable, "-X", "importtime", "-m", module_of(node)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        # Each module is told of once it has been imported.
        for line in process.stderr:
            if "rclpy." in line:
                process.send_signal(signal.SIGINT)
                break
        rest = process.stderr.read()
    assert process.returncode == -signal.SIGINT
    assert [line for line in rest.splitlines() if not line.startswith("import time:")] == []


# config/mavlink_vehicle.yaml


def own_parameters(node):
    """Those that are not ROS's."""
    ours = {p.name: p.value for p in node.get_parameters(list(node._parameters))}
    return {name: value for name, value in ours.items() if name in node.values}


@pytest.mark.parametrize("name", NODES)
def test_the_file_has_every_parameter_with_its_default_and_a_comment(bench, name, tmp_path):
    lines = CONFIG.read_text().splitlines()
    section = lines[lines.index(f"/**/{name}:") + 2 :]
    section = section[: section.index("") if "" in section else None]
    commented = [
        line.split(":")[0].strip()
        for before, line in itertools.pairwise(section)
        if not line.strip().startswith("#") and before.strip().startswith("#")
    ]
    given = yaml.safe_load(CONFIG.read_text())[f"/**/{name}"]["ros__parameters"]
    assert commented == list(given), "each has a comment above it"
    node = bench.add(NODES[name])
    declared = own_parameters(node)
    assert given == {key: list(v) if isinstance(v, tuple) else v for key, v in declared.items()}
    assert {key: type(value) for key, value in given.items()} == {
        key: type(value) for key, value in declared.items()
    }


@pytest.mark.parametrize("where", ["", "/drone1", "/fleet/drone1"])
@pytest.mark.parametrize(
    ("name", "line", "changed"),
    [
        (MAVLINK, "heartbeat_rate: 10.0", {"heartbeat_rate": 25.0}),
        (SUPERVISOR, "startup_grace: 10.0", {"startup_grace": 25.0}),
    ],
)
def test_the_file_is_taken_at_the_root_and_in_a_namespace(
    bench, tmp_path, where, name, line, changed
):
    text = CONFIG.read_text()
    assert text.count(line) == 1
    file = tmp_path / "mine.yaml"
    file.write_text(text.replace(line, line.split(":")[0] + ": 25.0"))
    namespace = where or "/"
    node = NODES[name](namespace=namespace, cli_args=["--ros-args", "--params-file", str(file)])
    try:
        assert own_parameters(node).items() >= changed.items()
    finally:
        node.destroy_node()


def test_a_name_that_no_parameter_has_is_told(bench, capfd):
    """It may be another node's that shares the file."""
    bench.add(SafetySupervisorNode, call_timeout=1.0, nonsense=1)
    told = capfd.readouterr().err
    text = "has no parameter call_timeout, its value is not used: did you mean kill_timeout?"
    assert text in told
    assert "has no parameter nonsense, its value is not used" in told


@pytest.mark.parametrize(
    ("name", "value", "meant"),
    [
        ("requird_links", ["mavlink_parachute"], "required_links"),
        ("profil", "by_hand", "profile"),
        ("mod", "SHADOW", "mode"),
    ],
)
def test_a_name_that_is_misspelt_stops_the_start(bench, name, value, meant):
    """Its owner relies on it: without it the supervisor would decide by the default."""
    said = f"/safety_supervisor has no parameter {name}: did you mean {meant}\\?"
    with pytest.raises(ParameterError, match=said):
        bench.add(SafetySupervisorNode, **{name: value})


def test_no_parameter_of_another_node_passes_for_a_misspelt_one():
    """A file may set up all nodes at once."""
    names = {node: {one.name for one in all_of_it} for node, all_of_it in NODE_PARAMETERS.items()}
    for node, own in names.items():
        others = set().union(*names.values()) - own
        assert not [name for name in others if nearest(name, own, MISSPELT)], node


def test_names_that_ros_itself_gives_meaning_are_not_told(bench, capfd):
    bench.add(SafetySupervisorNode, use_sim_time=False)
    assert "has no parameter" not in capfd.readouterr().err


# While running


def test_what_is_read_only_stays_as_it_is(bench):
    for node in (Network(bench).node, bench.add(SafetySupervisorNode)):
        fixed = set(own_parameters(node)) - {"autopilot_message_rate"}
        assert fixed
        for name in fixed:
            before = node.get_parameter(name)
            (result,) = node.set_parameters([Parameter(name, value=before.value)])
            assert not result.successful, name
            assert "read-only" in result.reason
            assert node.get_parameter(name).value == before.value


def test_a_new_message_rate_reaches_the_autopilot(bench):
    network = Network(bench, autopilot_message_rate=0.0)
    autopilot = Autopilot()
    network.plug(autopilot)

    def asked(interval_us):
        commands = autopilot.heard_command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL)
        return {c[2][0] for c in commands if c[2][1] == interval_us}

    bench.until(network.node.loop.link.autopilots.all, "the autopilot is heard")
    assert autopilot.commands_heard == [], "it was told not to ask"
    (result,) = network.node.set_parameters([Parameter("autopilot_message_rate", value=20.0)])
    assert result.successful
    bench.until(lambda: len(asked(50_000.0)) >= 4, "it asks for them at the new rate")
    (result,) = network.node.set_parameters([Parameter("autopilot_message_rate", value=500.0)])
    assert not result.successful
    assert network.node.get_parameter("autopilot_message_rate").value == 20.0


CTRL_C_IN_THE_MIDDLE = """
import os, signal
from chute_ros.ros.entry import run
from chute_ros.links.mavlink.node import MavlinkParachuteNode

begin = MavlinkParachuteNode.begin

def interrupted(self):
    begin(self)
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000):  # where Python would look at the signal
        pass

MavlinkParachuteNode.begin = interrupted
run("mavlink_parachute", "chute_ros.links.mavlink.node:MavlinkParachuteNode")
"""


def test_ctrl_c_as_the_link_has_just_begun_ends_the_node(namespace):
    ros = ["--ros-args", "-r", f"__ns:={namespace}", "-p", "connection:=udpin:127.0.0.1:0"]
    done = subprocess.run(
        [sys.executable, "-c", CTRL_C_IN_THE_MIDDLE, *ros],
        capture_output=True,
        text=True,
        timeout=30.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


HANGS_AT_ITS_END = """
import ctypes
from chute_ros.ros.entry import run
from chute_ros.links.mavlink.node import MavlinkParachuteNode

# As a middleware that never comes to its end: no other thread of Python runs meanwhile.
MavlinkParachuteNode.destroy_node = lambda self: ctypes.PyDLL(None).sleep(1000)
run("mavlink_parachute", "chute_ros.links.mavlink.node:MavlinkParachuteNode")
"""


def test_a_node_whose_middleware_hangs_at_the_end_is_gone_all_the_same(namespace):
    ros = ["--ros-args", "-r", f"__ns:={namespace}", "-p", "connection:=udpin:127.0.0.1:0"]
    node = subprocess.Popen(
        [sys.executable, "-c", HANGS_AT_ITS_END, *ros], stderr=subprocess.PIPE, text=True
    )
    with node:
        try:
            for line in node.stderr:
                if "is open" in line:
                    break
            node.send_signal(signal.SIGINT)
            assert node.wait(60.0) == -signal.SIGALRM
        finally:
            node.kill()


# Arguments that are not for ROS


def test_what_is_not_for_ros_starts_no_supervisor():
    expected = [
        (["--help"], 0, "usage: safety_supervisor --ros-args [-p PARAMETER:=VALUE]"),
        (["--bogus"], 2, "unknown argument --bogus: the settings of a node follow --ros-args"),
        (["-p", "mode:=SHADOW"], 2, "unknown argument -p: the settings of a node"),
        (["--ros-args", "-p", "mode:=SHADOW", "--", "x"], 2, "unknown argument x"),
    ]
    told = starts(SUPERVISOR, *(arguments for arguments, _, _ in expected))
    for (arguments, code, said), (ended, out, err) in zip(expected, told, strict=True):
        assert ended == code, arguments
        assert said in out + err
        assert "decision" not in out + err
