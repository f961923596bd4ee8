"""MAV_CMD_DO_PARACHUTE, which fires."""

from __future__ import annotations

from chute_ros.conformance.clause import Risk, Trial, Wait, failed, not_supported, not_tried
from chute_ros.links.mavlink.conformance.bench import Heard, MavlinkBench, result_of
from chute_ros.links.mavlink.conformance.document import PARACHUTE, of
from chute_ros.model import DeploymentTrigger, SafetyFlags, TriggerFlags
from chute_ros.protocol.mavlink.dialect import dialect

_DO, _RELEASE = dialect.MAV_CMD_DO_PARACHUTE, dialect.PARACHUTE_RELEASE
_ARM = dialect.MAV_CMD_SET_PARACHUTE_ARM
_EVERY = int(sum(TriggerFlags))
_BY_COMMAND = int(TriggerFlags.FC | TriggerFlags.OFFBOARD)
#: Who has released it, by command.
_US = (DeploymentTrigger.DRONE, DeploymentTrigger.MAVLINK)
#: A release is told within this, s.
_TOLD_WITHIN = 2.0
_MAY = "it must not, but it may RELEASE"


def _ready(bench: MavlinkBench) -> Trial:
    status = yield from bench.status()
    if status.message.deployment_status:
        raise not_tried("it is released already: repack it")
    return ""


def _still_packed(bench: MavlinkBench, what: str) -> Trial:
    status = yield from bench.status()
    if status.message.deployment_status:
        raise failed(f"{what}: IT RELEASED", [status.packet])
    return ""


def _wrong_action(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    yield from bench.command(_ARM, 0, _EVERY)
    answer = yield from bench.command(_DO, 9)
    yield from _still_packed(bench, "action 9, which nobody knows")
    if answer is None:
        raise failed("action 9, which nobody knows, is not answered")
    if answer.message.result == dialect.MAV_RESULT_ACCEPTED:
        raise failed("action 9, which nobody knows, is ACCEPTED")
    return f"answered with {result_of(answer)}"


def _disarmed(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    yield from bench.accepted(_ARM, 0, _EVERY)
    answer = yield from bench.command(_DO, _RELEASE, tries=1)
    yield from _still_packed(bench, "no source was armed")
    if answer is None:
        raise failed("a release while no source is armed is not answered")
    if answer.message.result == dialect.MAV_RESULT_ACCEPTED:
        raise failed("no source is armed, and a release is ACCEPTED; nothing was released")
    return f"answered with {result_of(answer)}"


def _near_ground(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    status = yield from bench.status()
    if status.message.safety_status & SafetyFlags.GROUND_CLEARED:
        raise not_tried("it says GROUND_CLEARED: give it a ground that is near")
    yield from bench.accepted(_ARM, _BY_COMMAND, _BY_COMMAND)
    answer = yield from bench.command(_DO, _RELEASE, tries=1)
    yield from _still_packed(bench, "GROUND_CLEARED is not set")
    yield from bench.command(_ARM, 0, _EVERY)
    if answer is None or answer.message.result == dialect.MAV_RESULT_ACCEPTED:
        told = "not answered" if answer is None else "ACCEPTED; nothing was released"
        raise failed(f"GROUND_CLEARED is not set, and a release is {told}")
    return f"answered with {result_of(answer)}"


def _release(bench: MavlinkBench) -> Trial:
    yield from _ready(bench)
    status = yield from bench.status()
    if not status.message.safety_status & SafetyFlags.GROUND_CLEARED:
        raise not_tried("it does not say GROUND_CLEARED, so that it may refuse")
    yield from bench.accepted(_ARM, _BY_COMMAND, _BY_COMMAND)
    since, began = len(bench.heard), bench.now
    answer = yield from bench.command(_DO, _RELEASE)
    if answer is None:
        raise failed("a release is not answered, 3 times")
    if answer.message.result == dialect.MAV_RESULT_UNSUPPORTED:
        raise not_supported("MAV_CMD_DO_PARACHUTE: MAV_RESULT_UNSUPPORTED")
    if answer.message.result != dialect.MAV_RESULT_ACCEPTED:
        raise failed(f"a source is armed, GROUND_CLEARED is set: {result_of(answer)}")

    def told() -> Heard | None:
        statuses = (one for one in bench.heard[since:] if one.kind == "PARACHUTE_STATUS")
        return next((one for one in statuses if one.message.deployment_status), None)

    yield Wait(began + _TOLD_WITHIN, told)
    status = told() or (yield from bench.status())
    if not status.message.deployment_status:
        raise failed(f"accepted, and deployment_status is 0 after {_TOLD_WITHIN:g} s")
    trigger = DeploymentTrigger(status.message.deployment_status)
    if trigger not in _US:
        raise failed(f"released by command, and its trigger is {trigger.name}", [status.packet])
    return f"{trigger.name}, told after {status.at - began:.2f} s"


def _stays(bench: MavlinkBench) -> Trial:
    before = (yield from bench.status()).message.deployment_status
    if not before:
        raise not_tried("it was not released")
    yield from bench.command(_DO, _RELEASE)
    yield from bench.command(_ARM, 0, _EVERY)
    after = yield from bench.status()
    if after.message.deployment_status != before:
        told = after.message.deployment_status
        raise failed(f"released, and deployment_status went {before} -> {told}", [after.packet])
    return f"{DeploymentTrigger(before).name} also after another release and a disarm"


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
        "deployment_status is other than 0 once it was released",
        _stays,
        "it is released already",
        Risk.FIRES,
    ),
)
