"""MAV_CMD_SET_PARACHUTEARM, and the automatic release of MAV_CMD_DO_PARACHUTE."""

from __future__ import annotations

import math

from chute_ros.conformance.clause import READS, OutOfReach, Risk, Trial, failed, not_supported
from chute_ros.links.mavlink.conformance.bench import ARM, EVERY, MavlinkBench, refused
from chute_ros.links.mavlink.conformance.document import PARACHUTE, of
from chute_ros.model import TriggerFlags
from chute_ros.protocol.mavlink.dialect import dialect

_UNKNOWN_SOURCE = 256
#: What is not the automatic release.
_BY_SOMEBODY = (TriggerFlags.MANUAL, TriggerFlags.FC, TriggerFlags.OFFBOARD)
_NO_FLIGHT = "a device on a bench does not climb, and the conditions are developer-specific"
_DOES = "it arms and disarms trigger sources, also those that fire by themselves"


def _armed(bench: MavlinkBench) -> Trial:
    """arm_status, as a text that is a number."""
    return str((yield from bench.status()).message.arm_status)


def _sources(bench: MavlinkBench) -> Trial:
    """The sources that it has, as a text that is a mask: those that can be armed."""
    mask = 0
    for source in TriggerFlags:
        answer = yield from bench.command(ARM, int(source), int(source))
        if answer is None:
            raise failed(f"to arm {source.name} is not answered")
        if answer.message.result == dialect.MAV_RESULT_ACCEPTED:
            mask |= int(source)
    if not mask:
        raise not_supported("no source can be armed by command")
    return str(mask)


def _set(bench: MavlinkBench, arm: int, select: int, expected: int, what: str) -> Trial:
    yield from bench.accepted(ARM, arm, select)
    armed = int((yield from _armed(bench)))
    if armed != expected:
        raise failed(f"{what}: arm_status is {armed:#010b} (need {expected:#010b})")
    return ""


def _each(bench: MavlinkBench) -> Trial:
    yield from bench.disarm_each()
    has = int((yield from _sources(bench)))
    yield from bench.disarm_each()
    names = []
    for source in TriggerFlags:
        if has & source:
            one = int(source)
            yield from _set(bench, one, one, one, f"{source.name} alone is armed")
            yield from _set(bench, 0, one, 0, f"{source.name} is disarmed")
            names.append(source.name)
    return ", ".join(map(str, names))


def _mask(bench: MavlinkBench) -> Trial:
    yield from bench.disarm_each()
    has = int((yield from _sources(bench)))
    # All that it has are armed now. The document's own example, and its opposite.
    for arm, select in ((0b00000110, 0b00010111), (0b11101001, 0b00010111)):
        before = int((yield from _armed(bench)))
        select &= has
        expected = before & ~select | arm & select
        yield from _set(bench, arm, select, expected, f"first {arm:#010b}, second {select:#010b}")
    yield from _by_command_int(bench, has)
    yield from bench.disarm_each()
    return "bits that the second parameter does not select stay"


def _by_command_int(bench: MavlinkBench, has: int) -> Trial:
    """A device that takes a COMMAND_INT does the same by it."""
    arm, select = int(TriggerFlags.ATS), has & int(TriggerFlags.ATS | TriggerFlags.FC)
    before = int((yield from _armed(bench)))
    bench.send(bench.command_int(ARM, arm, select))
    answer = yield from bench.answer(ARM)
    taken = answer is not None and answer.message.result == dialect.MAV_RESULT_ACCEPTED
    expected = before & ~select | arm & select if taken else before
    if (armed := int((yield from _armed(bench)))) != expected:
        what = f"COMMAND_INT, first {arm:#010b}, second {select:#010b}"
        raise failed(f"{what}: arm_status is {armed:#010b} (need {expected:#010b})")
    return ""


def _nothing(bench: MavlinkBench) -> Trial:
    yield from bench.disarm_each()
    has = int((yield from _sources(bench)))
    before = int((yield from _armed(bench)))
    for arm in (0, has):
        answer = yield from bench.command(ARM, arm, 0)
        if answer is None:
            raise failed("a command that selects no source is not answered")
        if (now := int((yield from _armed(bench)))) != before:
            raise failed(f"no source was selected, and arm_status went {before} -> {now}")
    yield from bench.disarm_each()
    return "nothing changes"


def _refused(bench: MavlinkBench, arm: float, select: float, what: str) -> Trial:
    yield from bench.disarm_each()
    before = int((yield from _armed(bench)))
    told = refused((yield from bench.command(ARM, arm, select)), what)
    if (now := int((yield from _armed(bench)))) != before:
        raise failed(f"{what} is refused, and arm_status went {before} -> {now}")
    return f"{told}, nothing changes"


def _unknown_source(bench: MavlinkBench) -> Trial:
    what = f"bit {_UNKNOWN_SOURCE}, which is no source,"
    return (yield from _refused(bench, _UNKNOWN_SOURCE, _UNKNOWN_SOURCE, what))


def _no_number(bench: MavlinkBench) -> Trial:
    return (yield from _refused(bench, math.nan, float(TriggerFlags.FC), "NaN"))


def _disarm(bench: MavlinkBench) -> Trial:
    yield from _sources(bench)
    yield from _set(bench, 0, EVERY, 0, "all are disarmed at once")
    return "arm_status is 0"


def _automatic(bench: MavlinkBench) -> Trial:
    yield from bench.disarm_each()
    for action, expected in (
        (dialect.PARACHUTE_ENABLE, TriggerFlags.ATS),
        (dialect.PARACHUTE_DISABLE, TriggerFlags(0)),
    ):
        if action == dialect.PARACHUTE_DISABLE:
            for source in _BY_SOMEBODY:
                yield from bench.command(ARM, int(source), int(source))
        before = TriggerFlags(int((yield from _armed(bench))))
        answer = yield from bench.command(dialect.MAV_CMD_DO_PARACHUTE, action)
        if answer is None:
            raise failed(f"action {action} is not answered")
        if answer.message.result == dialect.MAV_RESULT_UNSUPPORTED:
            raise not_supported("MAV_CMD_DO_PARACHUTE: MAV_RESULT_UNSUPPORTED")
        armed = TriggerFlags(int((yield from _armed(bench))))
        if armed & TriggerFlags.ATS != expected:
            raise failed(f"after action {action} arm_status is {int(armed)}")
        if changed := [str(one.name) for one in _BY_SOMEBODY if (armed ^ before) & one]:
            names = ", ".join(changed)
            raise failed(f"action {action} is for the automatic release, and changes {names}")
    yield from bench.disarm_each()
    return "1 arms ATS, 0 disarms it"


_arms = of(PARACHUTE, "Parachute Triggering Sources")
CLAUSES = (
    _arms(
        "arm-sources",
        "each source can be armed and disarmed alone, and arm_status says so",
        _each,
        _DOES,
        Risk.ARMS,
    ),
    _arms(
        "arm-mask",
        "bits of the first parameter that are 0 in the second are ignored",
        _mask,
        _DOES,
        Risk.ARMS,
    ),
    _arms("arm-nothing", "no bit in the second changes nothing", _nothing, _DOES, Risk.ARMS),
    _arms(
        "arm-unknown",
        "a bit that is no source is refused",
        _unknown_source,
        _DOES,
        Risk.ARMS,
    ),
    _arms("disarm-all", "all sources can be disarmed at once", _disarm, _DOES, Risk.ARMS),
    _arms(
        "auto-arm",
        "with ATS_AUTO_ARM it arms its ATS above ats_arm_altitude",
        OutOfReach(_NO_FLIGHT),
        READS,
    ),
    _arms(
        "auto-disarm",
        "with ATS_AUTO_DISARM it disarms its ATS below ats_arm_altitude",
        OutOfReach(_NO_FLIGHT),
        READS,
    ),
    of(PARACHUTE, "MAV_CMD_DO_PARACHUTE")(
        "automatic-release",
        "actions 1 and 0 enable and disable the automatic release",
        _automatic,
        "it arms and disarms its automatic trigger",
        Risk.ARMS,
    ),
)
#: A device that dies of it has been tried in all else before.
AT_LAST = (
    _arms("arm-nan", "a parameter that is no number is refused", _no_number, _DOES, Risk.ARMS),
)
