"""Turns what a black box keeps into messages in files; used by its thread alone."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any, NamedTuple

from chute_msgs.msg import SupervisorRecord
from rclpy.serialization import serialize_message

from chute_ros.ros.box_folder import BoxFolder
from chute_ros.ros.mcap_file import McapFile, Topic
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.state import State

#: The topic of the core's turns.
RECORD = "safety/record"
#: The whole state is written again after this, s: damage costs a replay no more than this.
SNAPSHOT_INTERVAL = 60.0
#: Another supervisor on this host may take the same name at the same moment; not for ever.
_MOST_NAMES = 100
#: What write raises for an entry that cannot be a message; the next one can be written.
NOT_WRITABLE = (
    AssertionError,
    AttributeError,
    LookupError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
)


class Kept(NamedTuple):
    """A message or its CDR bytes, and when it was heard or said (Unix ns)."""

    time: int
    topic: str
    message: Any


class KeptTurn(NamedTuple):
    """A turn of the core; number: rises by one with each, whether it is kept or not, and by one
    more where what is remembered was changed in between."""

    time: int
    number: int
    now: float
    inputs: tuple[i.Input, ...]
    outputs: tuple[i.Output, ...]
    before: State
    config: SupervisorConfig


class BoxWriter:
    """Raises OSError as the disk does; then abandon, and the next entry begins a new file."""

    def __init__(self, folder: BoxFolder, topics: Mapping[str, Topic], limit: int) -> None:
        self._folder, self._topics, self._limit = folder, topics, limit
        self._file: McapFile | None = None
        #: Of the present or the newest file.
        self.path = str(folder.path)
        #: Entries in the present file, and how many of them are on the disk.
        self._entries = self._kept = 0
        self._turn = 0
        self._snapshot_at = -math.inf

    @property
    def size(self) -> int:
        """Bytes in the present file."""
        return self._file.size if self._file is not None else 0

    def write(self, entry: Kept | KeptTurn) -> None:
        """Write one entry, into a new file if there is none, or if the present one is full."""
        if self._file is not None and self._file.size >= self._limit:
            self.finish()
        file = self._file if self._file is not None else self._open(entry.time)
        if isinstance(entry, KeptTurn):
            number = entry.number % 2**32
            file.write(RECORD, serialize_message(self._record(entry)), entry.time, number)
        else:
            file.write(entry.topic, self._serialized(entry), entry.time)
        self._entries += 1

    def flush(self) -> None:
        """Everything that was written is on the disk when this returns."""
        if self._file is not None and self._entries > self._kept:
            self._file.flush()
            if not self._kept:
                # Not before: where nothing can be written nothing old must go either.
                self._folder.prune()
            self._kept = self._entries

    def finish(self) -> None:
        """End the present file."""
        self.flush()
        if self._file is not None:
            self._file.finish()
            self._file = None

    def abandon(self) -> int:
        """After an OSError: leave the present file as it is. How many entries it does not have."""
        file, self._file = self._file, None
        if file is None:
            return 0
        file.abandon()
        if not self._kept:
            file.path.unlink(missing_ok=True)  # nothing is in it
        return self._entries - self._kept

    def _serialized(self, entry: Kept) -> bytes:
        if isinstance(entry.message, bytes):
            return entry.message
        kind = self._topics[entry.topic].kind
        if type(entry.message) is not kind:
            raise TypeError(f"{entry.topic} is of {kind.__name__}, got {type(entry.message)}")
        return bytes(serialize_message(entry.message))

    def _open(self, wall: int) -> McapFile:
        self._entries = self._kept = 0
        self._turn = 0
        for _ in range(_MOST_NAMES):
            path = self._folder.next_path(wall)
            self.path = str(path)
            try:
                self._file = McapFile(path, self._topics)
            except FileExistsError:
                continue  # another supervisor on this host was quicker
            return self._file
        raise FileExistsError(f"{self.path} and others were taken by somebody else")

    def _record(self, turn: KeptTurn) -> SupervisorRecord:
        message = SupervisorRecord(
            monotonic=turn.now,
            inputs=[CODEC.to_json(one) for one in turn.inputs],
            outputs=[CODEC.to_json(one) for one in turn.outputs],
        )
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(turn.time, 10**9)
        follows = self._turn and turn.number == self._turn + 1
        if not follows or turn.now >= self._snapshot_at:
            message.config = CODEC.to_json(turn.config, whole=True)
            message.state = CODEC.to_json(turn.before, whole=True)
            self._snapshot_at = turn.now + SNAPSHOT_INTERVAL
        self._turn = turn.number
        return message
