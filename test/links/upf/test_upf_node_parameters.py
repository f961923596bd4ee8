"""Parameters of upf_can: a bad value stops the start, and is named with what is allowed."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from rclpy.parameter import Parameter
from upf_bench import OTHER_LAYOUT, Network, quick

from chute_ros.errors import ParameterError
from chute_ros.links.upf.node import UpfCanNode
from chute_ros.links.upf.parameters import PARAMETERS

NAN, INF = float("nan"), float("inf")
DSDL = Path(__file__).parents[3] / "msg_defs" / "dsdl" / "flyfire"
RANGED = [one for one in PARAMETERS if one.minimum is not None]
OTHERS = [one for one in PARAMETERS if one.minimum is None]


def start(bench, **parameters):
    return bench.add(UpfCanNode, **(quick() | parameters))


def refusal(bench, **parameters):
    """What a start with these parameters ends in."""
    with pytest.raises(ParameterError) as caught:
        start(bench, **parameters)
    text = str(caught.value)
    assert "\n" not in text
    return text


# Each by itself


def test_each_has_the_default_that_its_table_says(bench, monkeypatch, tmp_path):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    node = bench.add(UpfCanNode, connection=quick()["connection"])
    for one in PARAMETERS:
        if one.name != "connection":
            assert node.get_parameter(one.name).value == one.default, one.name
            assert node.values[one.name] == one.default
        described = node.describe_parameter(one.name)
        assert described.description == one.meaning
        assert described.additional_constraints == one.allowed()
        assert described.read_only != one.changeable


def outside(one):
    """Values just beyond the range, and what is no number of its kind."""
    if isinstance(one.default, int):
        return [int(one.minimum) - 1, int(one.maximum) + 1, 1.5, "1", True]
    return [one.minimum - 1e-3, one.maximum * 1.001, NAN, INF, -INF, 1, "1.0", False]


def refused_with_what_is_allowed(bench, one, value):
    text = refusal(bench, **{one.name: value})
    assert f"parameter {one.name} of " in text
    assert f" is {value!r}: need {one.allowed()}" in text


@pytest.mark.parametrize("one", RANGED, ids=lambda one: one.name)
def test_a_value_outside_the_range_is_named_with_the_range_whose_ends_are_taken(bench, one):
    for value in outside(one):
        refused_with_what_is_allowed(bench, one, value)
    kind = type(one.default)
    ends = {kind(one.minimum), kind(one.maximum)}
    others = {}
    if one.name == "device_stale_after":
        ends, others = ends - {600.0}, {"device_lost_after": 600.0}
    if one.name == "device_lost_after":
        ends, others = ends - {0.05}, {"device_stale_after": 0.05}
    for value in ends:
        node = start(bench, **others, **{one.name: value})
        assert node.values[one.name] == value
        bench.remove(node)


@pytest.mark.parametrize("one", OTHERS, ids=lambda one: one.name)
def test_a_value_of_another_kind_is_named_with_what_is_needed(bench, one):
    wrong = ["yes", 1, 1.0] if isinstance(one.default, bool) else [1, 1.0, True, ["x"]]
    if one.takes_switch:
        wrong = [value for value in wrong if value is not True]
    wrong += ["Forward", "", "forward "] if one.choices else []
    for value in wrong:
        refused_with_what_is_allowed(bench, one, value)


def test_a_bus_that_is_none_is_named_with_the_forms(bench):
    forms = "need mcast:BUS[:PORT]"
    for connection, need in {
        **dict.fromkeys(("", "mcast", "mcast:", "can0"), forms),
        "mcast:256": "bus '256' is no number from 0 to 255",
        "mcast:-1": "bus '-1' is no number from 0 to 255",
        "mcast:0:65536": "port '65536' is no number from 0 to 65535",
        "mcast:0:x": "port 'x' is no number",
        "nocan:can0": "'nocan' is no interface: need mcast or one of",
        "udp_multicast:127.0.0.1": "'127.0.0.1' is no multicast address",
    }.items():
        text = refusal(bench, connection=connection)
        assert f"connection {connection!r}" in text
        assert need in text


def test_none_of_them_changes_while_running(bench):
    node = Network(bench).node
    for one in PARAMETERS:
        (result,) = node.set_parameters([Parameter(one.name, value=node.values[one.name])])
        assert not result.successful, one.name
        assert "read-only" in result.reason


# Two that contradict each other


def test_a_device_is_stale_before_it_is_lost(bench):
    for stale, lost in ((3.0, 3.0), (4.0, 3.0)):
        text = refusal(bench, device_stale_after=stale, device_lost_after=lost)
        assert f"device_stale_after is {stale}" in text
        assert f"device_lost_after is {lost}" in text


def test_a_node_id_belongs_to_one_node_but_controller_and_trigger_may_be_one(bench):
    for name in ("controller_node_id", "trigger_node_id"):
        text = refusal(bench, **{"node_id": 33, name: 33})
        assert f"{name} is 33 and node_id is 33: a node id belongs to one node" in text
        assert "choose another node_id" in text
    node = start(bench, controller_node_id=40, trigger_node_id=40)
    assert node.values["trigger_node_id"] == 40


# dsdl_path


def copied(tmp_path, name="flyfire", source=DSDL):
    """A folder with data types to spoil."""
    folder = tmp_path / name
    shutil.copytree(source, folder)
    return folder


@pytest.mark.parametrize("source", [DSDL, OTHER_LAYOUT], ids=["ours", "another layout"])
def test_a_folder_of_the_vendors_own_is_taken(bench, tmp_path, source):
    folder = copied(tmp_path, source=source)
    assert start(bench, dsdl_path=str(folder)).loop is not None
    assert start(bench, dsdl_path=str(tmp_path)).loop is not None, "the one that holds it, too"


def test_a_folder_that_is_none_of_types_is_refused(bench, tmp_path):
    text = refusal(bench, dsdl_path=str(tmp_path / "flyfire"))
    assert f"parameter dsdl_path is '{tmp_path}/flyfire': there is no such folder" in text
    folder = copied(tmp_path, "firefly")
    text = refusal(bench, dsdl_path=str(folder))
    assert f"parameter dsdl_path is '{folder}'" in text
    assert "must be flyfire" in text
    (tmp_path / "flyfire").mkdir()
    text = refusal(bench, dsdl_path=str(tmp_path / "flyfire"))
    for name in ("ParachuteService", "ParachuteStatus", "VehicleService", "TriggerLaunch"):
        assert f"flyfire.{name}" in text


def test_types_that_are_no_dsdl_are_refused_with_the_file(bench, tmp_path):
    folder = copied(tmp_path)
    (folder / "1666.TriggerStatus.3.0.uavcan").write_text("this is no type\n")
    text = refusal(bench, dsdl_path=str(folder))
    assert f"parameter dsdl_path is '{folder}'" in text
    assert "1666.TriggerStatus" in text


@pytest.mark.parametrize(
    ("file", "lines", "lacking"),
    [
        ("163.ParachuteService", ["TYPE_DEPLOY_FORCE"], ["constant TYPE_DEPLOY_FORCE"]),
        ("163.ParachuteService", ["uint8 type "], ["field type"]),
        ("163.ParachuteService", ["MAGIC_NUMBER"], ["constant MAGIC_NUMBER"]),
        (
            "164.VehicleService",
            ["TYPE_KILLSWITCH", "TYPE_FLIGHT_BLOCK_RELEASE", "RESULT_SUCCESS"],
            [
                "(request) constant TYPE_KILLSWITCH",
                "(request) constant TYPE_FLIGHT_BLOCK_RELEASE",
                "(response) constant RESULT_SUCCESS",
            ],
        ),
        ("1663.ParachuteStatus", ["STATE_LAUNCHED"], ["constant STATE_LAUNCHED"]),
        ("165.TriggerService", ["TYPE_LAUNCH"], ["constant TYPE_LAUNCH"]),
    ],
)
def test_types_that_lack_what_fires_are_refused_with_the_list(
    bench, tmp_path, file, lines, lacking
):
    folder = copied(tmp_path)
    path = folder / f"{file}.3.0.uavcan"
    kept = [
        line
        for line in path.read_text().splitlines()
        if not any(re.search(rf"{word}\b" if word.isupper() else word, line) for word in lines)
    ]
    path.write_text("\n".join(kept) + "\n")
    text = refusal(bench, dsdl_path=str(folder))
    assert "the flyfire data types lack names needed to fire or to answer" in text
    assert f"flyfire.{file.partition('.')[2]}" in text
    for one in lacking:
        assert one in text


# A process of its own


COMMAND = [sys.executable, "-m", "chute_ros.links.upf", "--ros-args"]


def run(namespace, tmp_path, *parameters):
    """A real process: its exit code and stderr."""
    words = [word for parameter in parameters for word in ("-p", parameter)]
    done = subprocess.run(
        [*COMMAND, "-r", f"__ns:={namespace}", *words],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
        env={**os.environ, "ROS_HOME": str(tmp_path)},
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["node_id:=0"], "parameter node_id of {ns}/upf_can is 0: need a whole number from 1 to"),
        (["connection:=can"], "connection 'can' is not understood: need mcast:BUS[:PORT]"),
        (["dsdl_path:=/none"], "parameter dsdl_path is '/none': there is no such folder"),
        (
            ["node_id:=33", "controller_node_id:=33"],
            "parameter controller_node_id is 33 and node_id is 33: ",
        ),
        (["allocation_table_file:={tmp}/bad"], "{tmp}/bad cannot be used: it holds no table"),
    ],
)
def test_a_real_start_ends_in_one_line(namespace, tmp_path, given, said):
    (tmp_path / "bad").write_text("[7]")
    names = {"ns": namespace, "tmp": tmp_path}
    code, text = run(namespace, tmp_path, *(one.format(**names) for one in given))
    assert code == 2
    (line,) = text.splitlines()
    assert line.startswith("upf_can: ")
    assert said.format(**names) in line
