"""Reads what a black box wrote: the turns of the core, and the messages around them."""

from __future__ import annotations

import bisect
import datetime
import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from chute_msgs.msg import SupervisorRecord
from rclpy.serialization import deserialize_message

from chute_ros.errors import RecordError
from chute_ros.ros.box_writer import RECORD
from chute_ros.ros.message_definitions import type_hash, type_name
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.record import CODEC, CoreTurn
from chute_ros.supervisor.state import State
from chute_ros.tools.mcap_entries import Entry, McapEntries
from chute_ros.tools.progress import Progress


@dataclass(frozen=True)
class RecordedTurn:
    """A turn of the core. wall: Unix ns; number: rises by one with each turn of one supervisor;
    config, state: the settings, and what was remembered before it, where they were written."""

    wall: int
    number: int
    turn: CoreTurn
    config: SupervisorConfig | None = None
    state: State | None = None


@dataclass
class Recording:
    """What files hold. messages: by the relative name of their topic, with their wall clock (Unix
    ns); remarks: what was not in order, one line each."""

    turns: list[RecordedTurn] = field(default_factory=list)
    messages: dict[str, list[tuple[int, Any]]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    #: The namespace of the vehicle, as in "/drone1"; empty: none.
    namespace: str = ""
    #: Full names of all topics of the files, also of those without any message.
    topics: set[str] = field(default_factory=set)

    def has(self, name: str) -> bool:
        """Whether the vehicle's topic of this relative name was recorded."""
        return f"{self.namespace}/{name}" in self.topics

    @property
    def start(self) -> int:
        """Wall clock of the first turn, Unix ns."""
        return self.turns[0].wall

    def seconds(self, wall: int) -> float:
        """From the start to this moment (Unix ns), by the monotonic clock of the nearest turn: a
        wall clock that is set in flight moves nothing."""
        walls, passed = self._passed
        at = bisect.bisect_left(walls, wall)
        around = range(max(0, at - 1), min(at + 1, len(walls)))
        near = min(around, key=lambda n: abs(walls[n] - wall))
        return passed[near] + (wall - walls[near]) / 1e9

    @cached_property
    def _passed(self) -> tuple[list[int], list[float]]:
        """The wall clock of each turn, rising, and what had passed since the first, s."""
        passed, last = [(self.start, 0.0)], self.turns[0]
        for one in self.turns[1:]:
            step = one.turn.now - last.turn.now
            if one.number != last.number + 1 or step < 0.0:
                # Another start, perhaps of the host: its monotonic clock is another.
                step = max(0.0, (one.wall - last.wall) / 1e9)
            passed.append((one.wall, passed[-1][1] + step))
            last = one
        passed.sort()
        return [wall for wall, _ in passed], [seconds for _, seconds in passed]


#: Number of the first turn that a supervisor records.
_FIRST_TURN = 2


@dataclass(frozen=True)
class Beginning:
    """Where a replay of a file can begin: the vehicle's namespace, and the first turn with a
    state."""

    namespace: str
    turn: RecordedTurn

    def is_start_after(self, former: Beginning) -> bool:
        """Whether the supervisor has started since former, of an earlier file of its."""
        if self.turn.number <= max(_FIRST_TURN, former.turn.number):
            return True
        state, before = self.turn.state, former.turn.state
        assert state is not None
        assert before is not None
        # Its very first turns may be lost. A takeover changes only the epoch, a reset the time.
        return state.epoch != before.epoch and state.started_at != before.started_at


def utc(wall: int) -> str:
    """A wall clock (Unix ns) as date and time."""
    when = datetime.datetime.fromtimestamp(wall / 1e9, datetime.timezone.utc)
    return f"{when:%Y-%m-%d %H:%M:%S}"


def files_of(paths: Iterable[Path]) -> list[Path]:
    """The files themselves; a folder stands for all files in it, in their order."""
    files: list[Path] = []
    for path in paths:
        files += sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    if not files:
        raise RecordError(f"{', '.join(map(str, paths))}: there is no .mcap file in it")
    return files


def read(files: Iterable[Path], kinds: Mapping[str, Any]) -> Recording:
    """The turns, and the messages of these topics (relative name -> class), of files in their
    order; RecordError if there is nothing that could be replayed."""
    recording = Recording()
    for path in files:
        _Reader(recording, path, {RECORD: SupervisorRecord, **kinds}).read()
    if not recording.turns:
        told = "; ".join(recording.remarks) or "no turn of a supervisor is in it"
        raise RecordError(f"{', '.join(map(str, files))}: {told}")
    starts = 1 + sum(b.number <= a.number for a, b in itertools.pairwise(recording.turns))
    if starts > 1:
        recording.remarks.append(f"{starts} starts of the supervisor are in it")
    return recording


def beginning(path: Path) -> Beginning | None:
    """The beginning of a file, read no further; None: there is none in it. RecordError as read."""
    into = Recording()
    reader = _Reader(into, path, {RECORD: SupervisorRecord})
    turns = (reader.turn(entry) for entry in McapEntries(path) if reader.name(entry) == RECORD)
    first = next((one for one in turns if one.state is not None), None)
    return None if first is None else Beginning(into.namespace, first)


class _Reader:
    """Adds one file to a recording."""

    def __init__(self, recording: Recording, path: Path, kinds: Mapping[str, Any]) -> None:
        self._into, self._path, self._kinds = recording, path, kinds
        #: Id of a channel -> relative name of its topic; empty: not asked for, or not readable.
        self._names: dict[int, str] = {}

    def read(self) -> None:
        entries = McapEntries(self._path)
        size = self._path.stat().st_size if self._path.exists() else 0
        progress = Progress(f"reading {self._path.name}", size)
        for entry in entries:
            progress.at(entries.position)
            name = self.name(entry)
            if name == RECORD:
                self._into.turns.append(self.turn(entry))
            elif name:
                message = self._message(entry, self._kinds[name])
                self._into.messages.setdefault(name, []).append((entry.time, message))
        self._into.remarks += entries.remarks
        self._into.topics |= entries.topics

    def name(self, entry: Entry) -> str:
        """The relative name of its topic; empty: not asked for, or not readable."""
        if entry.channel.id not in self._names:
            self._names[entry.channel.id] = self._name(entry)
        return self._names[entry.channel.id]

    def _name(self, entry: Entry) -> str:
        """What the topic of a channel is called here."""
        topic = entry.channel.topic
        for name, kind in self._kinds.items():
            if not topic.endswith(f"/{name.lstrip('/')}"):
                continue
            known = entry.channel.metadata.get("topic_type_hash", "")
            if entry.schema.name == type_name(kind) and known in ("", type_hash(kind)):
                if name == RECORD:
                    self._into.namespace = topic.removesuffix(f"/{name}")
                return name
            text = f"{self._path}: {topic} was written by another version of chute_msgs"
            if name == RECORD:
                raise RecordError(f"{text}: read it with that one")
            self._into.remarks.append(f"{text}: left out")
        return ""

    def _message(self, entry: Entry, kind: Any) -> Any:
        """What was published."""
        try:
            return deserialize_message(entry.data, kind)
        except Exception as error:  # noqa: BLE001
            if isinstance(error.__cause__, KeyboardInterrupt):
                # Ctrl-C in the middle of it: to the middleware one more failure of its own.
                raise error.__cause__ from None
            # The middleware says what it likes of bytes that are no message, by its own classes.
            topic = entry.channel.topic
            told = f"{self._path}: message {entry.number} of {topic} cannot be read"
            raise RecordError(f"{told}: {error}") from None

    def turn(self, entry: Entry) -> RecordedTurn:
        """The core's turn in it."""
        message = self._message(entry, SupervisorRecord)
        try:
            turn = CoreTurn(
                message.monotonic,
                tuple(CODEC.from_json(one, i.Input) for one in message.inputs),
                tuple(CODEC.from_json(one, i.Output) for one in message.outputs),
            )
            config = message.config and CODEC.from_json(message.config, SupervisorConfig)
            state = message.state and CODEC.from_json(message.state, State)
        except RecordError as error:
            raise RecordError(f"{self._path}: turn {entry.number} {error}") from None
        return RecordedTurn(entry.time, entry.number, turn, config or None, state or None)
