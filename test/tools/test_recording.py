"""What was recorded is read back, whatever became of the file."""

import random
import struct
import zlib
from dataclasses import replace

import pytest
from chute_msgs.msg import SafetyState, SupervisorRecord
from flight_bench import END, NAMESPACE, START, STEP, WALL
from mcap.writer import Writer
from zstandard import ZstdCompressor

from chute_ros.errors import RecordError
from chute_ros.ros.box_writer import RECORD
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.record import CoreTurn
from chute_ros.supervisor.state import State
from chute_ros.tools.mcap_entries import McapEntries
from chute_ros.tools.recording import Beginning, RecordedTurn, Recording, files_of, read

pytestmark = pytest.mark.xdist_group("recording")
KINDS = {"safety/state": SafetyState}


@pytest.fixture(scope="module")
def whole(flight):
    return flight.files()[0].read_bytes()


def turns_of(path, data):
    path.write_bytes(data)
    try:
        return len(read([path], {}).turns)
    except RecordError:
        return 0


def test_every_turn_and_message_comes_back_in_its_order(flight):
    recording = read(flight.files(), KINDS)
    assert recording.remarks == []
    assert recording.namespace == NAMESPACE
    turns = recording.turns
    assert len(turns) == round(END / STEP)
    assert [one.number for one in turns] == list(range(2, len(turns) + 2))
    assert turns[0].wall == WALL
    assert turns[0].turn.now == START
    assert [output for one in turns for output in one.turn.outputs] == flight.outputs
    assert repr(turns[0].config) == repr(flight.config)  # a limit that is not asked for is NaN
    assert turns[0].state is not None
    assert turns[1].state is None, "the state is written at the beginning, not each time"
    assert len(recording.messages["safety/state"]) == len(turns)


def test_what_is_not_asked_for_is_not_taken_apart(flight):
    assert read(flight.files(), {}).messages == {}


def test_a_folder_stands_for_its_files_in_their_order(flight):
    assert files_of([flight.folder]) == flight.files()
    assert files_of(flight.files()) == flight.files()


def test_a_folder_without_files_is_told(tmp_path):
    with pytest.raises(RecordError, match=r"there is no \.mcap file in it"):
        files_of([tmp_path])


def test_a_file_cut_anywhere_near_its_end_or_elsewhere_is_read_as_far_as_it_goes(whole, tmp_path):
    path, previous = tmp_path / "cut.mcap", 0
    tail = range(len(whole) - 4096, len(whole), 23)
    for end in sorted([*tail, *random.Random(1).sample(range(len(whole)), 60)]):
        path.write_bytes(whole[:end])
        try:
            turns = sum(one.channel.topic.endswith(RECORD) for one in McapEntries(path))
        except RecordError:
            turns = 0
        assert previous <= turns, f"cut at {end}: a longer file never tells less"
        previous = turns
    assert previous == round(END / STEP), "what follows the last chunk is only the index"
    assert turns_of(path, whole[:end]) == previous


def test_a_cut_file_is_told_to_be_one(whole, tmp_path):
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: len(whole) * 3 // 4])
    entries = McapEntries(path)
    assert list(entries)
    assert [remark for remark in entries.remarks if "ends in the middle" in remark]


def test_zeros_at_the_end_as_some_disks_leave_them_are_no_harm(whole, tmp_path):
    turns = turns_of(tmp_path / "zeros.mcap", whole + bytes(5000))
    assert turns == round(END / STEP)


def test_bytes_that_changed_cost_what_is_around_them_and_raise_nothing_else(whole, tmp_path):
    chance = random.Random(2)
    for _ in range(60):
        data = bytearray(whole)
        for _ in range(chance.randint(1, 4)):
            data[chance.randrange(len(data))] ^= chance.randint(1, 255)
        turns_of(tmp_path / "changed.mcap", bytes(data))


@pytest.mark.parametrize("data", [b"", b"no mcap at all", bytes(100), b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_told_in_one_line(data, tmp_path):
    path = tmp_path / "wrong.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordError, match="is no MCAP file") as caught:
        read([path], {})
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(RecordError, match="No such file"):
        read([tmp_path / "nothing.mcap"], {})


def test_a_file_of_somebody_else_has_no_turns(tmp_path):
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/chatter", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0\1\0\0\0\0", 1)
        writer.finish()
    with pytest.raises(RecordError, match="no turn of a supervisor"):
        read([path], {})


def forged(path, topic, schema_name, metadata, data):
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        schema = writer.register_schema(schema_name, "ros2msg", b"")
        channel = writer.register_channel(topic, "cdr", schema, metadata)
        writer.add_message(channel, 1, data, 1)
        writer.finish()


def packed(path, size, says):
    """A file with one chunk of size zeros, which says that it has another size."""
    packer = ZstdCompressor().compressobj()
    data = b"".join(packer.compress(bytes(1 << 20)) for _ in range(size >> 20)) + packer.flush()
    head = struct.pack("<QQQI", 0, 1, says, 0) + b"\4\0\0\0zstd" + struct.pack("<Q", len(data))
    records = [(0x01, b"\0" * 8), (0x06, head + data), (0x02, b"\0" * 20)]
    told = [bytes((kind,)) + struct.pack("<Q", len(one)) + one for kind, one in records]
    path.write_bytes(b"\x89MCAP0\r\n" + b"".join(told) + b"\x89MCAP0\r\n")
    return path


@pytest.mark.parametrize("says", [1 << 28, 1 << 20, 0], ids=["what it has", "less", "nothing"])
def test_a_few_bytes_do_not_become_hours_of_reading(says, tmp_path):
    """Each nine zeros read as a record that is none: 30 million of them in 8 kB."""
    entries = McapEntries(packed(tmp_path / "bomb.mcap", 1 << 28, says))
    assert list(entries) == []
    assert entries.path.stat().st_size < 10_000
    assert "damaged parts are left out (1 chunks)" in entries.remarks[0]


def test_a_recording_of_another_version_is_told(tmp_path):
    path = tmp_path / "old.mcap"
    about = {"topic_type_hash": "RIHS01_" + zlib.crc32(b"old").to_bytes(4, "big").hex()}
    forged(path, "/safety/record", "chute_msgs/msg/SupervisorRecord", about, b"")
    with pytest.raises(RecordError, match="another version of chute_msgs"):
        read([path], {})


def test_a_message_that_the_middleware_cannot_read_is_told(tmp_path):
    path = tmp_path / "spoilt.mcap"
    spoilt = b"\0\1\0\0" + b"\xff" * 40
    forged(path, "/safety/record", "chute_msgs/msg/SupervisorRecord", {}, spoilt)
    with pytest.raises(RecordError, match=r"spoilt\.mcap: message 0 of /safety/record cannot be"):
        read([path], {})


def test_inputs_that_this_version_does_not_know_are_told(flight, tmp_path, monkeypatch):
    from chute_ros.supervisor.codec import Codec
    from chute_ros.tools import recording

    monkeypatch.setattr(recording, "CODEC", Codec(i.DeployRequest))
    with pytest.raises(RecordError, match=r"class \w+ is not known: written by another version"):
        read(flight.files(), {})


def test_ctrl_c_in_the_middle_of_a_message_is_not_the_fault_of_the_recording(flight, monkeypatch):
    """The middleware, which makes the message, calls it an error of its own."""

    def interrupted(_, **__):
        # As Python's own handler; a real signal would end the ROS of the other tests as well.
        raise KeyboardInterrupt

    monkeypatch.setattr(SupervisorRecord, "__init__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        read(flight.files(), {})


@pytest.mark.parametrize(
    ("number", "epoch", "started_at", "starts"),
    [
        (300, 7, 1000.0, False),
        (300, 8, 1000.0, False),
        (300, 7, 1500.0, False),
        (300, 8, 1500.0, True),
        (2, 7, 1000.0, True),
        (100, 7, 1000.0, True),
    ],
    ids=["full", "takeover", "reset", "head lost", "first turn", "lower number"],
)
def test_a_file_of_another_start_is_told_from_the_next_of_the_same(
    number, epoch, started_at, starts
):
    """Given an earlier file of the same supervisor that begins with turn 200."""
    former = Beginning("", replace(turn(200, 100.0, 5.0), state=State(7, 1000.0)))
    state = State(epoch, started_at)
    assert (
        Beginning("", replace(turn(number, 200.0, 9.0), state=state)).is_start_after(former)
        is starts
    )


def turn(number, wall, now):
    return RecordedTurn(round(wall * 1e9), number, CoreTurn(now, (), ()))


@pytest.mark.parametrize("step", [86_400.0, -3_600.0])
def test_a_wall_clock_that_is_set_moves_nothing(step):
    """Given one that is set after the third turn, as by GPS."""
    walls = [100.0, 101.0, 102.0, 103.0 + step, 104.0 + step]
    recording = Recording([turn(n, wall, 5.0 + n) for n, wall in enumerate(walls)])
    told = [recording.seconds(one.wall) for one in recording.turns]
    assert told == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0])
    assert recording.seconds(round((102.25) * 1e9)) == pytest.approx(2.25)
    assert recording.seconds(round((104.5 + step) * 1e9)) == pytest.approx(4.5)


def test_after_another_start_the_wall_clock_tells_how_long_it_was_away():
    recording = Recording([turn(0, 100.0, 5.0), turn(1, 101.0, 6.0), turn(0, 161.0, 2.0)])
    assert [recording.seconds(one.wall) for one in recording.turns] == [0.0, 1.0, 61.0]
