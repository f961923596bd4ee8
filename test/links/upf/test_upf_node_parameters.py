"""Parameters of upf_can: a bad value stops the start, and is named with what is allowed."""

import re
import shutil
from pathlib import Path

import pytest
from rclpy.parameter import Parameter
from upf_bench import OTHER_LAYOUT, Network, quick

from chute_ros.errors import ParameterError
from chute_ros.links.upf.node import UpfCanNode
from chute_ros.links.upf.parameters import PARAMETERS

DSDL = Path(__file__).parents[3] / "msg_defs" / "dsdl" / "flyfire"


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
