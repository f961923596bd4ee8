"""Tables of numbers (.csv) of a rocket's flight, as an altimeter wrote them.

A heading is found by its name, or given: height="Altitude (ft)*0.3048". Without a vertical speed
the heights tell it.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
import statistics
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.tools.judge_log import told
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError, MessageLog
from chute_ros.tools.judge_log.stamps import steady
from chute_ros.transport.regular_file import open_regular

FORMAT = "table"
#: What a column can be, and the headings (without case, signs, unit and _BESIDES) by which it is
#: found, the best first.
COLUMNS: dict[str, tuple[str, ...]] = {
    "time": ("time", "t", "ts", "flighttime", "timestamp", "elapsedtime", "met"),
    "height": ("height", "altitude", "alt", "z"),
    "vertical_speed": ("verticalspeed", "verticalvelocity", "speed", "velocity", "vz", "v"),
    "pressure": ("pressure",),
}
#: Words of headings that say how or where, and not what.
_BESIDES = frozenset({"agl", "filtered", "baro", "barometer", "kalman", "aprox", "est", "raw"})
#: Units in headings, of each column: how many of ours one is.
_UNITS: dict[str, dict[str, float]] = {
    "time": {**dict.fromkeys(("", "s", "sec", "seconds"), 1.0), "ms": 1e-3, "us": 1e-6},
    "height": {"": 1.0, "m": 1.0, "km": 1e3, "ft": 0.3048, "feet": 0.3048},
    "vertical_speed": {
        **dict.fromkeys(("", "m/s", "mps"), 1.0),
        **dict.fromkeys(("fps", "ft/s", "ft/sec"), 0.3048),
        "mph": 0.44704,
        "km/h": 1 / 3.6,
    },
    "pressure": {
        **dict.fromkeys(("", "pa", "pascals"), 1.0),
        **dict.fromkeys(("hpa", "mbar"), 100.0),
        "kpa": 1e3,
    },
}
_HEADING = re.compile(r"([^(\[]*)(?:[(\[]([^)\]]*))?")
_GIVEN = re.compile(r"(\w+)=(.+?)(?:\*([-+.\deE]+))?$")
#: A speed by the heights of so long, s.
_SLOPE = 0.5
#: Most rows of a flight come sooner, s: by times without a unit, which may be milliseconds, and by
#: times that are said to be seconds.
_FURTHEST_APART, _FURTHEST_SECONDS = 6.0, 60.0


@dataclass(frozen=True)
class Column:
    """heading: as it stands in the file; factor: to SI units."""

    heading: str
    factor: float = 1.0


def column(text: str) -> tuple[str, Column]:
    """NAME=HEADING or NAME=HEADING*FACTOR; ValueError in words."""
    match = _GIVEN.match(text)
    if match is None or match[1] not in COLUMNS:
        raise ValueError(f"{text}: need NAME=HEADING[*FACTOR] with one of {', '.join(COLUMNS)}")
    factor = float(match[3]) if match[3] else 1.0
    if not math.isfinite(factor) or not factor:
        raise ValueError(f"{text}: the factor is not a number other than 0")
    return match[1], Column(match[2].strip(), factor)


def read(path: Path, given: Mapping[str, Column]) -> FlightLog:
    """The flight in this file; LogError if it has none."""
    try:
        with open_regular(path) as file:
            text = file.read().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise LogError(f"{path}: {error.strerror or error}") from None
    dialect_of = ";" if text[:4000].count(";") > text[:4000].count(",") else ","
    try:
        rows = [row for row in csv.reader(text.splitlines(), delimiter=dialect_of) if row]
    except csv.Error as error:
        raise LogError(f"{path}: no table: {error}") from None
    begin, places = _places(path, rows, given)
    values, bad = [], 0
    for row in rows[begin:]:
        one = {name: _number(row, place, factor) for name, (place, factor) in places.items()}
        if math.isfinite(one["time"]) and math.isfinite(one["height"]):
            values.append(one)
        else:
            bad += 1
    headings = rows[begin - 1]
    used = ", ".join(f"{name} from {headings[at].strip()!r}" for name, (at, _) in places.items())
    if len(values) < 2:
        raise LogError(
            f"{path}: no flight: of {len(rows) - begin} rows {len(values)} have a number for time "
            f"and height ({used}): name others by --column"
        )
    unknown_unit = "time" not in given and not _split(headings[places["time"][0]], "time")[1]
    furthest = _FURTHEST_APART if unknown_unit else _FURTHEST_SECONDS
    _check_times(path, [one["time"] for one in values], headings[places["time"][0]], furthest)
    remarks = [f"{bad} rows without a time or a height were left out"] if bad else []
    messages = _told(values, remarks)
    return FlightLog(
        path,
        FORMAT,
        dialect.MAV_TYPE_ROCKET,
        dialect.MAV_AUTOPILOT_GENERIC,
        messages,
        remarks=[*remarks, used],
    )


def _check_times(path: Path, times: Sequence[float], heading: str, furthest: float) -> None:
    """LogError: in seconds they cannot be."""
    apart = statistics.median(b - a for a, b in itertools.pairwise(times))
    if apart < 0.0:
        raise LogError(f"{path}: its rows are not in the order of time, by {heading.strip()!r}")
    if apart > furthest:
        raise LogError(
            f"{path}: its rows are {apart:.3g} s apart: if {heading.strip()!r} is in other units, "
            f"--column 'time={heading.strip()}*FACTOR' makes seconds of it"
        )


def _places(
    path: Path, rows: Sequence[Sequence[str]], given: Mapping[str, Column]
) -> tuple[int, dict[str, tuple[int, float]]]:
    """The first row of numbers; name -> its column and factor."""
    headings: list[str] = []
    for number, row in enumerate(rows):
        found = _found(row, given)
        if {"time", "height", *given} <= found.keys():
            return number + 1, found
        headings = headings or [one.strip() for one in row]
    missing = [f"{one.heading!r} (for {name})" for name, one in given.items()]
    told_of = f" (given: {', '.join(missing)})" if missing else ""
    raise LogError(
        f"{path}: no column for time and height{told_of}; its first line has "
        f"{', '.join(headings[:12]) or 'nothing'}: name them by --column time=HEADING "
        "--column height=HEADING*FACTOR"
    )


def _found(row: Sequence[str], given: Mapping[str, Column]) -> dict[str, tuple[int, float]]:
    places: dict[str, tuple[int, float]] = {}
    cells = [cell.strip().lstrip("#").strip() for cell in row]
    for name, one in given.items():
        if one.heading in cells:
            places[name] = (cells.index(one.heading), one.factor)
    for name, known in COLUMNS.items():
        if name in given:
            continue  # what it is called was said
        parsed = [_meaning(cell, name) for cell in cells]
        for place in (parsed.index(one) for one in known if one in parsed):
            places.setdefault(name, (place, _factor(cells[place], name)))
    return places


def _split(cell: str, name: str) -> tuple[list[str], str]:
    """The words of a heading, and its unit; a unit that is not one of this column is a word."""
    units = _UNITS[name]
    match = _HEADING.match(cell.lower())
    words = re.findall(r"[a-z]+", match[1] if match else "")
    unit = (match[2] or "").strip() if match else ""
    if unit not in units:
        # As in "Ft-AGL".
        parts = [one for one in re.split(r"[\s_-]+", unit) if one not in _BESIDES]
        if len(parts) != 1 or parts[0] not in units:
            return [*words, unit], ""
        unit = parts[0]
    if not unit and len(words) > 1 and words[-1] in units:
        unit = words.pop()
    return words, unit


def _meaning(cell: str, name: str) -> str:
    return "".join(one for one in _split(cell, name)[0] if one not in _BESIDES)


def _factor(cell: str, name: str) -> float:
    return _UNITS[name][_split(cell, name)[1]]


def _told(values: Sequence[Mapping[str, float]], remarks: list[str]) -> list[tuple[float, object]]:
    out = MessageLog()
    ground = values[0]["height"]
    beat = told.heartbeat(dialect.MAV_TYPE_ROCKET, dialect.MAV_AUTOPILOT_GENERIC, True)
    beat_at = -math.inf
    before: deque[tuple[float, float]] = deque()
    for at, one in steady(((one["time"], one) for one in values), remarks):
        height = one["height"] - ground
        before.append((at, height))
        while before[0][0] < at - _SLOPE and len(before) > 1:
            before.popleft()
        speed = one.get("vertical_speed", math.nan)
        span = at - before[0][0]
        if math.isnan(speed) and span > 0.0:
            speed = (height - before[0][1]) / span
        if at - beat_at >= 1.0:
            beat_at = at
            out.add_change(at, beat)
        out.add(
            at, told.position(height, speed if math.isfinite(speed) else 0.0, *(math.nan,) * 3)
        )
        if math.isfinite(one.get("pressure", math.nan)):
            out.add(at, told.pressure(one["pressure"]))
    return out.in_order()


def _number(row: Sequence[str], place: int, factor: float) -> float:
    try:
        return float(row[place]) * factor
    except (ValueError, IndexError):
        return math.nan
