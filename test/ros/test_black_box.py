"""The black box keeps everything, and nothing that a disk does reaches the decision loop."""

import errno
import os
import re
import signal
import stat
import subprocess
import sys
import textwrap
import threading
from dataclasses import replace

import pytest
from chute_msgs.msg import LinkHeartbeat, SafetyState

from chute_ros.model import LinkState
from chute_ros.ros import black_box, box_writer, mcap_file
from chute_ros.ros.black_box import BlackBox
from chute_ros.ros.box_folder import BoxFolder
from chute_ros.ros.recorded_topics import recorded_topics
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.state import State
from chute_ros.tools.recording import read
from chute_ros.tools.replaying import Replayer

NAME = "/drone1/safety_supervisor"
KINDS = {"safety/heartbeat": LinkHeartbeat, "safety/state": SafetyState}
WALL = 1_780_000_000 * 10**9


class Vehicle:
    """What a black box asks of its node."""

    def resolve_topic_name(self, name):
        return name if name.startswith("/") else f"/drone1/{name}"


class Recorder:
    """A core that hears a heartbeat in each turn, and its black box."""

    def __init__(self, folder, limit=64_000_000, most_files=32):
        self.folder = folder
        self.wall = WALL
        self.turns = 0
        self.config, self.state = SupervisorConfig(), State(epoch=7, started_at=1000.0)
        self.box = BlackBox(
            BoxFolder(str(folder), NAME, most_files),
            recorded_topics(Vehicle()),
            limit,
            wall=lambda: self.wall,
        )

    def turn(self, count=1):
        for _ in range(count):
            self.turns += 1
            self.wall += 10**8
            now, before = 1000.0 + self.turns * 0.1, self.state
            heard = (i.LinkHeartbeat("mavlink_parachute", LinkState.OK, True, self.turns),)
            self.state, outputs = update(self.config, before, heard, now)
            self.box.turn(now, heard, outputs, before, self.state, self.config)

    def beat(self, count=1, text="mavlink_parachute"):
        for _ in range(count):
            self.box.message("safety/heartbeat", LinkHeartbeat(link=text, seq=self.turns))

    def count(self, name):
        return self.box.counts()[name]

    def files(self):
        return sorted(self.folder.glob("*.mcap"))


@pytest.fixture
def recorder(tmp_path):
    one = Recorder(tmp_path / "box")
    yield one
    one.box.close()


def replayed(files):
    """(turns replayed, turns that could not be); every replayed one decided the same."""
    recording, core = read(files, {}), Replayer()
    for turn in recording.turns:
        outputs = core.step(turn)
        assert outputs in (None, turn.turn.outputs)
    assert core.strayed == []
    return len(recording.turns) - core.skipped, core.skipped


def test_what_it_was_given_is_in_one_file_for_the_owner_alone(recorder):
    recorder.turn(20)
    recorder.beat(5)
    recorder.box.close()
    (file,) = recorder.files()
    assert file.name == "drone1.safety_supervisor_000001_20260528T202640Z.mcap"
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert stat.S_IMODE(recorder.folder.stat().st_mode) == 0o700
    recording = read([file], KINDS)
    assert len(recording.turns) == 20
    assert len(recording.messages["safety/heartbeat"]) == 5
    assert replayed([file]) == (20, 0)
    assert recorder.box.dropped == 0


def test_it_is_on_the_disk_without_an_end(recorder, await_until):
    recorder.turn(10)
    await_until(lambda: recorder.files() and _turns(recorder.files()) == 10, "it is flushed")
    assert recorder.box.trouble == ""
    counts = recorder.box.counts()
    assert counts["file"] == str(recorder.files()[0])
    assert counts["entries written"] == 10
    assert counts["bytes in the file"] == recorder.files()[0].stat().st_size


def test_messages_as_they_came_from_the_wire_are_kept_as_they_are(recorder):
    recorder.turn()
    from rclpy.serialization import serialize_message

    recorder.box.message("safety/state", serialize_message(SafetyState(epoch=9)))
    recorder.box.close()
    ((_, message),) = read(recorder.files(), KINDS).messages["safety/state"]
    assert message.epoch == 9


def test_a_blocked_disk_delays_nobody_and_is_told(tmp_path, monkeypatch, await_until):
    monkeypatch.setattr(black_box, "MOST_WAITING", 40)
    monkeypatch.setattr(black_box, "MOST_MESSAGES", 30)
    monkeypatch.setattr(black_box, "SLOW_AFTER", 0.3)
    blocked, free = threading.Event(), threading.Event()

    def stuck(descriptor):
        blocked.set()
        free.wait()

    monkeypatch.setattr(mcap_file.os, "fsync", stuck)
    recorder = Recorder(tmp_path)
    try:
        recorder.turn()
        assert blocked.wait(20.0)
        recorder.beat(100)
        recorder.turn(100)  # all this returns although nothing can be written
        assert recorder.box.dropped == (101 - 30) + (100 - 10), "turns have the last places"
        assert recorder.count("entries waiting") <= 41
        await_until(lambda: "takes nothing" in recorder.box.trouble, "it is told")
    finally:
        free.set()
    await_until(lambda: recorder.count("entries waiting") == 0, "the disk is back")
    await_until(lambda: recorder.box.trouble == "", "that is told as well")
    recorder.turn(5)
    recorder.box.close()
    done, skipped = replayed(recorder.files())
    assert done == 1 + 10 + 5, "what was left out is bridged by a new snapshot"
    assert skipped == 0


def test_a_writer_that_has_no_time_is_no_disk_that_takes_nothing(
    tmp_path, monkeypatch, await_until
):
    """Given a processor that is busy, when entries come faster than they are written, then it says
    how many wait."""
    monkeypatch.setattr(black_box, "SLOW_AFTER", 0.6)
    write, may_go_on = box_writer.BoxWriter.write, threading.Event()

    def slowly(writer, entry):
        may_go_on.wait(0.02)
        write(writer, entry)

    monkeypatch.setattr(box_writer.BoxWriter, "write", slowly)
    recorder, told = Recorder(tmp_path), []
    try:
        recorder.beat(1000)
        await_until(lambda: told.append(recorder.box.trouble) or told[-1], "it is told")
        assert re.fullmatch(
            r"the black box is written slowly: \d+ entries wait, not all on the disk for \d+ s",
            told[-1],
        )
        assert recorder.count("entries written") > 0
    finally:
        may_go_on.set()
    await_until(lambda: recorder.box.trouble == "", "it has caught up")
    recorder.box.close()
    assert recorder.count("entries written") == 1000


def test_an_end_does_not_wait_for_a_disk_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(black_box, "_CLOSE_WITHIN", 0.1)
    blocked, free = threading.Event(), threading.Event()
    monkeypatch.setattr(mcap_file.os, "fsync", lambda _: (blocked.set(), free.wait()))
    recorder = Recorder(tmp_path)
    recorder.turn()
    assert blocked.wait(20.0)
    try:
        recorder.box.close()
    finally:
        free.set()


class FullDisk:
    """Stands for os.write: takes no more than so many bytes."""

    def __init__(self, monkeypatch):
        self.left = 10**9
        self._write = os.write
        monkeypatch.setattr(mcap_file.os, "write", self.write)

    def write(self, descriptor, data):
        if not self.left:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        part = data[: self.left]
        self.left -= len(part)
        return self._write(descriptor, part)


def test_a_full_disk_is_told_and_a_new_file_follows_once_it_has_room(
    tmp_path, monkeypatch, await_until
):
    # Long enough that the room comes between two tries, not in the middle of one.
    monkeypatch.setattr(black_box, "RETRY_INTERVAL", 0.5)
    disk = FullDisk(monkeypatch)
    recorder = Recorder(tmp_path)
    recorder.turn(10)
    await_until(lambda: recorder.files() and _turns(recorder.files()) == 10, "it writes")
    disk.left = 100
    recorder.turn(10)
    await_until(lambda: "No space left on device" in recorder.box.trouble, "it is told")
    fed = 20

    def tries_again():
        # What comes is what it tries again with, as in flight, where something always comes.
        nonlocal fed
        recorder.turn(1)
        fed += 1
        return "_000002_" in recorder.box.trouble

    await_until(tries_again, "it tries again, and names the file")
    await_until(lambda: len(recorder.files()) == 1, "but leaves no empty files behind")
    disk.left = 10**9
    recorder.turn(10)
    await_until(lambda: recorder.box.trouble == "", "there is room again")
    recorder.box.close()
    assert [file.name.split("_")[2] for file in recorder.files()] == ["000001", "000002"]
    done, skipped = replayed(recorder.files())
    assert (done + recorder.box.dropped, skipped) == (fed + 10, 0)
    assert "No space left" in recorder.count("newest failure")


def test_where_nothing_can_be_written_nothing_old_goes(tmp_path, monkeypatch, await_until):
    monkeypatch.setattr(black_box, "RETRY_INTERVAL", 0.01)
    tried = []
    for number in range(3):
        (tmp_path / f"drone1.safety_supervisor_{number:06d}_20260101T000000Z.mcap").touch()
    before = sorted(tmp_path.iterdir())
    disk = FullDisk(monkeypatch)
    disk.left = 0
    monkeypatch.setattr(
        box_writer, "McapFile", lambda *given: tried.append(given) or mcap_file.McapFile(*given)
    )
    recorder = Recorder(tmp_path, most_files=2)
    recorder.turn()
    await_until(lambda: len(tried) > 5, "it tries again and again")
    recorder.box.close()
    assert [one for one in before if not one.exists()] == []


@pytest.mark.parametrize("what", ["file", "below a file"])
def test_a_folder_that_cannot_be_one_is_told(what, tmp_path, await_until):
    (tmp_path / "taken").touch()
    recorder = Recorder(tmp_path / "taken" if what == "file" else tmp_path / "taken" / "box")
    recorder.turn()
    await_until(lambda: recorder.box.trouble, "it is told")
    assert str(tmp_path) in recorder.box.trouble
    assert recorder.count("entries waiting") == 1, "it is kept for when that is mended"
    recorder.box.close()


def test_files_follow_one_another_and_the_oldest_go(tmp_path, await_until):
    recorder = Recorder(tmp_path, limit=30_000, most_files=3)
    until = 5
    while recorder.box.counts()["file"].find(f"_{until:06d}_") < 0:
        recorder.turn(50)
        recorder.beat(50, os.urandom(300).hex())
        recorder.wall -= 10**12  # a clock that is set back does not confuse their order
        await_until(lambda: recorder.count("entries waiting") == 0, "written")
    recorder.turn(50)
    recorder.box.close()
    numbers = [int(file.name.split("_")[2]) for file in recorder.files()]
    assert numbers == [until - 2, until - 1, until]
    for file in recorder.files():
        assert file.stat().st_size < 120_000
        assert replayed([file])[1] == 0, "each can be replayed alone"
    assert replayed(recorder.files())[1] == 0
    assert read(recorder.files(), {}).turns[0].number > 1


def test_two_recorders_of_one_name_do_not_meet(tmp_path):
    one, other = Recorder(tmp_path), Recorder(tmp_path)
    for recorder in (one, other):
        recorder.turn(3)
    for recorder in (one, other):
        recorder.box.close()
    files = one.files()
    assert len(files) == 2
    assert [replayed([file]) for file in files] == [(3, 0), (3, 0)]


def test_files_of_another_vehicle_are_left_alone(tmp_path):
    theirs = tmp_path / "drone11.safety_supervisor_000001_20260101T000000Z.mcap"
    notes = tmp_path / "drone1.safety_supervisor_notes.txt"
    for path in (theirs, notes):
        path.touch()
    folder = BoxFolder(str(tmp_path), NAME, 2)
    for number in range(5):
        folder.next_path(WALL + number).touch()
    folder.prune()
    kept = sorted(path.name for path in tmp_path.iterdir())
    assert [name.split("_")[2] for name in kept if name.startswith("drone1.")][:2] == [
        "000004",
        "000005",
    ]
    assert theirs.exists()
    assert notes.exists()


def test_an_entry_that_is_no_message_costs_only_itself(recorder):
    recorder.turn()
    recorder.box.message("safety/heartbeat", SafetyState())
    recorder.box.message("no/topic", LinkHeartbeat())
    recorder.box.message("safety/heartbeat", "text")
    recorder.turn()
    recorder.box.close()
    assert recorder.box.dropped == 3
    assert "left out" in recorder.count("newest failure")
    assert replayed(recorder.files()) == (2, 0)


def test_a_state_that_was_changed_between_turns_is_written_again(recorder):
    recorder.turn(3)
    recorder.state = replace(recorder.state, epoch=8)  # as by another supervisor that led
    recorder.turn(3)
    recorder.box.close()
    turns = read(recorder.files(), {}).turns
    states = [one.state.epoch if one.state else None for one in turns]
    assert states == [7, None, None, 8, None, None]
    assert replayed(recorder.files()) == (6, 0)


def test_the_state_is_written_again_now_and_then(recorder):
    recorder.turn(round(box_writer.SNAPSHOT_INTERVAL / 0.1) + 10)
    recorder.box.close()
    turns = read(recorder.files(), {}).turns
    snapshots = [one.number for one in turns if one.state is not None]
    assert len(snapshots) == 2
    assert replayed(recorder.files()) == (len(turns), 0)


CHILD = """
    import sys
    sys.path.insert(0, {here!r})
    import test_black_box as story
    from pathlib import Path
    {before}
    recorder = story.Recorder(Path({folder!r}))
    while True:
        recorder.turn(20)
        recorder.beat(20)
        {after}
"""


def child(folder, before="", after=""):
    text = CHILD.format(
        here=os.path.dirname(__file__), folder=str(folder), before=before, after=after
    )
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(text)], stdout=subprocess.PIPE, text=True
    )


def test_after_a_kill_in_the_middle_the_file_replays_as_far_as_it_goes(tmp_path, await_until):
    process = child(tmp_path, after="story.threading.Event().wait(0.02)")
    try:
        await_until(lambda: _turns(sorted(tmp_path.glob("*.mcap"))) > 100, "some is on the disk")
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    files = sorted(tmp_path.glob("*.mcap"))
    assert read(files, {}).remarks != [], "it has no end"
    done, skipped = replayed(files)
    assert done > 100
    assert skipped == 0


def test_a_limit_of_the_system_is_a_full_disk_too(tmp_path):
    process = child(
        tmp_path,
        before="import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))",
        after="story.threading.Event().wait(0.02)\n"
        "        if recorder.box.trouble:\n"
        "            print(recorder.box.trouble); break",
    )
    told, _ = process.communicate(timeout=60.0)
    assert "File too large" in told
    assert process.returncode == 0
    assert replayed(sorted(tmp_path.glob("*.mcap")))[0] > 0, "what was flushed before is there"


def _turns(files):
    """Turns on the disk by now; none where there is no whole chunk yet."""
    from chute_ros.errors import RecordError

    try:
        return len(read(files, {}).turns)
    except RecordError:
        return 0
