"""Between the frozen types of chute_ros.model and the messages of chute_msgs."""

from __future__ import annotations

import dataclasses
import enum
import math
from typing import Any, TypeVar

from builtin_interfaces.msg import Time
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyDecision,
    SafetyRequest,
    SafetyState,
    SupervisorLease,
    VehicleState,
)

from chute_ros import model
from chute_ros.protocol.events import SafetyAsk
from chute_ros.runtime.topics import (
    ActionTold,
    DeviceBeat,
    DeviceRequest,
    LeaseClaim,
    SafetyPicture,
)
from chute_ros.supervisor import inputs
from chute_ros.supervisor.lease import Claim

MessageT = TypeVar("MessageT")
EnumT = TypeVar("EnumT", bound=enum.IntEnum)


def seconds(stamp: Time) -> float:
    """A stamp as Unix seconds."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def nanoseconds(stamp: Time) -> int:
    """A stamp as Unix nanoseconds."""
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def before(stamp: Time, age: float) -> Time:
    """The stamp of age seconds before; no stamp is before the clock's zero."""
    return stamp_of(max(0, nanoseconds(stamp) - round(age * 1e9)))


def device_beat(one: DeviceBeat, stamp: Time) -> LinkHeartbeat:
    """As it is published on safety/heartbeat."""
    return _filled(LinkHeartbeat(), one, stamp)


def device_beat_from(message: LinkHeartbeat) -> DeviceBeat:
    """What a device node published on safety/heartbeat; an unknown link state reads as
    NEVER_SEEN."""
    return DeviceBeat(
        message.link,
        _known(model.LinkState, message.link_state),
        message.device_healthy,
        message.seq,
        message.age,
        tuple(message.reasons),
        message.behind,
    )


def action_told(told: ActionTold, stamp: Time) -> ActionReport:
    """As it is published on safety/action."""
    return _filled(ActionReport(action=int(told.action)), told.report, stamp)


def action_told_from(message: ActionReport) -> ActionTold:
    """What somebody published on safety/action; a number without a name reads as NONE."""
    report = inputs.ActionReport(
        message.epoch,
        message.id,
        message.link,
        _known(model.Outcome, message.outcome),
        message.detail,
        message.newest_epoch,
        message.newest_id,
    )
    return ActionTold(_known(model.Action, message.action), report)


def device_request(one: DeviceRequest, stamp: Time) -> SafetyRequest:
    """As it is published on safety/request."""
    message = SafetyRequest(
        link=one.link, device=one.device, request=int(one.ask), reason=one.reason
    )
    message.header.stamp = stamp
    return message


def device_request_from(message: SafetyRequest) -> DeviceRequest | None:
    """What somebody published on safety/request; None: it asks for what does not exist."""
    if message.request not in SafetyAsk._value2member_map_:
        return None
    return DeviceRequest(message.link, message.device, SafetyAsk(message.request), message.reason)


def safety_picture(message: SafetyState) -> SafetyPicture:
    """Of what a supervisor published on safety/state what device nodes look at."""
    stamps = map(nanoseconds, message.link_stamps)
    return SafetyPicture(
        message.flight_blocked,
        tuple(message.device_blocks),
        message.supervisor,
        dict(zip(message.links, stamps, strict=False)),
        tuple(message.alarms),
        tuple(message.block_reasons),
        message.state == SafetyState.DEPLOYED,
    )


def stamp_of(nanoseconds: int) -> Time:
    """Unix nanoseconds as a stamp."""
    seconds, rest = divmod(nanoseconds, 10**9)
    return Time(sec=seconds, nanosec=rest)


def lease_claim(told: LeaseClaim, stamp: Time) -> SupervisorLease:
    """As it is published on safety/lease."""
    message = SupervisorLease(
        instance=told.instance, running=told.running, leader=told.leader, state=told.state
    )
    return _filled(message, told.claim, stamp)


def lease_claim_from(message: SupervisorLease) -> LeaseClaim:
    """What somebody published on safety/lease."""
    claim = Claim(
        message.name,
        message.rank,
        message.epoch,
        message.leading,
        message.empty,
        message.links_heard,
    )
    return LeaseClaim(claim, message.instance, message.running, message.leader, message.state)


def parachute_status(status: model.ParachuteStatus, link: str, stamp: Time) -> ParachuteStatus:
    """As it is published on parachute/status."""
    return _filled(ParachuteStatus(link=link), status, stamp)


def vehicle_state(state: model.VehicleState, stamp: Time) -> VehicleState:
    """As it is published on vehicle/state. stamp: when the picture was made."""
    message = _filled(VehicleState(), state, Time())
    known = [age for age in (getattr(state, name) for name in model.AGES) if not math.isnan(age)]
    if known:
        message.header.stamp = before(stamp, min(known))
    return message


def vehicle_state_from(message: VehicleState) -> model.VehicleState:
    """What somebody published on vehicle/state; a number without a name reads as unknown."""
    values = _values(message, model.VehicleState)
    values["armed"] = _known(model.Armed, values["armed"])
    values["landed_state"] = _known(model.LandedState, values["landed_state"])
    for name in model.AGES:
        if values[name] < 0.0:
            values[name] = model.NAN
    return model.VehicleState(**values)


def parachute_from(message: ParachuteStatus) -> model.ParachuteStatus:
    """What a device node published on parachute/status; a number without a name reads as
    unknown."""
    values = _values(message, model.ParachuteStatus)
    values["state"] = _known(model.ParachuteState, values["state"])
    values["armed_triggers"] = model.TriggerFlags(values["armed_triggers"])
    values["error_flags"] = model.ErrorFlags(values["error_flags"])
    values["safety_flags"] = model.SafetyFlags(values["safety_flags"])
    return model.ParachuteStatus(**values)


def decision(one: model.Decision, stamp: Time) -> SafetyDecision:
    """As it is published on safety/decision."""
    return _filled(SafetyDecision(), one, stamp)


def decision_from(message: SafetyDecision) -> model.Decision:
    """What somebody published on safety/decision; an unknown action reads as NONE."""
    return model.Decision(
        message.epoch,
        message.id,
        _known(model.Action, message.action),
        message.rule,
        tuple(message.reasons),
        tuple(message.targets),
        message.shadow,
        message.device,
    )


def json_value(value: object) -> object:
    """A MAVLink field's value as JSON can hold it: NaN and infinity become text."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, (list, tuple)):
        return [json_value(one) for one in value]
    return value


def request_words(request: Any) -> str:
    """The fields of a service's request in words, of each value the first 200 characters."""
    fields = request.get_fields_and_field_types()
    return ", ".join(f"{key}={getattr(request, key)!r:.200}" for key in fields)


def answered(service: str, request: Any, response: Any) -> str:
    """A service call with its answer, for a log."""
    return f"{service}({request_words(request)}) answered: {response.message}"


def _filled(message: MessageT, one: Any, stamp: Time) -> MessageT:
    """With this stamp, and with each field of one in that of its name."""
    filled: Any = message
    filled.header.stamp = stamp
    for field in dataclasses.fields(one):
        value = getattr(one, field.name)
        if isinstance(value, (enum.IntEnum, enum.IntFlag)):
            value = int(value)
        setattr(filled, field.name, list(value) if isinstance(value, tuple) else value)
    return message


def _values(
    message: Any, kind: type[model.ParachuteStatus | model.VehicleState]
) -> dict[str, Any]:
    """The other way round: as message has them, but for what both types have."""
    values = {field.name: getattr(message, field.name) for field in dataclasses.fields(kind)}
    values["link_state"] = _known(model.LinkState, values["link_state"])
    values["faults"] = tuple(values["faults"])
    return values


def _known(kind: type[EnumT], number: int) -> EnumT:
    """The member of kind with this number, or its member 0."""
    return kind(number) if number in kind._value2member_map_ else kind(0)
