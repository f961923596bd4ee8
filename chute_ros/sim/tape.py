"""Tapes: what a vehicle did in other people's physics, from before its failure to the ground.

A file begins with MAGIC. Then, for each tape, a line of JSON (its Label, the names of its columns,
its number of rows, the bytes that follow) and its columns, compressed by zlib: one after another,
each as the differences of its values in its own grain (GRAINS), int16, little-endian, from 0 on.
`make tapes` writes them; nothing here needs the physics.
"""

from __future__ import annotations

import json
import math
import struct
import sys
import zlib
from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from itertools import accumulate
from pathlib import Path
from typing import Any

from chute_ros.errors import RecordError
from chute_ros.transport.regular_file import open_regular

MAGIC = b"chute tapes 1\n"
#: Between two rows, s.
STEP = 0.02
#: Column -> its grain. height: m above take-off; vertical_speed: m/s, up; roll, pitch, yaw: rad,
#: as MAVLink's ATTITUDE; force: length of the specific force, m/s^2; ground_speed: m/s;
#: commanded_thrust: 0 to 1.
GRAINS = {
    "height": 0.02,
    "vertical_speed": 0.01,
    "roll": 0.001,
    "pitch": 0.001,
    "yaw": 0.001,
    "force": 0.02,
    "ground_speed": 0.05,
    "commanded_roll": 0.001,
    "commanded_pitch": 0.001,
    "commanded_yaw": 0.001,
    "commanded_height": 0.02,
    "commanded_vertical_speed": 0.01,
    "commanded_thrust": 0.01,
}
#: The largest tape that is read: ten minutes.
_MOST_ROWS = 30_000


@dataclass(frozen=True)
class Label:
    """What a tape is. Times: s after its first row; NaN: it never was so.

    body: the physics, with its version; profile: as the supervisor's; failed: in words; failed_at:
    from when on; lost_at: since when it is out of control, if it ever sinks faster than a soft
    landing or lies over; shows_at: when both its attitude and its sink, or its sink alone, first
    tell that; ends_hard: so it touches down; level: it sinks with about the attitude and the force
    of one that flies; fall_speed: m/s without motors in the end; parameters: whatever else was
    drawn.
    """

    name: str
    body: str
    profile: str
    failed: str
    failed_at: float = math.nan
    lost_at: float = math.nan
    shows_at: float = math.nan
    ends_hard: bool = False
    level: bool = False
    fall_speed: float = 25.0
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @property
    def end(self) -> str:
        """What becomes of it, in words."""
        if self.ends_hard:
            return "lost, comes down hard"
        return (
            "flies" if math.isnan(self.lost_at) else "lost, softly down or in the air at the end"
        )


@dataclass(frozen=True, eq=False)
class Tape:
    """rows: its number of rows; columns: their names, in the order of packed."""

    label: Label
    rows: int
    columns: tuple[str, ...]
    packed: bytes

    @property
    def lasts(self) -> float:
        """s."""
        return (self.rows - 1) * STEP

    def unpack(self) -> dict[str, array[float]]:
        """Column -> its values. RecordError: they are not what the label says."""
        size = 2 * self.rows * len(self.columns)
        try:
            # Never more than was announced, whatever it was that was packed.
            raw = zlib.decompressobj().decompress(self.packed, size + 1)
        except zlib.error as error:
            raise RecordError(f"tape {self.label.name}: {error}") from None
        if len(raw) != size:
            raise RecordError(f"tape {self.label.name}: {len(raw)} bytes unpacked, need {size}")
        values = {}
        for number, name in enumerate(self.columns):
            part = raw[2 * self.rows * number : 2 * self.rows * (number + 1)]
            values[name] = _undone(part, GRAINS[name])
        return values


def read_tapes(path: Path) -> list[Tape]:
    """All of a file. RecordError, with its name: it has none, or is damaged."""
    try:
        with open_regular(path) as file:
            data = file.read()
    except OSError as error:
        raise RecordError(f"{path}: {error.strerror or error}") from None
    if not data.startswith(MAGIC):
        raise RecordError(f"{path}: no file of tapes: it does not begin with {MAGIC!r}")
    tapes: list[Tape] = []
    at = len(MAGIC)
    while at < len(data):
        end = data.find(b"\n", at)
        try:
            tape, size = _tape_of(data[at : end if end >= 0 else None])
        except (KeyError, TypeError, ValueError) as error:
            what = f"tape {len(tapes) + 1}: {type(error).__name__}: {error}"
            raise RecordError(f"{path}: {what}") from None
        packed = data[end + 1 : end + 1 + size]
        if end < 0 or len(packed) < size:
            raise RecordError(f"{path}: tape {len(tapes) + 1} is cut off")
        tapes.append(Tape(tape.label, tape.rows, tape.columns, packed))
        at = end + 1 + size
    if not tapes:
        raise RecordError(f"{path}: no tape in it")
    return tapes


def written(tape: Tape) -> bytes:
    """As it stands in a file."""
    values = {one.name: getattr(tape.label, one.name) for one in fields(Label)}
    # JSON has no word for what never was.
    told = {name: None if value != value else value for name, value in values.items()}
    head = {**told, "columns": tape.columns, "rows": tape.rows, "bytes": len(tape.packed)}
    return json.dumps(head).encode() + b"\n" + tape.packed


def pack(columns: Mapping[str, Iterable[float]]) -> bytes:
    """Columns of one length, as Tape.packed. ValueError: a value is not finite, or changes by more
    than a difference can hold."""
    parts = []
    for name, values in columns.items():
        grain, before, differences = GRAINS[name], 0, array("h")
        for value in values:
            grains = round(value / grain)
            if abs(grains - before) > 32_767:
                raise ValueError(f"{name} changes by {(grains - before) * grain:g} in one step")
            differences.append(grains - before)
            before = grains
        parts.append(_little(differences).tobytes())
    return zlib.compress(b"".join(parts), 9)


def _tape_of(line: bytes) -> tuple[Tape, int]:
    """Without its columns, and their size in bytes."""
    head = json.loads(line)
    rows, size, columns = head.pop("rows"), head.pop("bytes"), tuple(head.pop("columns"))
    for name, number in (("rows", rows), ("bytes", size)):
        if not isinstance(number, int) or not 0 < number <= _MOST_ROWS * 2 * len(GRAINS):
            raise ValueError(f"{name} {number!r}")
    if rows > _MOST_ROWS:
        raise ValueError(f"rows {rows}: need {_MOST_ROWS} at most")
    for name in columns:
        if name not in GRAINS:
            raise ValueError(f"column {name!r}")
    for name in ("height", "vertical_speed", "roll", "pitch", "yaw", "force", "ground_speed"):
        if name not in columns:
            raise ValueError(f"no column {name!r}")
    for name in ("failed_at", "lost_at", "shows_at"):
        head[name] = math.nan if head[name] is None else float(head[name])
    return Tape(Label(**head), rows, columns, b""), size


def _undone(part: bytes, grain: float) -> array[float]:
    differences = array("h", struct.unpack(f"<{len(part) // 2}h", part))
    return array("d", (one * grain for one in accumulate(differences)))


def _little(values: array[int]) -> array[int]:
    if sys.byteorder == "big":
        values.byteswap()
    return values
