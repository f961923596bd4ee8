"""PARACHUTE_STATUS: its rate, and each of its fields."""

from __future__ import annotations

from typing import Any

from chute_ros.conformance.clause import (
    ASKS,
    READS,
    DecidedError,
    OutOfReach,
    Trial,
    failed,
    not_supported,
    not_tried,
)
from chute_ros.links.mavlink.conformance.bench import (
    STATUS_WITHIN,
    MavlinkBench,
    refused,
    result_of,
)
from chute_ros.links.mavlink.conformance.connection import FOREIGN_MESSAGE, WATCHED, nominal
from chute_ros.links.mavlink.conformance.document import PARACHUTE, of
from chute_ros.links.mavlink.protocol.parachute import packed_date
from chute_ros.model import DeploymentTrigger, ErrorFlags, SafetyFlags
from chute_ros.protocol.mavlink.dialect import dialect

_STATUS = dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS
_RESERVED = ErrorFlags.RESERVED_1 | ErrorFlags.RESERVED_2
#: Asked for, us, and how many of them are awaited.
_FASTER, _AWAITED = 200_000, 6
#: What a device has sent before it was told to stop comes within this, s.
_UNDER_WAY = 0.5
#: So long heartbeats are counted, s, and so many are due.
_WHILE, _BEATS = 4.0, (2, 8)
#: A clock may be off by this share, or this much, s.
_CLOCK, _CLOCK_LEAST = 0.05, 0.1


def _statuses(bench: MavlinkBench) -> Any:
    """All (ReceivedFrame) that came so far, or the first that comes."""
    if not any(one.kind == "PARACHUTE_STATUS" for one in bench.heard):
        yield from bench.wait_for("PARACHUTE_STATUS", STATUS_WITHIN)
    told = bench.look_at(one for one in bench.heard if one.kind == "PARACHUTE_STATUS")
    if not told:
        raise not_tried("no PARACHUTE_STATUS came")
    return told


def _rate(bench: MavlinkBench) -> Trial:
    yield from bench.watch_once(WATCHED, "PARACHUTE_STATUS")
    return nominal(bench, "PARACHUTE_STATUS")


def _pace(bench: MavlinkBench, within: float) -> Trial:
    """How often it comes now: the middle gap, s, as a text that is a number."""
    gaps = []
    first = yield from bench.wait_for("PARACHUTE_STATUS", within)
    before = first.at if first else bench.now
    for _ in range(_AWAITED):
        status = yield from bench.wait_for("PARACHUTE_STATUS", within)
        if status is None:
            raise failed(f"no PARACHUTE_STATUS for {within:g} s")
        gaps.append(status.at - before)
        before = status.at
    return f"{sorted(gaps)[len(gaps) // 2]:.3f}"


def _set(bench: MavlinkBench, interval: int) -> Trial:
    answer = yield from bench.status_every(interval)
    if answer is None:
        raise failed("MAV_CMD_SET_MESSAGE_INTERVAL is not answered")
    if answer.message.result != dialect.MAV_RESULT_ACCEPTED:
        raise not_supported(f"MAV_CMD_SET_MESSAGE_INTERVAL: {result_of(answer)}")
    return ""


def _set_interval(bench: MavlinkBench) -> Trial:
    yield from _set(bench, _FASTER)
    gap = float((yield from _pace(bench, 1.0)))
    if not 0.5 * _FASTER <= gap * 1e6 <= 1.5 * _FASTER:
        raise failed(f"200 ms were accepted, and it comes each {gap:.2f} s")
    return f"200 ms were asked for, it comes each {gap:.2f} s"


def _interval_told(bench: MavlinkBench) -> Trial:
    yield from _set(bench, _FASTER)
    answer = yield from bench.command(dialect.MAV_CMD_GET_MESSAGE_INTERVAL, _STATUS)
    if answer is None:
        raise failed("MAV_CMD_GET_MESSAGE_INTERVAL is not answered")
    if answer.message.result != dialect.MAV_RESULT_ACCEPTED:
        raise not_supported(f"MAV_CMD_GET_MESSAGE_INTERVAL: {result_of(answer)}")
    yield from bench.wait_for("MESSAGE_INTERVAL", 0.4)
    told = [one for one in bench.heard if one.kind == "MESSAGE_INTERVAL"]
    if not told:
        raise failed("accepted, but no MESSAGE_INTERVAL came within 0.4 s")
    message = told[-1].message
    if message.message_id != _STATUS or abs(message.interval_us - _FASTER) > 0.1 * _FASTER:
        raise failed(f"it reports {message.interval_us} us (need {_FASTER})", [told[-1].packet])
    return f"{message.interval_us} us"


def _interval_default(bench: MavlinkBench) -> Trial:
    yield from _set(bench, _FASTER)
    yield from _set(bench, 0)
    times = [one.at for one in bench.watched if one.kind == "PARACHUTE_STATUS"]
    before = (times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else 1.0
    gap = float((yield from _pace(bench, 3.0 * before + 1.0)))
    if not 0.6 * before <= gap <= 1.5 * before:
        raise failed(f"0 (default) was accepted: each {gap:.2f} s (before: {before:.2f} s)")
    return f"each {gap:.2f} s again"


def _interval_stop(bench: MavlinkBench) -> Trial:
    yield from _set(bench, -1)
    yield from bench.watch_on(_UNDER_WAY)
    since = len(bench.heard)
    yield from bench.watch_on(STATUS_WITHIN)
    came = [one.packet for one in bench.heard[since:] if one.kind == "PARACHUTE_STATUS"]
    yield from bench.status_as_before()
    if came:
        raise failed(f"-1 (stop) was accepted, and {len(came)} came in {STATUS_WITHIN:g} s", came)
    return f"none for {STATUS_WITHIN:g} s"


def _heartbeat_constant(bench: MavlinkBench) -> Trial:
    yield from bench.watch_once(WATCHED, "HEARTBEAT")
    try:
        nominal(bench, "HEARTBEAT")
    except DecidedError as error:
        raise not_tried("heartbeats do not come at nominally 1 Hz by themselves") from error
    for interval, how in ((-1, "is stopped"), (_FASTER, "comes each 0.2 s")):
        yield from _set(bench, interval)
        since, low, high = len(bench.heard), *_BEATS
        yield from bench.watch_on(_WHILE)
        beats = sum(one.kind == "HEARTBEAT" for one in bench.heard[since:])
        if not low <= beats <= high:
            yield from bench.status_as_before()
            raise failed(
                f"PARACHUTE_STATUS {how}, and {beats} HEARTBEAT come in {_WHILE:g} s "
                f"({low} to {high} are nominally 1 Hz)"
            )
    yield from bench.status_as_before()
    return "as before while its status is stopped, and while it comes faster"


def _interval_unknown(bench: MavlinkBench) -> Trial:
    command = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
    answer = yield from bench.command(command, FOREIGN_MESSAGE, _FASTER)
    return refused(answer, "an interval of a message that it does not have")


def _boot_time(bench: MavlinkBench) -> Trial:
    first = yield from bench.status()
    yield from bench.watch_on(3.0)
    last = yield from bench.status()
    passed = last.at - first.at
    told = (last.message.time_boot_ms - first.message.time_boot_ms) / 1000.0
    if abs(told - passed) > max(_CLOCK * passed, _CLOCK_LEAST):
        both = [first.packet, last.packet]
        raise failed(f"in {passed:.2f} s time_boot_ms went on by {told:.2f} s", both)
    return f"{told:.2f} s in {passed:.2f} s"


def _error_flags(bench: MavlinkBench) -> Trial:
    for one in (yield from _statuses(bench)):
        flags = one.message.error_status
        if flags & ~int(sum(ErrorFlags)):
            raise failed(f"error_status is {flags:#x}: bits beyond 20", [one.packet])
        if flags & int(_RESERVED):
            raise failed(f"error_status is {flags:#x}: bits 14 and 15 are reserved", [one.packet])
    return "no bit that is unknown or reserved"


def _safety_flags(bench: MavlinkBench) -> Trial:
    for one in (yield from _statuses(bench)):
        flags = one.message.safety_status
        if flags & ~int(sum(SafetyFlags)):
            raise failed(f"safety_status is {flags:#x}: bits beyond 2", [one.packet])
    return "no unknown bit"


def _ground(bench: MavlinkBench) -> Trial:
    for one in (yield from _statuses(bench)):
        both = SafetyFlags.GROUND_CLEARED | SafetyFlags.ON_GROUND
        if one.message.safety_status & both == both:
            raise failed("it says GROUND_CLEARED and ON_GROUND at once", [one.packet])
    return "never both at once"


def _deployment(bench: MavlinkBench) -> Trial:
    for one in (yield from _statuses(bench)):
        if one.message.deployment_status not in DeploymentTrigger._value2member_map_:
            told = one.message.deployment_status
            raise failed(f"deployment_status is {told}, which is no trigger", [one.packet])
    return "a known trigger, or none"


def _date(bench: MavlinkBench) -> Trial:
    told = ""
    for one in (yield from _statuses(bench)):
        told, wrong = packed_date(one.message.parachute_packed_date)
        if wrong:
            raise failed(wrong, [one.packet])
    return told or "not provided"


def _altitude(bench: MavlinkBench) -> Trial:
    """A device that fills in its height instead shows another one now and then."""
    yield from bench.status()
    told = yield from _statuses(bench)
    altitudes = {one.message.ats_arm_altitude: one for one in told}
    if len(altitudes) > 1:
        packets = [one.packet for one in altitudes.values()]
        numbers = ", ".join(map(str, sorted(altitudes)))
        raise failed(f"nothing set it, and it was {numbers} m", packets)
    return f"{told[-1].message.ats_arm_altitude} m each time"


_told = of(PARACHUTE, "Parachute Status")
_safe = of(PARACHUTE, "Safety and readiness for deployment")
_errors = of(PARACHUTE, "Errors")
CLAUSES = (
    _told("status-rate", "PARACHUTE_STATUS is streamed at nominally 1 Hz", _rate, READS),
    _told(
        "set-interval",
        "its rate can be set by MAV_CMD_SET_MESSAGE_INTERVAL",
        _set_interval,
        "it sends its status faster",
    ),
    _told(
        "interval-told",
        "the interval that was set can be read back",
        _interval_told,
        "it sends its status faster",
    ),
    _told(
        "interval-default",
        "interval 0 brings the default rate back",
        _interval_default,
        "it sends its status faster, and then as before",
    ),
    _told(
        "interval-stop",
        "interval -1 stops it",
        _interval_stop,
        "it does not send its status for some seconds, and then as before",
    ),
    of(PARACHUTE, "Parachute Connection")(
        "heartbeat-constant",
        "the flow of heartbeats is constant, whatever interval its status has",
        _heartbeat_constant,
        "it does not send its status for some seconds, sends it faster, and then as before",
    ),
    _told(
        "interval-unknown",
        "an interval of a message that it does not have is refused",
        _interval_unknown,
        "it must not, but it may send a message that it does not send now",
    ),
    _told("boot-time", "time_boot_ms is the time since its start, ms", _boot_time, ASKS),
    _errors(
        "error-flags",
        "error_status has flags of PARACHUTE_ERROR_FLAGS; bits 14 and 15 are reserved",
        _error_flags,
        READS,
    ),
    _told(
        "deployment-value",
        "deployment_status is a PARACHUTE_DEPLOYMENT_TRIGGER",
        _deployment,
        READS,
    ),
    _told(
        "safety-flags",
        "safety_status has flags of PARACHUTE_SAFETY_FLAGS",
        _safety_flags,
        READS,
    ),
    _told(
        "ground-flags",
        "GROUND_CLEARED (far enough from the ground) and ON_GROUND are not reported at once",
        _ground,
        READS,
    ),
    _errors(
        "error-reported",
        "what is wrong with it has its flag in error_status",
        OutOfReach("the document names no way to cause an error"),
        READS,
    ),
    _safe(
        "ground-cleared",
        "GROUND_CLEARED is raised at a safe distance from the ground",
        OutOfReach("a device on a bench does not climb"),
        READS,
    ),
    _safe(
        "geofence-mission",
        "it fetches a geofence by the mission protocol, and then reports GEOFENCE_MISSION_SET",
        OutOfReach("the kit has no geofence to give, and a device outside of one may release"),
        READS,
    ),
    _told(
        "arm-altitude",
        "ats_arm_altitude is the altitude of the ATS, m, which is set: it does not change",
        _altitude,
    ),
    _told(
        "packed-date",
        "parachute_packed_date is YYYY-MM-DD, 0 terminated, or all 0",
        _date,
        READS,
    ),
)
