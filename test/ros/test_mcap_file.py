"""A file of messages: as other programs read it, and as it is after a power cut."""

import os
import re
import stat

import pytest
import yaml
from chute_msgs.msg import LinkHeartbeat, SafetyState
from diagnostic_msgs.msg import DiagnosticArray
from mcap.reader import make_reader
from rclpy.serialization import deserialize_message, serialize_message

from chute_ros.ros import qos
from chute_ros.ros.mcap_file import McapFile, Topic
from chute_ros.ros.message_definitions import definition, type_hash, type_name
from chute_ros.tools.mcap_entries import McapEntries

TOPICS = {
    "beat": Topic("/drone1/safety/heartbeat", LinkHeartbeat, qos.STATUS),
    "state": Topic("/drone1/safety/state", SafetyState, qos.LATCHED),
}


def beat(number):
    return serialize_message(LinkHeartbeat(link="mavlink_parachute", seq=number))


def count(path):
    return sum(1 for _ in McapEntries(path))


def test_another_reader_finds_topics_schemas_and_messages_by_the_index(tmp_path):
    file = McapFile(tmp_path / "one.mcap", TOPICS)
    for number in range(5):
        file.write("beat", beat(number), 10**9 + number, number)
    file.finish()
    with (tmp_path / "one.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.statistics.message_count == 5
        assert {one.topic for one in summary.channels.values()} == {
            topic.name for topic in TOPICS.values()
        }
        found = list(reader.iter_messages())
    schema, channel, message = found[3]
    assert (schema.name, schema.encoding) == ("chute_msgs/msg/LinkHeartbeat", "ros2msg")
    assert channel.message_encoding == "cdr"
    assert message.log_time == message.publish_time == 10**9 + 3
    assert deserialize_message(message.data, LinkHeartbeat).seq == 3


def test_the_quality_of_service_is_noted_as_rosbag2_reads_it(tmp_path):
    file = McapFile(tmp_path / "one.mcap", TOPICS)
    file.finish()
    with (tmp_path / "one.mcap").open("rb") as stream:
        channels = make_reader(stream).get_summary().channels.values()
    for key, durability in (("beat", 2), ("state", 1)):
        (channel,) = (one for one in channels if one.topic == TOPICS[key].name)
        (offered,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert offered["reliability"] == 1
        assert offered["durability"] == durability, "latched stays latched when played"
        assert offered["depth"] == TOPICS[key].profile.depth
        assert set(offered["deadline"]) == {"sec", "nsec"}
        assert channel.metadata["topic_type_hash"] == type_hash(TOPICS[key].kind)


def test_a_definition_brings_along_all_that_it_is_made_of():
    text = definition(DiagnosticArray)
    names = re.findall(r"={80}\nMSG: (\S+)\n", text)
    assert set(names) == {
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "diagnostic_msgs/DiagnosticStatus",
        "diagnostic_msgs/KeyValue",
    }
    assert len(names) == len(set(names)), "each once"
    assert text.index("DiagnosticStatus[] status") < text.index("=" * 80)
    assert type_name(DiagnosticArray) == "diagnostic_msgs/msg/DiagnosticArray"
    assert type_hash(DiagnosticArray).startswith("RIHS01_")


def test_a_file_cut_at_any_byte_has_what_was_flushed_before(tmp_path):
    path = tmp_path / "one.mcap"
    file = McapFile(path, {"beat": TOPICS["beat"]})
    flushed = [(file.size, 0)]
    for number in (1, 2):
        for _ in range(number):
            file.write("beat", beat(number), number)
        file.flush()
        flushed.append((path.stat().st_size, flushed[-1][1] + number))
    file.abandon()
    data, cut = path.read_bytes(), tmp_path / "cut.mcap"
    assert len(data) == flushed[-1][0], "what was flushed is in the file"
    for end in range(flushed[0][0], len(data) + 1):
        cut.write_bytes(data[:end])
        sure = max(messages for size, messages in flushed if size <= end)
        assert count(cut) >= sure, f"cut at {end}"
    assert count(cut) == 3


def test_what_was_not_flushed_is_not_missed_by_what_was(tmp_path):
    path = tmp_path / "one.mcap"
    file = McapFile(path, TOPICS)
    file.write("beat", beat(1), 1)
    file.flush()
    file.write("beat", beat(2), 2)
    assert count(path) == 1, "it can be read while it is being written"
    file.abandon()
    assert count(path) == 1


def test_nobody_else_may_read_it_and_none_is_overwritten(tmp_path):
    path = tmp_path / "one.mcap"
    McapFile(path, TOPICS).finish()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with pytest.raises(FileExistsError):
        McapFile(path, TOPICS)


def test_a_file_that_cannot_be_begun_is_closed_again(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    before = len(os.listdir("/proc/self/fd"))
    with monkeypatch.context() as patch:
        patch.setattr("chute_ros.ros.mcap_file.os.write", full)
        with pytest.raises(OSError, match="No space left"):
            McapFile(tmp_path / "one.mcap", TOPICS)
    assert len(os.listdir("/proc/self/fd")) == before
