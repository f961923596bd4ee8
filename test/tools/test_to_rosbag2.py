"""A black box becomes a folder that another reader of rosbag2 takes, with every message in it."""

import dataclasses

import pytest
import yaml
from command_bench import tool
from flight_bench import NAMESPACE, WALL, Flight, run
from rclpy.serialization import deserialize_message
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from chute_ros.errors import RecordError
from chute_ros.ros.message_definitions import type_name
from chute_ros.ros.recorded_topics import recorded_topics
from chute_ros.tools import to_rosbag2_command as command
from chute_ros.tools.mcap_entries import McapEntries

pytestmark = pytest.mark.xdist_group("to_rosbag2")
HINT = (
    "to_rosbag2: play where no vehicle receives it: a recorded request or heartbeat is one to "
    "every node in the same domain\n"
)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A flight with a call of a service in its record; its file."""
    flight = Flight(tmp_path_factory.mktemp("flown"))
    flight.call("~/deploy", "reason: test", 0.0)
    return flight.fly().land()


def recorded(*files):
    """(topic, time, CDR) of every message of black boxes."""
    return [(one.channel.topic, one.time, one.data) for file in files for one in McapEntries(file)]


def read(folder):
    """The same of a folder of rosbag2, as a reader that is not ours finds it."""
    with Reader(folder) as reader:
        return [(one.topic, time, data) for one, time, data in reader.messages()]


def convert(monkeypatch, *arguments):
    return run(command.main, monkeypatch, *arguments)


def test_another_reader_finds_every_message_with_its_time(flown, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "bag"
    assert convert(monkeypatch, flown, "--output", folder) == 0
    told = capsys.readouterr()
    assert (told.out, told.err) == (f"{folder}\n", HINT)
    before = recorded(flown)
    assert len(before) > 200
    assert read(folder) == before


def test_another_reader_decodes_them_by_the_types_in_the_file_alone(flown, tmp_path, monkeypatch):
    convert(monkeypatch, flown, "--output", tmp_path / "bag")
    kinds = {one.name: one.kind for one in recorded_topics(_Names()).values()}
    decoded = 0
    with Reader(tmp_path / "bag") as reader:
        store = get_typestore(Stores.EMPTY)
        for one in reader.connections:
            store.register(get_types_from_msg(one.msgdef.data, one.msgtype))
        for one in reader.connections:
            assert one.msgtype == type_name(kinds[one.topic])
            assert one.digest == store.hash_rihs01(one.msgtype), "the type that its hash is of"
        for one, _, data in reader.messages():
            theirs = store.deserialize_cdr(data, one.msgtype)
            ours = deserialize_message(data, kinds[one.topic])
            assert _plain(theirs) == _plain(ours)
            decoded += 1
    assert decoded == len(recorded(flown))


class _Names:
    def resolve_topic_name(self, name):
        return f"{NAMESPACE}/{name}"


def _plain(message):
    """The fields of a message of either reader, by name; text of floats: NaN is NaN."""
    if dataclasses.is_dataclass(message):
        # Without the constants of a type, which are fields there.
        names = [one.name for one in dataclasses.fields(message) if one.name.islower()]
        names.remove("__msgtype__")
    else:
        names = message.get_fields_and_field_types()
    fields = {name: getattr(message, name) for name in names}
    return {name: _value(value) for name, value in fields.items()}


def _value(value):
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)) or hasattr(value, "typecode"):
        return [_value(one) for one in value]
    if isinstance(value, (str, bytes, int, float)):
        return repr(value)
    return _plain(value)


def test_latched_topics_stay_latched(flown, tmp_path, monkeypatch):
    convert(monkeypatch, flown, "--output", tmp_path / "bag")
    with Reader(tmp_path / "bag") as reader:
        offered = {one.topic: one.ext.offered_qos_profiles for one in reader.connections}
    ours = {one.name: one.profile for one in recorded_topics(_Names()).values()}
    assert f"{NAMESPACE}/safety/state" in offered
    for topic, (profile,) in offered.items():
        assert profile.reliability is QosReliability.RELIABLE
        assert profile.durability.value == ours[topic].durability.value
        assert profile.depth == ours[topic].depth
    (latched,) = offered[f"{NAMESPACE}/safety/state"]
    assert latched.durability is QosDurability.TRANSIENT_LOCAL


def test_metadata_has_every_field_of_rosbag2_and_the_counts(flown, tmp_path, monkeypatch):
    """As rosbag2_storage/yaml.hpp reads version 8: one that is missing raises there."""
    convert(monkeypatch, flown, "--output", tmp_path / "bag")
    text = (tmp_path / "bag" / "metadata.yaml").read_text()
    about = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert list(about) == [
        "version",
        "storage_identifier",
        "duration",
        "starting_time",
        "message_count",
        "topics_with_message_count",
        "compression_format",
        "compression_mode",
        "relative_file_paths",
        "files",
        "custom_data",
        "ros_distro",
    ]
    assert (about["version"], about["storage_identifier"]) == (8, "mcap")
    before = recorded(flown)
    times = [time for _, time, _ in before]
    (file,) = about["files"]
    for one in (about, file):
        assert one["message_count"] == len(before)
        assert one["starting_time"] == {"nanoseconds_since_epoch": min(times)}
        assert one["duration"] == {"nanoseconds": max(times) - min(times)}
    assert about["relative_file_paths"] == [file["path"]] == ["bag_0.mcap"]
    topics = {one["topic_metadata"]["name"]: one for one in about["topics_with_message_count"]}
    for topic, one in topics.items():
        assert one["message_count"] == sum(name == topic for name, _, _ in before)
        assert list(one["topic_metadata"]) == [
            "name",
            "type",
            "serialization_format",
            "offered_qos_profiles",
            "type_description_hash",
        ]
        # Before version 9 text, in which numbers are rmw's own.
        (profile,) = yaml.safe_load(one["topic_metadata"]["offered_qos_profiles"])
        assert isinstance(profile["history"], int)
    assert set(topics) == {topic for topic, _, _ in before}


def test_several_files_of_one_recording_are_one_folder(tmp_path, await_until, monkeypatch):
    """Given a supervisor whose first file is full at t+1 s."""
    flight = Flight(tmp_path / "box", limit=1000)
    flight.fly(1.0)
    await_until(lambda: flight.box.counts()["bytes in the file"] > 1000, "the first is full")
    flight.fly(3.0).land()
    first, second = flight.files()
    assert convert(monkeypatch, tmp_path / "box", "--output", tmp_path / "bag") == 0
    assert read(tmp_path / "bag") == recorded(first, second)


def test_each_recording_of_a_folder_becomes_a_folder_beside_it(tmp_path, monkeypatch, capsys):
    box = tmp_path / "box"
    for number in range(2):
        Flight(box, wall=WALL + number * 10**13, epoch=7 + number).fly(1.0).land()
    files = sorted(box.glob("*.mcap"))
    assert convert(monkeypatch, box) == 0
    folders = [file.with_suffix(".rosbag2") for file in files]
    assert capsys.readouterr().out == "".join(f"{folder}\n" for folder in folders)
    for file, folder in zip(files, folders, strict=True):
        assert read(folder) == recorded(file)
    assert convert(monkeypatch, box, "--output", tmp_path / "bag") == 2
    told = capsys.readouterr()
    assert "--output is one folder, and these are 2 recordings" in told.err
    assert not (tmp_path / "bag").exists()
    assert convert(monkeypatch, box, "--output", tmp_path / "bag", "--recording", 2) == 0
    assert read(tmp_path / "bag") == recorded(files[1])


@pytest.mark.parametrize("share", [0.5, 0.8, 0.99])
def test_a_file_that_a_power_cut_ended_is_converted_as_far_as_it_goes(
    share, tmp_path, await_until, monkeypatch, capsys
):
    flight = Flight(tmp_path / "box")
    for until in range(1, 9):
        flight.fly(float(until))
        await_until(lambda: not flight.box.counts()["entries waiting"], "all is written")
        flight.box._writer.flush()
    path = flight.land()
    whole = path.read_bytes()
    path.write_bytes(whole[: round(len(whole) * share)])
    left = recorded(path)
    assert left, "there is something to read"
    assert convert(monkeypatch, path, "--output", tmp_path / "bag") == 0
    assert read(tmp_path / "bag") == left
    told = capsys.readouterr()
    assert told.out == f"{tmp_path / 'bag'}\n"
    assert f"to_rosbag2: {path} ends in the middle" in told.err


def test_a_clock_that_was_set_is_told_because_play_follows_it(tmp_path, monkeypatch, capsys):
    """Given a computer whose clock is set an hour on at t+1 s and 2 s back at t+2 s."""
    flight = Flight(tmp_path / "box")
    flight.fly(1.0)
    flight.wall += 3600 * 10**9
    flight.fly(2.0)
    flight.wall -= 2 * 10**9
    path = flight.fly(3.0).land()
    assert convert(monkeypatch, path, "--output", tmp_path / "bag") == 0
    assert sorted(read(tmp_path / "bag")) == sorted(recorded(path))
    err = capsys.readouterr().err
    assert "no message for 3600 s after 2026-05-28 20:26:40 UTC: `ros2 bag play` waits" in err
    assert "the clock was set back by 1.900 s after 2026-05-28 21:26:41 UTC" in err


def test_nothing_is_overwritten_and_nothing_half_made_is_left(
    flown, tmp_path, monkeypatch, capsys
):
    folder = tmp_path / "bag"
    folder.mkdir()
    assert convert(monkeypatch, flown, "--output", folder) == 2
    expected = f"to_rosbag2: {folder} exists: remove it, or name another with --output\n"
    assert capsys.readouterr().err == expected
    assert list(folder.iterdir()) == []
    assert convert(monkeypatch, flown, "--output", tmp_path / "no" / "bag") == 2
    assert "no/bag: No such file or directory" in capsys.readouterr().err

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("chute_ros.tools.rosbag2_folder.Rosbag2Folder.finish", full)
    assert convert(monkeypatch, flown, "--output", tmp_path / "full") == 2
    assert capsys.readouterr().err == f"to_rosbag2: {tmp_path / 'full'}: No space left on device\n"
    assert not (tmp_path / "full").exists()


@pytest.mark.parametrize(
    "data",
    [b"", b"no MCAP", b"\x89MCAP0\r\n", bytes(range(256)) * 12],
    ids=["empty", "text", "only the first bytes", "other bytes"],
)
def test_what_is_no_black_box_is_refused_in_one_line(data, tmp_path, monkeypatch, capsys):
    path = tmp_path / "bad.mcap"
    path.write_bytes(data)
    assert convert(monkeypatch, path, "--output", tmp_path / "bag") == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert len(told.err.splitlines()) == 1
    assert told.err.startswith(f"to_rosbag2: {path}") or "there is no message" in told.err
    assert not (tmp_path / "bag").exists()


def test_files_of_two_versions_of_a_message_are_not_mixed(flown, tmp_path, monkeypatch):
    """Given a second file in which a field of a message has another name."""
    other = tmp_path / "other.mcap"
    other.write_bytes(flown.read_bytes())
    entry_of = McapEntries._entry

    def renamed(self, record):
        for entry in entry_of(self, record):
            if self.path == other:
                data = entry.schema.data.replace(b"float64 monotonic", b"float64 other")
                entry = entry._replace(schema=dataclasses.replace(entry.schema, data=data))
            yield entry

    monkeypatch.setattr(McapEntries, "_entry", renamed)
    text = f"{NAMESPACE}/safety/record is of two versions of chute_msgs/msg/SupervisorRecord"
    with pytest.raises(RecordError, match=text):
        command.convert([flown, other], tmp_path / "bag")
    assert not (tmp_path / "bag").exists()
    assert command.convert([other], tmp_path / "bag") == []


def test_as_a_person_starts_it(flown, tmp_path):
    folder = tmp_path / "b"
    assert tool("to_rosbag2", flown, "--output", folder) == (0, f"{folder}\n", HINT)
    assert read(folder) == recorded(flown)
