"""A folder that `ros2 bag` takes: one MCAP file with an index, and metadata.yaml.

metadata.yaml is of version 8: Humble reads it as well as everything after it. Version 9 only has
the quality of service in another form.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import yaml
from mcap.writer import CompressionType, Writer

from chute_ros.errors import RecordError
from chute_ros.tools.mcap_entries import Entry

_VERSION = 8


class Rosbag2Folder:
    """path: an empty folder. All methods raise OSError as the disk does."""

    def __init__(self, path: Path) -> None:
        self._folder = path
        self._path = path / f"{path.name}_0.mcap"
        self._file = self._path.open("wb")
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="chute_ros")
        self._schemas: dict[str, int] = {}
        #: Topic -> the first entry on it, and its channel.
        self._channels: dict[str, tuple[Entry, int]] = {}
        self._counts: Counter[str] = Counter()
        #: Times of the earliest and of the latest message, Unix ns; None: there is none yet.
        self._span: tuple[int, int] | None = None

    def write(self, entry: Entry) -> None:
        """The same message. RecordError: earlier ones on its topic were of another type."""
        channel = self._channel(entry)
        self._writer.add_message(channel, entry.time, entry.data, entry.time, entry.number)
        self._counts[entry.channel.topic] += 1
        first, last = self._span or (entry.time, entry.time)
        self._span = min(first, entry.time), max(last, entry.time)

    def finish(self) -> None:
        """Write the index and metadata.yaml. RecordError: there was no message."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()
        if self._span is None:
            raise RecordError(f"{self._folder}: there is no message to write")
        text = yaml.safe_dump({"rosbag2_bagfile_information": self._about()}, sort_keys=False)
        (self._folder / "metadata.yaml").write_text(text, encoding="utf-8")

    def close(self) -> None:
        """Write no more."""
        self._file.close()

    def _channel(self, entry: Entry) -> int:
        topic, schema = entry.channel.topic, entry.schema
        if topic in self._channels:
            first, channel = self._channels[topic]
            if (first.schema.name, first.schema.data) != (schema.name, schema.data):
                raise RecordError(
                    f"{topic} is of two versions of {schema.name}: convert the files one by one"
                )
            return channel
        if schema.name not in self._schemas:
            self._schemas[schema.name] = self._writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        channel = self._writer.register_channel(
            topic,
            entry.channel.message_encoding,
            self._schemas[schema.name],
            entry.channel.metadata,
        )
        self._channels[topic] = entry, channel
        return channel

    def _about(self) -> dict[str, Any]:
        """What metadata.yaml says, as rosbag2_storage reads it (yaml.hpp)."""
        assert self._span is not None
        first, last = self._span
        begin = {"nanoseconds_since_epoch": first}
        duration = {"nanoseconds": last - first}
        count = self._counts.total()
        return {
            "version": _VERSION,
            "storage_identifier": "mcap",
            "duration": duration,
            "starting_time": begin,
            "message_count": count,
            "topics_with_message_count": [
                {"topic_metadata": _topic(entry), "message_count": self._counts[topic]}
                for topic, (entry, _) in self._channels.items()
            ],
            # Of the file; its chunks are compressed, which MCAP does itself.
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._path.name],
            "files": [
                {
                    "path": self._path.name,
                    "starting_time": dict(begin),
                    "duration": dict(duration),
                    "message_count": count,
                }
            ],
            "custom_data": {},
            # Of the recording computer: a black box does not tell.
            "ros_distro": "",
        }


def _topic(entry: Entry) -> dict[str, str]:
    return {
        "name": entry.channel.topic,
        "type": entry.schema.name,
        "serialization_format": entry.channel.message_encoding,
        "offered_qos_profiles": entry.channel.metadata.get("offered_qos_profiles", ""),
        "type_description_hash": entry.channel.metadata.get("topic_type_hash", ""),
    }
