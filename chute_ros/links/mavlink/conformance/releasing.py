"""MAV_CMD_DO_PARACHUTE, which fires."""

from __future__ import annotations

from itertools import dropwhile

from chute_ros.conformance.clause import (
    READS,
    OutOfReach,
    Risk,
    Trial,
    Wait,
    failed,
    not_supported,
    not_tried,
)
from chute_ros.links.mavlink.conformance.bench import (
    ARM,
    EVERY,
    MavlinkBench,
    ReceivedFrame,
    refused,
    result_of,
)
from chute_ros.links.mavlink.conformance.document import PARACHUTE, of
from chute_ros.model import DeploymentTrigger, SafetyFlags, TriggerFlags, name_of
from chute_ros.protocol.mavlink.dialect import dialect

_DO, _RELEASE = dialect.MAV_CMD_DO_PARACHUTE, dialect.PARACHUTE_RELEASE
_BY_COMMAND = int(TriggerFlags.FC | TriggerFlags.OFFBOARD)
#: Who has released it, by command.
_US = (DeploymentTrigger.DRONE, DeploymentTrigger.MAVLINK)
#: A release is told within this, s.
_TOLD_WITHIN = 2.0
#: A status comes by itself within this, however seldom it is streamed, s.
_STREAMED_WITHIN = 6.0
_MAY = "it must not, but it may RELEASE"


def _ready(bench: MavlinkBench) -> Trial:
    status = yield from bench.status()
    if status.message.deployment_status:
        raise not_tried("it is released already: repack it")
    return ""


def _still_packed(bench: MavlinkBench, what: str) -> Trial:
    # It may refuse, and release a moment later all the same.
    yield from bench.watch_on(_TOLD_WITHIN)
    status = yield from bench.status()
    if status.message.deployment_status:
        raise failed(f"{what}: IT RELEASED", [status.packet])
    return ""


def _wrong_action(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    yield from bench.command(ARM, 0, EVERY)
    answer = yield from bench.command(_DO, 9)
    yield from _still_packed(bench, "action 9, which nobody knows")
    return refused(answer, "action 9, which nobody knows,")


def _disarmed(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    yield from bench.accepted(ARM, 0, EVERY)
    bench.send(bench.command_int(_DO, _RELEASE))
    other = yield from bench.answer(_DO)
    yield from _still_packed(bench, "no source was armed, and it was a COMMAND_INT")
    if other is not None:
        refused(
            other, "a release by COMMAND_INT while no source is armed", "; nothing was released"
        )
    answer = yield from bench.command(_DO, _RELEASE, tries=1)
    yield from _still_packed(bench, "no source was armed")
    return refused(answer, "a release while no source is armed", "; nothing was released")


def _of_another_source(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    yield from bench.accepted(ARM, int(TriggerFlags.ATS), EVERY)
    answer = yield from bench.command(_DO, _RELEASE, tries=1)
    yield from _still_packed(bench, "only the ATS was armed")
    yield from bench.command(ARM, 0, EVERY)
    return refused(answer, "a command to release while only the ATS is armed")


def _near_ground(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    status = yield from bench.status()
    if status.message.safety_status & SafetyFlags.GROUND_CLEARED:
        raise not_tried("it says GROUND_CLEARED: give it a ground that is near")
    yield from bench.accepted(ARM, _BY_COMMAND, _BY_COMMAND)
    answer = yield from bench.command(_DO, _RELEASE, tries=1)
    yield from _still_packed(bench, "GROUND_CLEARED is not set")
    yield from bench.command(ARM, 0, EVERY)
    return refused(answer, "a release without GROUND_CLEARED", "; nothing was released")


def _release(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    status = yield from bench.status()
    if not status.message.safety_status & SafetyFlags.GROUND_CLEARED:
        raise not_tried("it does not say GROUND_CLEARED, so that it may refuse")
    yield from bench.accepted(ARM, _BY_COMMAND, _BY_COMMAND)
    since, began = len(bench.heard), bench.now
    answer = yield from bench.command(_DO, _RELEASE)
    if answer is None:
        raise failed("a release is not answered, 3 times")
    if answer.message.result == dialect.MAV_RESULT_UNSUPPORTED:
        raise not_supported("MAV_CMD_DO_PARACHUTE: MAV_RESULT_UNSUPPORTED")
    if answer.message.result != dialect.MAV_RESULT_ACCEPTED:
        raise failed(f"a source is armed, GROUND_CLEARED is set: {result_of(answer)}")

    def told() -> ReceivedFrame | None:
        statuses = (one for one in bench.heard[since:] if one.kind == "PARACHUTE_STATUS")
        return next((one for one in statuses if one.message.deployment_status), None)

    yield Wait(began + _TOLD_WITHIN, told)
    status = told() or (yield from bench.status())
    bench.released_from = since
    if not status.message.deployment_status:
        raise failed(f"accepted, and deployment_status is 0 after {_TOLD_WITHIN:g} s")
    number = status.message.deployment_status
    trigger = name_of(DeploymentTrigger, number)
    if number not in _US:
        raise failed(f"released by command, and its trigger is {trigger}", [status.packet])
    return f"{trigger}, reported after {status.at - began:.2f} s"


def _stays(bench: MavlinkBench) -> Trial:
    since = len(bench.heard) if bench.released_from < 0 else bench.released_from
    yield from bench.status()
    if not _released(bench, since):
        raise not_tried("it was not released")
    yield from bench.command(_DO, _RELEASE)
    yield from bench.command(ARM, 0, EVERY)
    yield from bench.status()
    for _ in range(2):
        if (yield from bench.wait_for("PARACHUTE_STATUS", _STREAMED_WITHIN)) is None:
            raise failed(f"released, and no PARACHUTE_STATUS within {_STREAMED_WITHIN:g} s")
    first, *others = _released(bench, since)
    before = first.message.deployment_status
    for one in others:
        if (after := one.message.deployment_status) != before:
            raise failed(f"released, and deployment_status went {before} -> {after}", [one.packet])
    return f"{name_of(DeploymentTrigger, before)} also after another release and a disarm"


def _released(bench: MavlinkBench, since: int) -> list[ReceivedFrame]:
    """The statuses from this place of heard on, beginning with the first that tells it."""
    told = [one for one in bench.heard[since:] if one.kind == "PARACHUTE_STATUS"]
    return [*dropwhile(lambda one: not one.message.deployment_status, told)]


_does = of(PARACHUTE, "MAV_CMD_DO_PARACHUTE")
_reports = of(PARACHUTE, "Deployment reason/status")
CLAUSES = (
    _does("wrong-action", "an action that is none is refused", _wrong_action, _MAY, Risk.FIRES),
    of(PARACHUTE, "Parachute Triggering Sources")(
        "release-disarmed",
        "a source that is disarmed does not release",
        _disarmed,
        _MAY,
        Risk.FIRES,
    ),
    of(PARACHUTE, "Parachute Triggering Sources")(
        "release-other-source",
        "a command does not release where only the ATS is armed",
        _of_another_source,
        _MAY,
        Risk.FIRES,
    ),
    of(PARACHUTE, "Safety and readiness for deployment")(
        "release-near-ground",
        "without GROUND_CLEARED a release is blocked",
        _near_ground,
        _MAY,
        Risk.FIRES,
    ),
    _does(
        "release",
        "action 2 releases, and the status names the trigger",
        _release,
        "IT RELEASES",
        Risk.FIRES,
    ),
    _reports(
        "released-stays",
        "deployment_status names the trigger once it was released, and stays",
        _stays,
        "it is released already",
        Risk.FIRES,
    ),
    _reports(
        "released-otherwise",
        "released by another source (MANUAL, ATS, GEOFENCE, FTS_PRECHECKING) it names that",
        OutOfReach("it takes a radio, a fall, a geofence or a flight termination system"),
        READS,
    ),
)
