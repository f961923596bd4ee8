"""Node ids that upf_can gives out: kept on the disk before they leave, and the same ever after."""

import threading

import pytest
from chute_msgs.msg import LinkHeartbeat, ParachuteStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from upf_bench import PATIENT, Network, tasks, values

from chute_ros.errors import ParameterError
from chute_ros.links.upf.allocation_file import AllocationFile
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import NODE_ID
from chute_ros.protocol.dronecan.allocation import MESSAGE

DYNAMIC = {p.STATIC_NODE_ID: 0}


def network_of(bench, path, allocator="auto", **parameters):
    file = str(path)
    return Network(bench, allocator=allocator, allocation_table_file=file, **PATIENT, **parameters)


def await_ids(bench, *nodes):
    """Their node ids, once each has one."""
    bench.until(lambda: all(node.node_id for node in nodes), "each is given a node id")
    return [node.node_id for node in nodes]


def table(path):
    return AllocationFile(str(path), "test").load()


def test_devices_without_node_ids_are_given_some_and_work(bench, tmp_path):
    path = tmp_path / "folder" / "ids.json"
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    network = network_of(bench, path)
    controller, trigger = network.controller(**DYNAMIC), network.trigger(**DYNAMIC)
    network.plug(controller, trigger)
    ids = await_ids(bench, controller, trigger)
    assert len(set(ids)) == 2
    assert not {NODE_ID, 33, 34, 0, 126, 127} & set(ids), "ours, and those of static devices"
    assert table(path) == {
        controller.settings.unique_id: ids[0],
        trigger.settings.unique_id: ids[1],
    }
    bench.until(lambda: statuses and statuses[-1].device == str(ids[0]), "it is followed")
    bench.until(lambda: beats[-1].device_healthy, "all is well")

    def task():
        return tasks(diagnostics).get("node ids")

    bench.until(lambda: task() and task().message == "2 node ids given out", "they are told")
    assert task().level == DiagnosticStatus.OK
    assert values(task())["file"] == str(path)
    assert values(task())[f"node {ids[0]}"] == controller.settings.unique_id.hex()


def test_a_slow_disk_is_not_in_the_way_of_heartbeats(bench, tmp_path, monkeypatch):
    beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
    saved, may_go_on = AllocationFile.save, threading.Event()

    def slow(file, entries):
        assert may_go_on.wait(20.0)
        saved(file, entries)

    monkeypatch.setattr(AllocationFile, "save", slow)
    network = network_of(bench, tmp_path / "ids.json")
    controller, trigger = network.controller(**DYNAMIC), network.trigger(**DYNAMIC)
    network.plug(controller, trigger)
    bench.until(lambda: network.node.loop.link.bus.allocator.table, "an id is to be kept")
    count = len(beats)
    bench.until(lambda: len(beats) > count + 5, "it beats meanwhile")
    assert (controller.node_id, trigger.node_id) == (0, 0), "none is given out before"
    may_go_on.set()
    await_ids(bench, controller, trigger)


def test_after_a_restart_of_the_node_each_device_has_the_same_id_again(bench, tmp_path):
    path = tmp_path / "ids.json"
    network = network_of(bench, path)
    controller, trigger = network.controller(**DYNAMIC), network.trigger(**DYNAMIC)
    loop = network.plug(controller, trigger)
    ids = await_ids(bench, controller, trigger)
    kept = path.read_text()
    bench.unplug(loop)
    network.restart()
    again = network.trigger(**DYNAMIC), network.controller(**DYNAMIC)
    network.plug(*again)
    assert await_ids(bench, *again) == ids[::-1], "whoever asks first"
    assert path.read_text() == kept


def test_without_a_place_for_the_table_nothing_is_given_out_until_there_is_one(bench, tmp_path):
    said = bench.follow_log()
    folder, target = tmp_path / "folder", tmp_path / "target"
    folder.symlink_to(target)
    network = network_of(bench, folder / "ids.json")
    trigger = network.trigger(**DYNAMIC)
    party = network.party()
    network.plug(trigger)
    refusal = "the table of node ids cannot be saved, no id is given out"
    bench.until(lambda: any(refusal in one.msg for one in said), "it is told")
    assert trigger.node_id == 0
    whole = [one for one in party.values(MESSAGE) if len(one["unique_id"]) == 16]
    assert whole == [], "no answer left that names a node id"
    target.mkdir()
    (node_id,) = await_ids(bench, trigger)
    assert table(target / "ids.json") == {trigger.settings.unique_id: node_id}


def test_a_table_that_cannot_be_believed_ends_the_start_unless_no_ids_are_given_out(
    bench, tmp_path
):
    path = tmp_path / "ids.json"
    path.write_text("{")
    with pytest.raises(ParameterError, match="allocation_table_file") as caught:
        network_of(bench, path)
    assert "\n" not in str(caught.value)
    Network(bench, allocator=False, allocation_table_file=str(path))
    assert path.read_text() == "{"


def test_where_the_allocator_is_off_nobody_is_given_an_id(bench, tmp_path):
    path = tmp_path / "ids.json"
    network = Network(bench, allocator=False, allocation_table_file=str(path))
    trigger = network.trigger(**DYNAMIC)
    party = network.party()
    network.plug(trigger)
    bench.until(lambda: len(party.values(MESSAGE)) >= 3, "it asks, and asks again")
    assert {one.source for one in party.heard if one.name == MESSAGE} == {0}
    assert trigger.node_id == 0
    assert not path.exists()


def test_the_allocator_may_be_switched_on_as_yaml_reads_it(bench, tmp_path):
    network = network_of(bench, tmp_path / "ids.json", allocator=True)
    assert network.node.values["allocator"] == "true"
