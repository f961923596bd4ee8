"""The table of node ids on the disk: whatever happens to it, it is whole or the start ends."""

import contextlib
import errno
import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import ParameterError
from chute_ros.links.upf.allocation_file import AllocationFile

FIRST, SECOND = bytes(range(16)), bytes(range(16, 32))
#: Where writing can be cut short: each is a function that a save calls, in this order.
STEPS = ("open", "write", "fsync", "rename")

tables = st.dictionaries(
    st.binary(min_size=16, max_size=16), st.integers(1, 125), max_size=8
).filter(lambda table: len(set(table.values())) == len(table))


def file_at(path):
    return AllocationFile(str(path), "/drone/upf_can")


def save_and_die(path, table):
    """A process that is killed within a save, right before the new table takes its place."""
    script = """
import os, signal, sys
from pathlib import Path
from chute_ros.links.upf.allocation_file import AllocationFile
path, unique_id, node_id = sys.argv[1:]
Path.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
AllocationFile(path, "/upf_can").save({bytes.fromhex(unique_id): int(node_id)})
"""
    ((unique_id, node_id),) = table.items()
    command = [sys.executable, "-c", script, str(path), unique_id.hex(), str(node_id)]
    done = subprocess.run(command, capture_output=True, timeout=60.0, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr


def test_what_was_saved_is_loaded(tmp_path):
    one = file_at(tmp_path / "deep" / "in" / "table.json")
    assert one.load() == {}
    for table in ({FIRST: 125}, {FIRST: 125, SECOND: 124}, {}):
        one.save(table)
        assert one.load() == table
        assert os.listdir(one.path.parent) == ["table.json"], "nothing else is left"


def test_the_file_is_for_its_owner_alone(tmp_path):
    one = file_at(tmp_path / "table.json")
    before = os.umask(0)
    try:
        one.save({FIRST: 125})
        assert stat.S_IMODE(one.path.stat().st_mode) == 0o600
        one.path.chmod(0o644)
        one.save({FIRST: 125, SECOND: 124})
        assert stat.S_IMODE(one.path.stat().st_mode) == 0o600
    finally:
        os.umask(before)


def test_it_is_text_that_a_person_can_repair(tmp_path):
    one = file_at(tmp_path / "table.json")
    one.save({FIRST: 125})
    assert json.loads(one.path.read_text()) == {FIRST.hex(): 125}
    assert one.path.read_text().endswith("\n")


def test_a_full_disk_is_an_error_and_leaves_the_table_before(tmp_path):
    one = file_at(tmp_path / "table.json")
    one.save({FIRST: 125})
    # No file of this process may hold a byte.
    script = """
import resource, sys
from chute_ros.links.upf.allocation_file import AllocationFile
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
try:
    AllocationFile(sys.argv[1], "/upf_can").save({bytes(16): 7})
except OSError as error:
    sys.exit(error.errno)
"""
    command = [sys.executable, "-c", script, str(one.path)]
    done = subprocess.run(command, capture_output=True, timeout=60.0, check=False)
    assert done.returncode == errno.EFBIG, done.stderr
    assert one.load() == {FIRST: 125}
    assert os.listdir(tmp_path) == ["table.json"]


def test_a_process_killed_in_the_middle_leaves_the_table_before_and_nothing_for_long(tmp_path):
    one = file_at(tmp_path / "table.json")
    one.save({FIRST: 125})
    for _ in range(2):
        save_and_die(one.path, {SECOND: 124})
    assert one.load() == {FIRST: 125}
    one.save({FIRST: 125, SECOND: 124})
    assert os.listdir(tmp_path) == ["table.json"]


@pytest.mark.parametrize(
    "what_is_there",
    [
        b"",
        b"\xff\xfe\x00",
        b"{",
        b"[]",
        b"null",
        b"7",
        b'"text"',
        b'{"00": 5}',
        b'{"zz": 5}',
        b'{"%s": 0}' % FIRST.hex().encode(),
        b'{"%s": 126}' % FIRST.hex().encode(),
        b'{"%s": -1}' % FIRST.hex().encode(),
        b'{"%s": null}' % FIRST.hex().encode(),
        b'{"%s": [5]}' % FIRST.hex().encode(),
        b'{"%s": "x"}' % FIRST.hex().encode(),
        b'{"%s": 5.7}' % FIRST.hex().encode(),
        b'{"%s": true}' % FIRST.hex().encode(),
        b'{"%s": 1e999}' % FIRST.hex().encode(),
        b'{"%s": 5, "%s": 5}' % (FIRST.hex().encode(), SECOND.hex().encode()),
        b'{"%s": 5, "%s": 6}' % (FIRST.hex().encode(), FIRST.hex().encode()),
        b"[" * 100_000,
    ],
    ids=lambda there: repr(there[:60]),
)
def test_a_table_that_cannot_be_believed_is_refused_in_one_line(tmp_path, what_is_there):
    path = tmp_path / "table.json"
    path.write_bytes(what_is_there)
    with pytest.raises(ParameterError) as caught:
        file_at(path).load()
    text = str(caught.value)
    assert text.startswith(f"parameter allocation_table_file: {path} cannot be used: ")
    assert "repair it, or move it away" in text
    assert "\n" not in text
    assert path.read_bytes() == what_is_there, "it is left as it was"


def test_a_folder_in_its_place_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="Is a directory"):
        file_at(tmp_path).load()


def test_a_save_that_fails_says_so_and_leaves_what_was_there(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "table.json", Path("/proc/none/table.json")):
        with pytest.raises(OSError, match=r"\S"):
            file_at(path).save({FIRST: 125})
    target = tmp_path / "folder"
    target.mkdir()
    with pytest.raises(OSError, match="directory"):
        file_at(target).save({FIRST: 125})
    assert sorted(os.listdir(tmp_path)) == ["file", "folder"], "nothing is left beside it"


def test_without_a_path_each_node_has_a_file_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    paths = [AllocationFile("", name).path for name in ("/upf_can", "/a/upf_can", "/a/b")]
    assert len(set(paths)) == 3
    assert {path.parent for path in paths} == {tmp_path / "chute_ros"}
    monkeypatch.delenv("ROS_HOME")
    assert AllocationFile("", "/upf_can").path.parent == Path.home() / ".ros" / "chute_ros"
    assert AllocationFile("~/table", "/upf_can").path == Path.home() / "table"
    with pytest.raises(ParameterError, match=r"allocation_table_file is .~nobody-such"):
        AllocationFile("~nobody-such/x", "/upf_can")


class Cut(BaseException):
    """The end of the process, as far as a save can see it."""


@given(st.lists(st.tuples(tables, st.sampled_from((*STEPS, ""))), max_size=12))
def test_after_any_saves_and_saves_cut_short_the_table_is_a_whole_one(steps):
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        one = file_at(Path(folder) / "table.json")
        whole = {}
        for table, cut in steps:
            with patch.context() as here, contextlib.suppress(Cut):
                cut_short(here, cut)
                one.save(table)
                whole = table
            assert one.load() == whole


def cut_short(patch, step):
    """Nothing happens from this step of a save on: not even what would clean up."""

    def cut(*arguments, **options):
        raise Cut

    if step == "open":
        patch.setattr(os, "open", cut)
    elif step == "write":
        patch.setattr(os, "fdopen", cut)
    elif step == "fsync":
        patch.setattr(os, "fsync", cut)
    elif step == "rename":
        patch.setattr(Path, "replace", cut)
