"""What the nodes keep is for their owner alone; what others may have written does not count."""

from __future__ import annotations

import datetime
import os
import stat
from types import SimpleNamespace

import pytest
from chute_msgs.msg import SafetyState
from mavlink_attack import KEY
from supervisor_bench import Scene

from chute_ros.errors import ParameterError, SigningKeyError
from chute_ros.links.umbilical.dump_files import DumpFiles
from chute_ros.links.upf.allocation_file import AllocationFile
from chute_ros.ros import qos
from chute_ros.ros.box_folder import BoxFolder
from chute_ros.ros.kept_file import KeptFile
from chute_ros.ros.mcap_file import McapFile, Topic
from chute_ros.ros.private_files import make_folder, open_new, read_own_text, replace_text
from chute_ros.transport.signing_key import signing_from_file


@pytest.fixture(params=[0o000, 0o022, 0o077], ids=oct)
def umask(request):
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


def black_box(folder):
    topic = Topic("/safety/state", SafetyState, qos.LATCHED)
    file = McapFile(BoxFolder(str(folder), "/safety_supervisor", 4).next_path(0), {"state": topic})
    file.finish()


def dump(folder):
    files = DumpFiles(str(folder))
    files.start("flash", ".csv", "", datetime.datetime(2026, 1, 1))
    files.write(b"1,2,3")
    assert files.finish(True).failure == ""


def dump_that_is_cut_short(folder):
    files = DumpFiles(str(folder))
    files.start("flash", ".csv", str(folder / "named.csv"), datetime.datetime(2026, 1, 1))
    files.write(b"1,2,3")
    files.finish(False)


def allocation_table(folder):
    AllocationFile(str(folder / "node_ids.json"), "/upf_can").save({bytes(range(16)): 125})


def kept(folder):
    """As the resume file of the supervisor and the times of signing."""
    file = KeptFile(folder / "kept.json", str, "test")
    file.keep("something")
    file.close()
    assert file.trouble == ""


WRITERS = [black_box, dump, dump_that_is_cut_short, allocation_table, kept]


@pytest.mark.parametrize("write", WRITERS)
def test_every_file_is_for_its_owner_alone_whatever_the_umask(write, umask, tmp_path):
    top = tmp_path / "home"
    write(top / "deep" / "folder")
    found = list(top.rglob("*"))
    files = [one for one in found if one.is_file()]
    assert len(files) == 1
    assert [oct(stat.S_IMODE(one.stat().st_mode)) for one in files] == ["0o600"]
    folders = [top, *(one for one in found if one.is_dir())]
    assert len(folders) == 3
    assert {oct(stat.S_IMODE(one.stat().st_mode)) for one in folders} == {"0o700"}


def test_a_folder_that_is_there_is_left_as_its_owner_wants_it(tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o755)
    make_folder(shared / "ours")
    assert stat.S_IMODE(shared.stat().st_mode) == 0o755
    assert stat.S_IMODE((shared / "ours").stat().st_mode) == 0o700


def test_a_link_that_somebody_laid_in_the_way_is_not_followed(tmp_path):
    theirs = tmp_path / "theirs"
    theirs.write_text("untouched")
    wanted = tmp_path / "table.json"
    (tmp_path / f"table.json.{os.getpid()}.new").symlink_to(theirs)
    replace_text(wanted, "ours")
    assert wanted.read_text() == "ours"
    assert not wanted.is_symlink()
    (tmp_path / "new").symlink_to(theirs)
    with pytest.raises(FileExistsError):
        open_new(tmp_path / "new")
    assert theirs.read_text() == "untouched"


# What others may have written


@pytest.fixture
def of_another_user(monkeypatch):
    """Every file belongs to somebody else."""
    real = os.fstat

    def fstat(descriptor):
        return SimpleNamespace(st_uid=os.geteuid() + 1, st_mode=real(descriptor).st_mode)

    monkeypatch.setattr(os, "fstat", fstat)


def test_a_file_of_another_user_is_not_believed(of_another_user, tmp_path):
    (tmp_path / "file").write_text("{}")
    with pytest.raises(PermissionError, match="file belongs to another user: chown it"):
        read_own_text(tmp_path / "file")


def test_a_key_of_another_user_is_refused(of_another_user, tmp_path):
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    with pytest.raises(SigningKeyError, match=r"parameter x: .*key belongs to another user"):
        signing_from_file(str(path), 0, "parameter x")


def test_an_allocation_table_that_everybody_may_write_stops_the_start(tmp_path):
    one = AllocationFile(str(tmp_path / "table.json"), "/upf_can")
    one.save({bytes(range(16)): 125})
    one.path.chmod(0o666)
    with pytest.raises(ParameterError, match=r"by everybody: chmod 600 .*table\.json"):
        one.load()
    one.path.chmod(0o600)
    assert one.load() == {bytes(range(16)): 125}


def test_an_allocation_table_that_was_altered_stops_the_start(tmp_path):
    one = AllocationFile(str(tmp_path / "table.json"), "/upf_can")
    one.save({bytes(range(16)): 125})
    one.path.write_text(one.path.read_text().replace("125", "0"))
    with pytest.raises(ParameterError, match="is no allocation"):
        one.load()


def test_a_supervisor_does_not_go_on_with_what_everybody_may_write(bench, monkeypatch, capfd):
    monkeypatch.setenv("ROS_HOME", str(bench.folder))
    scene = Scene(bench, profile="by_hand", black_box=False)
    scene.await_stage(SafetyState.READY)
    scene.link.flying = True
    scene.await_stage(SafetyState.IN_FLIGHT)
    folder = bench.folder / "chute_ros" / "resume"
    (path,) = bench.until(lambda: list(folder.glob("*.json")), "its state is kept")
    bench.remove(scene.supervisor)
    path.chmod(0o666)
    scene.link.flying = False
    scene.states.clear()
    again = Scene(bench, profile="by_hand", black_box=False)
    assert again.supervisor.runtime.state.stage.name == "STARTUP"
    assert f"{path} may be written by everybody: chmod 600 {path}" in capfd.readouterr().err
