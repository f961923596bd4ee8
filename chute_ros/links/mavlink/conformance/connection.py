"""Who the device says that it is, and what can be asked of it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from chute_ros.conformance.clause import READS, Trial, failed, not_supported, not_tried
from chute_ros.links.mavlink.conformance.bench import (
    MavlinkBench,
    ReceivedFrame,
    entry_name,
    refused,
    result_of,
)
from chute_ros.links.mavlink.conformance.document import HEARTBEAT, PARACHUTE, of
from chute_ros.links.mavlink.protocol.parachute import component_information
from chute_ros.protocol.mavlink.dialect import dialect

#: So long the device is looked at, s: some periods of 1 Hz.
WATCHED = 8.0
#: A period of nominally 1 s is in this range, s.
_SHORTEST, _LONGEST = 0.5, 2.0
#: 2009-01-01, s since 1970: no MAVLink device is older.
_FIRST_DATE = 1_230_768_000
#: Two of its messages are asked for so far apart; its clock may be off by this much, s.
_APART, _CLOCK = 2.0, 0.3
#: A message that no parachute has.
FOREIGN_MESSAGE = dialect.MAVLINK_MSG_ID_ATTITUDE


def _heartbeat_rate(bench: MavlinkBench) -> Trial:
    yield from bench.watch(WATCHED)
    return nominal(bench, "HEARTBEAT")


def nominal(bench: MavlinkBench, kind: str) -> str:
    """Of what was watched this comes at nominally 1 Hz."""
    times = [one.at for one in bench.watched if one.kind == kind]
    if len(times) < 2:
        raise failed(f"{len(times)} {kind} in {WATCHED:g} s", bench.packets(kind))
    gaps = [later - earlier for earlier, later in pairwise(times)]
    mean = (times[-1] - times[0]) / len(gaps)
    told = f"each {mean:.2f} s, the longest pause {max(gaps):.2f} s"
    if max(gaps) > _LONGEST or mean < _SHORTEST:
        raise failed(f"{told} (nominally 1 s: {_SHORTEST:g} to {_LONGEST:g})", bench.packets(kind))
    return told


def _heartbeat_type(bench: MavlinkBench) -> Trial:
    beats = yield from bench.watch_once(WATCHED, "HEARTBEAT")
    kinds = {one.message.type for one in beats}
    if kinds != {dialect.MAV_TYPE_PARACHUTE}:
        names = [entry_name("MAV_TYPE", kind) for kind in sorted(kinds)]
        told = ", ".join(names) or "no heartbeat"
        raise failed(f"type is {told}", bench.packets("HEARTBEAT"))
    return "MAV_TYPE_PARACHUTE"


def _heartbeat_fields(bench: MavlinkBench) -> Trial:
    beats = yield from bench.watch_once(WATCHED, "HEARTBEAT")
    if not beats:
        raise not_tried("no HEARTBEAT came")
    for one in beats:
        wrong = []
        if one.message.autopilot != dialect.MAV_AUTOPILOT_INVALID:
            wrong.append(f"autopilot is {one.message.autopilot} (need MAV_AUTOPILOT_INVALID, 8)")
        if one.message.mavlink_version != 3:
            wrong.append(f"mavlink_version is {one.message.mavlink_version} (need 3)")
        if one.message.system_status not in dialect.enums["MAV_STATE"]:
            wrong.append(f"system_status is {one.message.system_status}, which is no MAV_STATE")
        if wrong:
            raise failed("; ".join(wrong), [one.packet])
    return "autopilot INVALID, mavlink_version 3, a known system_status"


def _component_id(bench: MavlinkBench) -> Trial:
    yield from ()
    bench.look_at(bench.heard[-1:])
    if bench.component in (0, dialect.MAV_COMP_ID_AUTOPILOT1):
        raise failed(f"its component id is {bench.component}, which is not its own")
    if bench.component != dialect.MAV_COMP_ID_PARACHUTE:
        return f"{bench.component}: allowed, the default is 161 (MAV_COMP_ID_PARACHUTE)"
    return "161, MAV_COMP_ID_PARACHUTE"


def _request_status(bench: MavlinkBench) -> Trial:
    return (yield from _requested(bench, dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS, True))


def _request_information(bench: MavlinkBench) -> Trial:
    kind = dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC
    return (yield from _requested(bench, kind, False))


def _requested(bench: MavlinkBench, message_id: int, required: bool) -> Trial:
    """It comes at once when it is asked for, however it is streamed."""
    name = dialect.mavlink_map[message_id].msgname
    for _ in range(3):
        since = len(bench.heard)
        answer = yield from bench.command(dialect.MAV_CMD_REQUEST_MESSAGE, message_id)
        if answer is None:
            raise failed("the request is not answered")
        if answer.message.result != dialect.MAV_RESULT_ACCEPTED:
            if required:
                raise failed(f"the request is answered with {result_of(answer)}")
            raise not_supported(f"the request is answered with {result_of(answer)}")
        came = any(one.kind == name for one in bench.heard[since:])
        if not came and (yield from bench.wait_for(name, 0.4)) is None:
            raise failed(f"accepted, but no {name} came within 0.4 s")
    return "accepted, and it comes"


def _information(bench: MavlinkBench) -> Any:
    """Its last COMPONENT_INFORMATION_BASIC (ReceivedFrame)."""
    kind = dialect.MAVLINK_MSG_ID_COMPONENT_INFORMATION_BASIC
    yield from bench.command(dialect.MAV_CMD_REQUEST_MESSAGE, kind)
    yield from bench.wait_for("COMPONENT_INFORMATION_BASIC", 0.4)
    told = [one for one in bench.heard if one.kind == "COMPONENT_INFORMATION_BASIC"]
    if not told:
        raise not_supported("it sends no COMPONENT_INFORMATION_BASIC")
    bench.look_at(told[-1:])
    return told[-1]


def _require_readable(told: ReceivedFrame, *fields: str) -> None:
    for field in fields:
        text = getattr(told.message, field)
        if not str(text).isprintable():
            raise failed(f"{field} is {text!r}: need text that can be read", [told.packet])


def _information_texts(bench: MavlinkBench) -> Trial:
    told = yield from _information(bench)
    _require_readable(told, "vendor_name", "model_name", "software_version", "hardware_version")
    message = told.message
    if not message.vendor_name or not message.model_name:
        raise failed("vendor_name and model_name are empty", [told.packet])
    return f"{message.vendor_name}, {message.model_name}, software {message.software_version}"


def _information_serial(bench: MavlinkBench) -> Trial:
    told = yield from _information(bench)
    _require_readable(told, "serial_number")
    return told.message.serial_number or "not provided"


def _information_date(bench: MavlinkBench) -> Trial:
    told = yield from _information(bench)
    date = component_information(told.message).manufacture_date
    if 0 < told.message.time_manufacture_s < _FIRST_DATE:
        raise failed(f"time_manufacture_s is {date}, before there was MAVLink", [told.packet])
    return date or "not provided"


def _information_time(bench: MavlinkBench) -> Trial:
    first = yield from _information(bench)
    yield from bench.watch_on(_APART)
    last = yield from _information(bench)
    if last is first:
        raise not_tried("the second COMPONENT_INFORMATION_BASIC came too late")
    passed = last.at - first.at
    went = (last.message.time_boot_ms - first.message.time_boot_ms) / 1000.0
    if abs(went - passed) > _CLOCK:
        both = [first.packet, last.packet]
        raise failed(f"in {passed:.2f} s its time_boot_ms went on by {went:.2f} s", both)
    return f"{went:.2f} s in {passed:.2f} s"


def _request_unknown(bench: MavlinkBench) -> Trial:
    answer = yield from bench.command(dialect.MAV_CMD_REQUEST_MESSAGE, FOREIGN_MESSAGE)
    return refused(answer, "a request for a message that it does not have")


_beats = of(HEARTBEAT, "Heartbeats")
_connects = of(PARACHUTE, "Parachute Connection")
CLAUSES = (
    _connects(
        "heartbeat-rate",
        "sends a constant flow of heartbeats, nominally at 1 Hz",
        _heartbeat_rate,
        READS,
    ),
    _connects("heartbeat-type", "its type is MAV_TYPE_PARACHUTE", _heartbeat_type, READS),
    _beats(
        "heartbeat-fields",
        "a component that is no autopilot says MAV_AUTOPILOT_INVALID, its MAV_STATE and "
        "mavlink_version 3",
        _heartbeat_fields,
        READS,
    ),
    _connects(
        "component-id",
        "has a component id of its own, by default MAV_COMP_ID_PARACHUTE",
        _component_id,
        READS,
    ),
    _connects("request-status", "sends PARACHUTE_STATUS when it is requested", _request_status),
    _connects(
        "request-information",
        "sends COMPONENT_INFORMATION_BASIC when it is requested",
        _request_information,
    ),
    _connects(
        "information-texts",
        "COMPONENT_INFORMATION_BASIC names vendor and model in readable text",
        _information_texts,
    ),
    _connects(
        "information-serial",
        "its serial_number is readable text, or all 0",
        _information_serial,
    ),
    _connects(
        "information-date",
        "its time_manufacture_s is a date in s since 1970, or 0",
        _information_date,
    ),
    _connects(
        "information-time",
        "its time_boot_ms is the time since its start, ms",
        _information_time,
    ),
    _connects(
        "request-unknown",
        "a request for a message that it does not have is refused",
        _request_unknown,
    ),
)
