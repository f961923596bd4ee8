"""A FIFO, a device, a folder or an endless file in place of a file that a node reads: it never
hangs a start, and the error names the parameter and the path."""

import os
import threading
from types import SimpleNamespace

import pytest

from chute_ros.errors import ChuteError
from chute_ros.links.mavlink.signing_memory import SigningMemory
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.upf.allocation_file import AllocationFile
from chute_ros.ros.profile_files import load_profile
from chute_ros.ros.supervisor_memory import SupervisorMemory
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.transport import regular_file
from chute_ros.transport.data_types import load_data_types
from chute_ros.transport.signing_key import signing_from_file

KINDS = {
    "fifo": lambda path: os.mkfifo(path, 0o600),
    "device": lambda path: path.symlink_to("/dev/zero"),
    "full device": lambda path: path.symlink_to("/dev/full"),
    "folder": lambda path: path.mkdir(),
}
hostile = pytest.mark.parametrize("kind", KINDS)


def put(kind, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    KINDS[kind](path)
    return path


def ends(work):
    """What work returned or raised; it must not hang."""
    came = []

    def run():
        try:
            came.append(work())
        except (ChuteError, OSError) as error:
            came.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(20.0)
    assert came, "it hangs"
    return came[0]


def refused(work, *parts):
    error = ends(work)
    assert isinstance(error, ChuteError), repr(error)
    for part in parts:
        assert part in str(error)
    assert "no regular file" in str(error)


@hostile
def test_a_profile(tmp_path, kind):
    path = put(kind, tmp_path / "mine.yaml")
    refused(lambda: load_profile(str(path), ["mavlink_parachute"]), "parameter profile", str(path))


@hostile
def test_a_layout_of_telemetry(tmp_path, kind):
    path = put(kind, tmp_path / "mine.yaml")
    named = "parameter telem_path"
    refused(lambda: load_layouts(str(tmp_path), named), named, str(path))


@pytest.mark.parametrize("kind", ["fifo", "device", "full device"])
def test_data_types(tmp_path, kind):
    path = put(kind, tmp_path / "flyfire" / "161.Mine.3.0.uavcan")
    named = "parameter dsdl_path"
    refused(lambda: load_data_types(str(path.parent), named), named, str(path))


@hostile
def test_a_signing_key(tmp_path, kind):
    path = put(kind, tmp_path / "key")
    named = "parameter signing_key_file"
    refused(lambda: signing_from_file(str(path), 0, named), named, str(path))


@hostile
def test_a_table_of_node_ids(tmp_path, kind):
    path = put(kind, tmp_path / "ids.json")
    refused(AllocationFile(str(path), "test").load, "allocation_table_file", str(path))


class Node:
    """As much of a node as what keeps files wants; its log."""

    def __init__(self):
        self.said = []

    def get_logger(self):
        return SimpleNamespace(warning=self.said.append)

    def get_fully_qualified_name(self):
        return "/a/node"

    @property
    def context(self):
        return SimpleNamespace(get_domain_id=lambda: 7)


@pytest.fixture
def node(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    return Node()


@hostile
def test_the_times_of_signing_begin_anew_and_are_kept_in_its_place(tmp_path, node, kind):
    path = put(kind, tmp_path / "chute_ros" / "signing" / "a.node.json")
    key = tmp_path / "key"
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    values = {"signing_key_file": str(key), "signing_link_id": 0}
    memory = ends(lambda: SigningMemory(node, values))
    assert isinstance(memory, SigningMemory)
    (said,) = node.said
    assert str(path) in said
    assert "no regular file" in said


@hostile
def test_the_memory_of_a_supervisor_starts_fresh(tmp_path, node, kind):
    path = put(kind, tmp_path / "chute_ros" / "resume" / "a.node@7.json")
    memory = SupervisorMemory(node, {"resume_within": 30.0}, SupervisorConfig())
    try:
        assert ends(memory.recall) is None
        (said,) = node.said
        assert str(path) in said
        assert "no regular file" in said
    finally:
        memory.close()


def test_a_file_without_an_end_is_read_up_to_a_limit(tmp_path):
    path = tmp_path / "sparse"
    with open(path, "wb") as file:
        file.truncate(2**40)
    error = ends(lambda: regular_file.read_regular(path))
    assert isinstance(error, regular_file.TooLongError)


def test_a_link_to_a_regular_file_is_read(tmp_path):
    (tmp_path / "true").write_text("text")
    (tmp_path / "link").symlink_to(tmp_path / "true")
    assert regular_file.read_regular_text(tmp_path / "link") == "text"
