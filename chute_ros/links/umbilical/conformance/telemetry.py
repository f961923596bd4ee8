"""$TELEM: how its lines come, and each of their fields."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from statistics import median
from typing import Any

from chute_ros.conformance.clause import READS, Trial, failed, not_tried
from chute_ros.links.umbilical.conformance.bench import (
    BOOT,
    PAUSE,
    ReceivedLine,
    UmbilicalBench,
)
from chute_ros.links.umbilical.conformance.document import TELEMETRY, UmbilicalClause, of

#: So long the device is looked at, s.
_WATCHED = 8.0
#: A clock may be off by this share.
_CLOCK = 0.05
#: So many fields are told of a clause that passes.
_TOLD = 4
_DAY, _HALF_DAY = 86_400.0, 43_200.0
#: What a field can hold beyond its type, on a bench.
_RANGES: Mapping[str, tuple[float, float]] = {
    "flight_mode": (0, 6),
    "pressure": (30_000.0, 120_000.0),
    "temp": (-60.0, 100.0),
    "altitude": (-1000.0, 10_000.0),
    "latitude": (-90.0, 90.0),
    "longitude": (-180.0, 180.0),
    "timestamp": (0.0, _DAY),
    "ssa_drogue_deployed": (0, 1),
    "ssa_main_deployed": (0, 1),
    **{f"cmd_{one}": (0, 1) for one in ("n1", "n2", "n3", "n4", "a1", "a2", "a3")},
    "airbrake_state": (0, 2),
    "fix_type": (0, 5),
    "head_mot": (-36_000_000, 36_000_000),
    "blims_wind_from_deg": (-360.0, 360.0),
}
#: At rest an accelerometer measures gravity, 9.8 m/s².
_GRAVITY = (7.0, 13.0)
#: A field of the earth that is weaker is none, µT.
_WEAKEST = 5.0


def _listened(bench: UmbilicalBench) -> Any:
    """A while of listening (ReceivedLines), which is the same for all clauses."""
    if "listened" not in bench.kept:
        yield from bench.watch_as("listened", _WATCHED)
    bench.look_at(bench.kept["listened"].lines)
    return bench.kept["listened"]


def _continuous(bench: UmbilicalBench) -> Trial:
    watch = yield from _listened(bench)
    lines, longest = watch.telemetry, watch.longest_pause
    if longest > PAUSE:
        packets = [one.packet for one in lines]
        raise failed(f"it pauses for {longest:.1f} s (need at most {PAUSE:g})", packets)
    return f"{len(lines)} lines in {_WATCHED:g} s, the longest pause {longest:.2f} s"


def _line_end(bench: UmbilicalBench) -> Trial:
    for one in (yield from _listened(bench)).telemetry:
        if not one.whole:
            text = "other bytes stand before $TELEM: the line before it was cut, or has no end"
            raise failed(text, [one.packet])
    if bench.returns:
        raise failed("lines end with carriage return and newline", bench.returns[:1])
    return "each ends with a newline"


def _text(bench: UmbilicalBench) -> Trial:
    for one in (yield from _listened(bench)).lines:
        if not (one.data.isascii() and one.data.decode().isprintable()):
            raise failed("bytes come that are no text", [one.packet])
    return "text alone"


def _count(bench: UmbilicalBench) -> Trial:
    for one in (yield from _listened(bench)).telemetry:
        if len(one.texts) != bench.layout.count:
            told = f"{len(one.texts)} fields (need {bench.layout.count}: {bench.layout.name})"
            raise failed(f"{told}; --layout names another layout", [one.packet])
    return f"{bench.layout.count} fields"


def _fields(bench: UmbilicalBench, names: Sequence[str]) -> Any:
    """The $TELEM lines with as many fields as they must have, of which these are as they must."""
    wanted = [one for one in names if one in bench.layout.index]
    if not wanted:
        raise not_tried(f"{bench.layout.name} has no such field")
    every = (yield from _listened(bench)).telemetry
    lines = [one for one in every if one.values or one.problems]
    if not lines:
        raise not_tried(f"no line has {bench.layout.count} fields")
    for one in lines:
        for name in wanted:
            if name in one.problems:
                raise failed(one.problems[name], [one.packet])
            low, high = _RANGES.get(name, (-math.inf, math.inf))
            value = one.values[name]
            if value < low or value > high:
                text = f"{name} is {value:g} (need {low:g} to {high:g})"
                raise failed(text, [one.packet])
    return lines


def _told(bench: UmbilicalBench, line: ReceivedLine, names: Sequence[str]) -> str:
    """The first of these fields of a line, as they stand there."""
    index = bench.layout.index
    known = [f"{one} {line.texts[index[one]]:.20}" for one in names if one in index]
    return ", ".join(known[:_TOLD]) + (", ..." if len(known) > _TOLD else "")


def _at_rest(bench: UmbilicalBench, lines: Sequence[ReceivedLine]) -> None:
    for one in lines:
        force = math.hypot(*(one.values[f"accel_{axis}"] for axis in "xyz"))
        if force < _GRAVITY[0] or force > _GRAVITY[1]:
            text = f"at rest it measures {force:.2f} (need 9.8 m/s²)"
            raise failed(text, [one.packet])


def _of_the_earth(bench: UmbilicalBench, lines: Sequence[ReceivedLine]) -> None:
    """A magnetometer that is not there may report 0."""
    fields = [math.hypot(*(one.values[f"mag_{axis}"] for axis in "xyz")) for one in lines]
    if fields and 0.0 < (usual := median(fields)) < _WEAKEST:
        text = f"on the ground it measures {usual:.2f} (need µT: that of the earth is 25 to 65)"
        raise failed(text, [one.packet for one in lines[:1]])


def _of_the_day(bench: UmbilicalBench, lines: Sequence[ReceivedLine]) -> None:
    for earlier, later in pairwise(lines):
        before, after = earlier.values["timestamp"], later.values["timestamp"]
        if after < before < after + _HALF_DAY:  # over midnight it begins again
            both = [earlier.packet, later.packet]
            raise failed(f"timestamp went back from {before:g} to {after:g}", both)


def _since_boot(bench: UmbilicalBench, lines: Sequence[ReceivedLine]) -> None:
    for earlier, later in pairwise(lines):
        if later.values[BOOT] < earlier.values[BOOT]:
            text = f"{BOOT} went back from {earlier.values[BOOT]} to {later.values[BOOT]}"
            raise failed(text, [earlier.packet, later.packet])
    passed = lines[-1].at - lines[0].at
    went = (lines[-1].values[BOOT] - lines[0].values[BOOT]) / 1000.0
    if abs(went - passed) > _CLOCK * passed + 0.1:
        both = [lines[0].packet, lines[-1].packet]
        raise failed(f"in {passed:.2f} s {BOOT} went on by {went:.2f} s", both)


_tells = of(TELEMETRY)


def _field(
    name: str,
    text: str,
    *names: str,
    look: Callable[[UmbilicalBench, Sequence[ReceivedLine]], None] = lambda bench, lines: None,
) -> UmbilicalClause:
    """A clause of these fields. look: what they must be besides their type and range."""

    def trial(bench: UmbilicalBench) -> Trial:
        lines = yield from _fields(bench, names)
        look(bench, lines)
        return _told(bench, lines[-1], names)

    return _tells(name, text, trial, READS)


CLAUSES: tuple[UmbilicalClause, ...] = (
    _tells(
        "continuous",
        "$TELEM is emitted continuously (a pause of 3 s counts as a lost link)",
        _continuous,
        READS,
    ),
    _tells("line-end", "a line is $TELEM,... and ends with \\n", _line_end, READS),
    _tells("text", "it is sent as text, never as its binary packet", _text, READS),
    _tells("field-count", "a line has 57 fields (or those of --layout)", _count, READS),
    _field("flight-mode", "flight_mode is a u32, one of 0 to 6", "flight_mode"),
    _field("pressure", "pressure is an f32, in Pa", "pressure"),
    _field("temperature", "temp is an f32, in °C", "temp"),
    _field("altitude", "altitude is an f32, in m", "altitude"),
    _field("position", "latitude and longitude are f32, in degrees", "latitude", "longitude"),
    _field("satellites", "num_satellites is a u32", "num_satellites"),
    _field(
        "timestamp",
        "timestamp is an f32, a time of the day in s, and does not go back",
        "timestamp",
        look=_of_the_day,
    ),
    _field(
        "magnetometer",
        "mag_x, mag_y, mag_z are f32, in µT",
        *("mag_x", "mag_y", "mag_z"),
        look=_of_the_earth,
    ),
    _field(
        "accelerometer",
        "accel_x, accel_y, accel_z are f32, in m/s²",
        *("accel_x", "accel_y", "accel_z"),
        look=_at_rest,
    ),
    _field("gyroscope", "gyro_x, gyro_y, gyro_z are f32", "gyro_x", "gyro_y", "gyro_z"),
    _field("converters", "pt3, pt4, rtd are f32", "pt3", "pt4", "rtd"),
    _field("valve-flags", "sv_open and mav_open are 1 or 0", "sv_open", "mav_open"),
    _field(
        "canopy-flags",
        "ssa_drogue_deployed and ssa_main_deployed are u8, flags",
        *("ssa_drogue_deployed", "ssa_main_deployed"),
    ),
    _field(
        "payload-flags",
        "cmd_n1 to cmd_n4 and cmd_a1 to cmd_a3 are u8, flags",
        *("cmd_n1", "cmd_n2", "cmd_n3", "cmd_n4", "cmd_a1", "cmd_a2", "cmd_a3"),
    ),
    _field(
        "airbrake",
        "airbrake_state is a u8: 0 idle, 1 deployed, 2 retracted",
        *("airbrake_state", "airbrake_deployment"),
    ),
    _field("apogee", "predicted_apogee is an f32", "predicted_apogee"),
    _field("gps-accuracy", "h_acc and v_acc are u32", "h_acc", "v_acc"),
    _field("velocity", "vel_n, vel_e, vel_d are f64", "vel_n", "vel_e", "vel_d"),
    _field(
        "ground-speed",
        "g_speed is an f64, s_acc and head_acc are u32",
        *("g_speed", "s_acc", "head_acc"),
    ),
    _field("fix", "fix_type is a u8, head_mot an i32 of 1e-5 degrees", "fix_type", "head_mot"),
    _field(
        "blims-fields",
        "blims_phase_id and blims_loiter_step are i8, all others of BLiMS f32",
        *("blims_motor_position", "blims_brakeline_diff", "blims_phase_id", "blims_pid_p"),
        *("blims_pid_i", "blims_bearing", "blims_loiter_step", "blims_heading_des"),
        *("blims_heading_error", "blims_error_integral", "blims_dist_to_target_m"),
        *("blims_target_lat", "blims_target_lon", "blims_upwind_lat", "blims_upwind_lon"),
        *("blims_downwind_lat", "blims_downwind_lon"),
    ),
    _field("wind", "blims_wind_from_deg is an f32, in degrees", "blims_wind_from_deg"),
    _field(
        "boot-time",
        "ms_since_boot_cfc is a u32, goes on with the time and never back",
        BOOT,
        look=_since_boot,
    ),
)
