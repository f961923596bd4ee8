"""Which reader a file needs: by its first bytes, and its name where they do not tell."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from chute_ros.tools.judge_log import bag, dataflash, table, telemetry, ulog
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError
from chute_ros.transport.regular_file import open_regular

_HEAD = 4096
KNOWN = "ArduPilot's .bin and .log, .tlog, PX4's .ulg, .bag, .mcap, .db3 or a rosbag2 folder, .csv"
_MCAP = b"\x89MCAP0"
#: How SQLite and ROS 1's bags begin.
_BAGS = (b"SQLite format 3\0", b"#ROSBAG V")
#: Where the first bytes do not tell.
_BY_SUFFIX = {
    ".bin": dataflash.read,
    ".log": dataflash.read,
    ".tlog": telemetry.read,
    ".mcap": bag.read_mcap,
}


def read(path: Path, columns: Mapping[str, table.Column]) -> FlightLog:
    """The log in this file, of whatever format; LogError if it is of none, or damaged."""
    if path.is_dir():
        return bag.read(path)
    try:
        with open_regular(path) as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror or error}") from None
    if not head:
        raise LogError(f"{path}: it is empty")
    if head.startswith(ulog.MAGIC):
        return ulog.read(path)
    if head.startswith(_MCAP):
        return bag.read_mcap(path)
    if head.startswith(_BAGS):
        return bag.read(path)
    if head.startswith((dataflash.MAGIC, b"FMT,")) or b"\nFMT," in head:
        return dataflash.read(path)
    if path.suffix.lower() == ".csv":
        return table.read(path, columns)
    if by_suffix := _BY_SUFFIX.get(path.suffix.lower()):
        return by_suffix(path)
    if telemetry.looks_so(head):
        return telemetry.read(path)
    raise LogError(f"{path}: no log of a known format ({KNOWN})")
