"""The black box in its node: what it hears besides, what it says of itself, and being off."""

import pytest
from chute_msgs.msg import PersonRequest, SupervisorRecord, TriggerStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from chute_ros.ros import black_box
from chute_ros.ros.black_box_parameters import BlackBoxSettings
from chute_ros.ros.flight_recorder import FlightRecorder
from chute_ros.ros.parameters import declare
from chute_ros.settings import parameters_of
from chute_ros.tools.mcap_entries import McapEntries


class Recording(Node):
    """A node with a black box and nothing else."""

    def __init__(self, **options):
        super().__init__("safety_supervisor", **options)
        self.recorder = FlightRecorder(self, declare(self, parameters_of(BlackBoxSettings)))

    def destroy_node(self):
        self.recorder.close()
        super().destroy_node()


@pytest.fixture
def node(bench):
    return bench.add(Recording, black_box_folder=str(bench.folder / "box"))


def heard(bench):
    (file,) = (bench.folder / "box").glob("*.mcap")
    return [entry.channel.topic for entry in McapEntries(file)]


def test_it_hears_what_others_say_and_keeps_it_under_its_whole_name(bench, node):
    bench.publish(TriggerStatus(link="upf_can"), "upf/trigger_status")
    bench.publish(PersonRequest(link="upf_can", service="~/deploy"), "safety/person")
    bench.publish(DiagnosticArray(), "diagnostics")
    bench.until(lambda: node.recorder.box.counts()["entries written"] >= 3, "all are written")
    node.recorder.close()
    names = ("upf/trigger_status", "safety/person", "diagnostics")
    expected = {f"{bench.namespace}/{name}" for name in names}
    assert expected <= set(heard(bench))


def test_it_does_not_listen_to_other_vehicles(bench, node):
    names = [one.topic_name for one in node.subscriptions]
    assert f"{bench.namespace}/diagnostics" in names
    assert "/diagnostics" not in names


def test_its_files_are_named_after_the_vehicle(bench, node):
    node.recorder.message("safety/record", SupervisorRecord())
    node.recorder.close()
    (file,) = (bench.folder / "box").glob("*.mcap")
    vehicle = bench.namespace.strip("/").replace("/", ".")
    assert file.name.startswith(f"{vehicle}.safety_supervisor_000001_")


def test_it_says_that_it_records(bench, node):
    (task,) = node.recorder.tasks()
    assert task.name == f"{node.get_fully_qualified_name().lstrip('/')}: black box"
    assert (task.level, task.message) == (DiagnosticStatus.OK, "recording")
    assert {"file", "entries written", "newest failure"} <= {one.key for one in task.values}


def test_what_is_missing_stays_a_warning(bench, node):
    node.recorder.message("no/topic", SupervisorRecord())
    bench.until(lambda: node.recorder.box.dropped, "it is counted")
    (task,) = node.recorder.tasks()
    assert (task.level, task.message) == (
        DiagnosticStatus.WARN,
        "recording, 1 entries are missing",
    )


def test_a_trouble_is_an_error_and_its_end_is_told(bench, monkeypatch):
    monkeypatch.setattr(black_box, "RETRY_INTERVAL", 0.05)
    taken = bench.folder / "taken"
    taken.touch()
    node = bench.add(Recording, black_box_folder=str(taken))
    lines = []
    logger = node.get_logger()
    monkeypatch.setattr(node, "get_logger", lambda: logger)
    monkeypatch.setattr(logger, "error", lines.append)
    monkeypatch.setattr(logger, "warning", lines.append)
    node.recorder.message("safety/record", SupervisorRecord())
    bench.until(lambda: node.recorder.tasks()[0].level == DiagnosticStatus.ERROR, "it is told")
    taken.unlink()
    bench.until(lambda: node.recorder.tasks()[0].level == DiagnosticStatus.OK, "it is mended")
    assert len(lines) == 2, "each once"
    assert "cannot write" in lines[0]
    assert "writes again" in lines[1]


def test_without_it_nothing_is_written_and_nothing_is_said(bench):
    folder = bench.folder / "box"
    node = bench.add(Recording, black_box=False, black_box_folder=str(folder))
    node.recorder.message("safety/record", SupervisorRecord())
    node.recorder.turn(0.0, (), (), None, None, None)
    assert node.recorder.tasks() == []
    node.recorder.close()
    assert not folder.exists()


def test_its_folder_is_under_ros_home_by_default(bench, monkeypatch):
    monkeypatch.setenv("ROS_HOME", str(bench.folder))
    node = bench.add(Recording)
    node.recorder.message("safety/record", SupervisorRecord())
    node.recorder.close()
    assert len(list((bench.folder / "chute_ros" / "black_box").glob("*.mcap"))) == 1
