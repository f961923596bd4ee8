"""MAVLink telemetry logs (.tlog) as ground stations write them: eight bytes of time, one frame.

Source: QGroundControl's and Mission Planner's telemetry logs (microseconds since 1970, big
endian, before each frame). What is damaged is passed over, as on a link.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

from chute_ros.links.mavlink.protocol.autopilot import is_autopilot
from chute_ros.protocol.mavlink.frames import MAGIC_V1, MAGIC_V2, FrameDecoder
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError
from chute_ros.tools.judge_log.stamps import steady
from chute_ros.transport.regular_file import open_regular

FORMAT = "MAVLink telemetry"

_TIME = struct.Struct(">Q")
#: Bytes of a frame besides its payload, by its first byte; of a signature.
_AROUND = {MAGIC_V1: 8, MAGIC_V2: 12}
_SIGNATURE, _SIGNED = 13, 0x01
_US = 1e-6
#: Two frames, of which the dialect does not know the first, are at most so far apart, us.
_FURTHEST = 86_400 * 1_000_000


def looks_so(head: bytes) -> bool:
    """A file that begins so may be one."""
    return len(head) > _TIME.size and head[_TIME.size] in _AROUND


def read(path: Path) -> FlightLog:
    """The log of the first autopilot in this file; LogError if there is none."""
    try:
        with open_regular(path) as file:
            data = file.read()
    except OSError as error:
        raise LogError(f"{path}: {error.strerror or error}") from None
    every, passed = _frames(data)
    beats = [(source, one) for _, source, one in every if one.get_type() == "HEARTBEAT"]
    of_autopilots = [(source, one) for source, one in beats if is_autopilot(one)]
    if not of_autopilots:
        raise LogError(f"{path}: no telemetry log: no heartbeat of an autopilot is in it")
    who, beat = of_autopilots[0]
    own = [(at, one) for at, source, one in every if source == who]
    parameters: dict[str, float] = {}
    for _, message in own:
        if message.get_type() == "PARAM_VALUE":
            parameters[message.param_id] = message.param_value
    told_of = [(at * _US, one) for at, one in own if one.get_type() != "PARAM_VALUE"]
    remarks = [f"{passed} damaged bytes were passed over"] if passed else []
    others = sorted({source for source, _ in beats} - {who})
    rest = ", ".join(f"{system}/{component}" for system, component in others)
    if rest:
        remarks.append(f"of autopilot {who[0]}/{who[1]} alone; besides it are {rest}")
    messages = list(steady(told_of, remarks, boot_time=(_since_boot(one) for _, one in told_of)))
    messages = [(at - messages[0][0], one) for at, one in messages]
    return FlightLog(path, FORMAT, beat.type, beat.autopilot, messages, parameters, True, remarks)


def _frames(data: bytes) -> tuple[list[tuple[int, tuple[int, int], Any]], int]:
    """(us, (system, component), message) of each frame; how many bytes were none."""
    decoder = FrameDecoder()
    found: list[tuple[int, tuple[int, int], Any]] = []
    at, passed, end = 0, 0, len(data) - _TIME.size
    while at < end:
        size = _size(data, at + _TIME.size)
        (time,) = _TIME.unpack_from(data, at)
        frames = []
        if size:
            after = at + _TIME.size + size
            frames = decoder.feed_datagram(data[at + _TIME.size : after], 0.0)
            # Of a message that the dialect does not know the frame is whole all the same.
            size = size if frames or _goes_on(data, after, time) else 0
        if not size:
            at, passed = at + 1, passed + 1
            continue
        found += [(time, (one.system_id, one.component_id), one.message) for one in frames]
        at += _TIME.size + size
    return found, passed


def _goes_on(data: bytes, at: int, before: int) -> bool:
    """A frame begins here whose time is near that of the one before (us)."""
    if at + _TIME.size >= len(data) or data[at + _TIME.size] not in _AROUND:
        return False
    (time,) = _TIME.unpack_from(data, at)
    return bool(abs(time - before) < _FURTHEST)


def _since_boot(message: Any) -> float:
    """s by the autopilot's own clock; NaN: it does not tell."""
    return (getattr(message, "time_boot_ms", 0) or math.nan) * 1e-3


def _size(data: bytes, at: int) -> int:
    """Of the frame that begins here; 0: none does."""
    around = _AROUND.get(data[at], 0)
    if not around or at + around > len(data):
        return 0
    signed = data[at] == MAGIC_V2 and data[at + 2] & _SIGNED
    return around + data[at + 1] + (_SIGNATURE if signed else 0)
