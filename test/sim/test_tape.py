"""Tapes: written and read back; a damaged file is an error with its name, never a crash."""

from __future__ import annotations

import json
import math
import zlib
from pathlib import Path

import pytest

from chute_ros.errors import RecordError
from chute_ros.sim.tape import GRAINS, MAGIC, STEP, Label, Tape, pack, read_tapes, written

LABEL = Label(
    "one", "physics 1.0", "multirotor", "a rotor", 0.04, 0.04, 0.06, True, parameters={"kg": 4.0}
)


def tape(label: Label = LABEL, rows: int = 5) -> Tape:
    """It sinks from 400 m."""
    columns = {name: [3.0 - 1.5 * row for row in range(rows)] for name in GRAINS}
    columns["height"] = [400.0 - 3.0 * row for row in range(rows)]
    columns["yaw"] = [math.pi, -math.pi] * (rows // 2) + [0.0] * (rows % 2)
    return Tape(label, rows, tuple(columns), pack(columns))


def stored(folder: Path, data: bytes) -> Path:
    path = folder / "some.tapes"
    path.write_bytes(data)
    return path


def test_what_was_written_is_read_back_within_its_grain(tmp_path: Path) -> None:
    never = Label("two", "physics 1.0", "fixed_wing", "nothing")
    data = MAGIC + written(tape()) + written(tape(never, 7))
    one, two = read_tapes(stored(tmp_path, data))
    assert one.label == LABEL
    assert (one.lasts, two.lasts) == (4 * STEP, 6 * STEP)
    assert math.isnan(two.label.failed_at)
    assert math.isnan(two.label.lost_at)
    values = two.unpack()
    assert list(values) == list(GRAINS)
    told = [400.0 - 3.0 * row for row in range(7)]
    assert list(values["height"]) == pytest.approx(told, abs=GRAINS["height"])
    assert list(values["yaw"])[:2] == pytest.approx([math.pi, -math.pi], abs=GRAINS["yaw"])


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_no_number_is_not_packed(value: float) -> None:
    with pytest.raises((ValueError, OverflowError)):
        pack({"height": [1.0, value]})


def test_what_changes_by_more_than_a_difference_holds_is_not_packed() -> None:
    with pytest.raises(ValueError, match=r"height changes by 700 in one step"):
        pack({"height": [1.0, 701.0]})


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    nowhere = tmp_path / "nowhere"
    with pytest.raises(RecordError, match=r"nowhere: No such file"):
        read_tapes(nowhere)
    for data in (b"", b"chute", b"{}\n", bytes(range(256))):
        with pytest.raises(RecordError, match=r"some\.tapes: no file of tapes"):
            read_tapes(stored(tmp_path, data))
    with pytest.raises(RecordError, match=r"some\.tapes: no tape in it"):
        read_tapes(stored(tmp_path, MAGIC))


def test_a_file_that_was_cut_off_anywhere_is_named(tmp_path: Path) -> None:
    data = MAGIC + written(tape())
    for end in range(len(MAGIC) + 1, len(data)):
        with pytest.raises(RecordError, match=r"some\.tapes: tape 1"):
            read_tapes(stored(tmp_path, data[:end]))


@pytest.mark.parametrize(
    "change",
    [
        {"rows": -1},
        {"rows": "many"},
        {"rows": 30_001},
        {"bytes": 0},
        {"bytes": 10**9},
        {"columns": ["height", "colour"]},
        {"columns": ["height"]},
        {"columns": 5},
        {"failed_at": "late"},
        {"unheard_of": 1},
        {"rows": None},
    ],
    ids=str,
)
def test_a_label_that_cannot_be_is_named(change: dict[str, object], tmp_path: Path) -> None:
    head, _, packed = written(tape()).partition(b"\n")
    told = json.dumps({**json.loads(head), **change}).encode()
    with pytest.raises(RecordError, match=r"some\.tapes: tape 1: "):
        read_tapes(stored(tmp_path, MAGIC + told + b"\n" + packed))


def test_no_more_is_unpacked_than_was_announced() -> None:
    bomb = Tape(LABEL, 5, ("height",), zlib.compress(bytes(10**7)))
    with pytest.raises(RecordError, match=r"tape one: 11 bytes unpacked, need 10"):
        bomb.unpack()
    with pytest.raises(RecordError, match=r"tape one: 2 bytes unpacked, need 10"):
        Tape(LABEL, 5, ("height",), zlib.compress(bytes(2))).unpack()
    with pytest.raises(RecordError, match=r"tape one: Error"):
        Tape(LABEL, 5, ("height",), b"no zlib").unpack()
