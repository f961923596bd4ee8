"""One MCAP file of ROS 2 messages, as rosbag2 and Foxglove read it.

What was flushed stays readable however the file ends: each flush finishes a chunk, which can be
read without what follows it, and waits until the disk has it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer
from rclpy.qos import DurabilityPolicy, QoSProfile

from chute_ros.ros.message_definitions import definition, type_hash, type_name
from chute_ros.ros.private_files import open_new, sync_folder

#: A chunk that is longer (bytes, before compression) is finished before the next flush.
_CHUNK = 256 * 1024
_FOREVER = "{sec: 9223372036, nsec: 854775807}"


@dataclass(frozen=True)
class Topic:
    """A topic that is recorded: its whole name, its class of messages, its quality of service."""

    name: str
    kind: Any
    profile: QoSProfile


class McapFile:
    """A new file at path, for nobody else to read, with messages of these topics (each under a
    key of the caller's). All methods raise OSError as the disk does; then only abandon is left."""

    def __init__(self, path: Path, topics: Mapping[str, Topic]) -> None:
        self.path = path
        self._disk = _Disk(path)
        try:
            self._writer = Writer(
                self._disk,  # type: ignore[arg-type]
                chunk_size=_CHUNK,
                compression=CompressionType.ZSTD,
            )
            self._writer.start(profile="ros2", library="chute_ros")
            self._channels = {key: self._channel(topic) for key, topic in topics.items()}
            # The name must be on the disk too, or a power cut takes the file away.
            sync_folder(path.parent)
        except OSError:
            self._disk.close()
            path.unlink(missing_ok=True)  # or each try on a full disk would leave one behind
            raise

    @property
    def size(self) -> int:
        """Bytes in the file so far, without the chunk that is being filled."""
        return self._disk.position

    def write(self, key: str, data: bytes, time: int, number: int = 0) -> None:
        """A message as CDR. time: wall clock, Unix ns; number: kept with it as its sequence."""
        self._writer.add_message(self._channels[key], time, data, time, number)

    def flush(self) -> None:
        """Everything that was written is on the disk when this returns."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._disk.sync()

    def finish(self) -> None:
        """Write the index, by which others find their way faster, and close."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._disk.sync()
        self._disk.close()

    def abandon(self) -> None:
        """Close without writing any more."""
        self._disk.close()

    def _channel(self, topic: Topic) -> int:
        schema = self._writer.register_schema(
            type_name(topic.kind), "ros2msg", definition(topic.kind).encode()
        )
        about = {
            "offered_qos_profiles": _offered(topic.profile),
            "topic_type_hash": type_hash(topic.kind),
        }
        return self._writer.register_channel(topic.name, "cdr", schema, about)


class _Disk:
    """The file as the writer of MCAP wants it. Nothing is kept back: each write reaches the
    system, or raises."""

    def __init__(self, path: Path) -> None:
        self._descriptor = open_new(path)
        self.position = 0

    def write(self, data: bytes) -> int:
        left = memoryview(data)
        while left:
            written = os.write(self._descriptor, left)
            self.position += written
            left = left[written:]
        return len(data)

    def tell(self) -> int:
        return self.position

    def flush(self) -> None:
        """Nothing is kept back."""

    def sync(self) -> None:
        os.fsync(self._descriptor)

    def close(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def _offered(profile: QoSProfile) -> str:
    """As rosbag2 notes what a publisher offers. The numbers are rmw's own: Humble knows only
    those, and everything after it takes them as well."""
    latched = profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
    return (
        f"- history: 1\n  depth: {profile.depth}\n  reliability: 1\n"
        f"  durability: {1 if latched else 2}\n"
        f"  deadline: {_FOREVER}\n  lifespan: {_FOREVER}\n"
        f"  liveliness: 1\n  liveliness_lease_duration: {_FOREVER}\n"
        "  avoid_ros_namespace_conventions: false\n"
    )
