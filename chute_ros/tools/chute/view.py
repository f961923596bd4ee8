"""The picture of a vehicle at one moment, in names, units and ages: for text and for JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from chute_ros.model import (
    Action,
    Armed,
    DeploymentTrigger,
    LandedState,
    LinkState,
    Outcome,
    ParachuteState,
    TriggerFlags,
    name_of,
)
from chute_ros.plain_text import span_text
from chute_ros.supervisor.gate import OPERATOR
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.state_text import MODES, UNGUARDED
from chute_ros.tools.chute.hearing import ReceivedMessage, ReceivedMessages
from chute_ros.tools.chute.words import NEVER, is_old

#: States in which nothing is wrong, if there is no alarm.
WELL = ("READY", "ARMED", "IN_FLIGHT", "LANDED")
#: chute_msgs/SafetyState.LINK_REGAINED, which only the supervisor's judgement has.
_REGAINED = 4
#: What a rule without an action does, as profiles name it.
_ALARM = "ALARM"
#: The end of such a line of SafetyState.unusable.
_NEVER_GIVEN = f": {NEVER}"


@dataclass(frozen=True)
class LinkView:
    """One link as the supervisor judges it. age: since the heartbeat of its node, s, NaN: never
    received. device_age: since its node received the device, s, NaN: never; None: not known, as no
    heartbeat was received here."""

    name: str
    state: str
    age: float
    device_age: float | None
    device_healthy: bool
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class ParachuteView:
    """One parachute. armed, deployed: None of one that tells nothing. released_by: what released
    it, "NONE" if nothing did or it is not known; height: m above take-off; packed_date:
    "YYYY-MM-DD" or empty; age: since its node received it (of an output that says nothing: wrote
    it), s, NaN: never."""

    link: str
    device: str
    link_state: str
    state: str
    armed: bool | None
    armed_triggers: tuple[str, ...]
    deployed: bool | None
    released_by: str
    height: float
    backup_voltage: float
    packed_date: str
    faults: tuple[str, ...]
    age: float

    @property
    def unmonitored(self) -> bool:
        """It tells nothing: whether it is armed or released nobody knows."""
        return self.armed is None


@dataclass(frozen=True)
class VehicleView:
    """The vehicle; angles in rad; ages in s, NaN: never received. battery_remaining: 0 to 1."""

    source: str
    link_state: str
    armed: str
    armed_age: float
    landed_state: str
    landed_state_age: float
    height: float
    height_age: float
    vertical_speed: float
    vertical_speed_age: float
    roll: float
    pitch: float
    yaw: float
    tilt: float
    attitude_age: float
    battery_voltage: float
    battery_remaining: float
    battery_age: float
    faults: tuple[str, ...]


@dataclass(frozen=True)
class RuleView:
    """One rule of the profile: level and hold in s."""

    name: str
    action: str
    active: bool
    fulfilled: bool
    acted_on: bool
    level: float
    hold: float
    conditions: tuple[str, ...]
    denied: str

    @property
    def counts(self) -> bool:
        """Its counter has begun, or it was fulfilled, acted on or denied."""
        return self.level > 0.0 or self.fulfilled or self.acted_on or bool(self.denied)

    @property
    def never(self) -> str:
        """Why it can never be fulfilled; empty: it can."""
        return "; ".join(self.conditions) if not (self.active or self.counts) else ""

    @property
    def does(self) -> str:
        """What it is at, in words."""
        if self.action == _ALARM and (self.acted_on or self.fulfilled):
            return "warns"
        if self.acted_on or self.fulfilled:
            return f"{self.action}, {'acted on' if self.acted_on else 'fulfilled'}"
        return f"{self.action}, {self.level:.1f} of {self.hold:.1f} s"


@dataclass(frozen=True)
class DecisionView:
    """A decision; kills and deploys also from before the listener began. outcomes: link and
    outcome, with detail, received since."""

    epoch: int
    id: int
    action: str
    rule: str
    shadow: bool
    reasons: tuple[str, ...]
    outcomes: tuple[str, ...]
    age: float

    @property
    def headline(self) -> str:
        """What, by whom and when."""
        shadow = " in SHADOW, not sent," if self.shadow else ""
        by = "a person" if self.rule == OPERATOR else f"rule '{self.rule}'"
        return f"{self.action}{shadow} by {by}, {span_text(self.age)} ago"


@dataclass(frozen=True)
class VehiclePicture:
    """Everything. age: since the supervisor's last word, s. listened: since the first one, s; what
    was said before was not received here, unless it was said again. well: a state of WELL
    that is not old, in mode ACTIVE, without an alarm."""

    namespace: str
    supervisor: str
    epoch: int
    state: str
    state_text: str
    mode: str
    age: float
    listened: float
    well: bool
    #: In flight, and nobody would be saved (state_text.UNGUARDED).
    unguarded: bool
    flight_blocked: bool
    block_reasons: tuple[str, ...]
    device_blocks: tuple[str, ...]
    alarms: tuple[str, ...]
    #: Measurements that came once and cannot be used now, each with its reason.
    unusable: tuple[str, ...]
    #: Measurements that the vehicle never gave.
    never_given: tuple[str, ...]
    links: tuple[LinkView, ...]
    parachutes: tuple[ParachuteView, ...]
    vehicle: VehicleView | None
    rules: tuple[RuleView, ...]
    newest_decision: str
    decisions: tuple[DecisionView, ...]
    #: Number of the newest kill or deploy where it was not received here; 0: it was, or none is.
    not_received: int

    @property
    def why(self) -> str:
        """The reason of the state in a sentence, without the names of the state and the mode,
        which stand beside it; empty: none is told."""
        return reason_in(self.state_text, self.state)

    @property
    def other_alarms(self) -> tuple[str, ...]:
        """Those that why does not tell already."""
        return tuple(one for one in self.alarms if one not in self.why)


def view(picture: ReceivedMessages, namespace: str, now: float) -> VehiclePicture | None:
    """What picture shows at now (monotonic s); None: no supervisor was received."""
    heard = picture.state(now)
    if heard is None:
        return None
    message, age = heard.message, picture.state_age(heard, now)
    state, mode = name_of(Stage, message.state), name_of(Mode, message.mode)
    alarms = tuple(message.alarms)
    return VehiclePicture(
        namespace=namespace,
        supervisor=message.supervisor,
        epoch=message.epoch,
        state=state,
        state_text=message.state_text,
        mode=mode,
        age=age,
        listened=now - picture.began,
        well=state in WELL and mode == Mode.ACTIVE.name and not alarms and not is_old(age),
        unguarded=is_unguarded(message.state_text),
        flight_blocked=message.flight_blocked,
        block_reasons=tuple(message.block_reasons),
        device_blocks=tuple(message.device_blocks),
        alarms=alarms,
        unusable=tuple(one for one in message.unusable if not one.endswith(_NEVER_GIVEN)),
        never_given=tuple(
            one.removesuffix(_NEVER_GIVEN)
            for one in message.unusable
            if one.endswith(_NEVER_GIVEN)
        ),
        links=_links(picture, message, age, now),
        parachutes=tuple(
            _parachute(one.message, picture.parachute_age(one, now))
            for _, one in sorted(picture.parachutes.items())
        ),
        vehicle=_vehicle(picture.vehicle, now),
        rules=tuple(map(_rule, message.rules)),
        newest_decision=_newest_decision(message),
        decisions=tuple(_decision(picture, one, now) for one in picture.decisions),
        not_received=_not_received(picture, message.fired_id),
    )


def _not_received(picture: ReceivedMessages, fired_id: int) -> int:
    return 0 if fired_id in {number for _, number in picture.fired} else fired_id


def reason_in(text: str, state: str) -> str:
    """text: of this state, as the supervisor says it; without the names of the state and of the
    mode."""
    for meant in MODES.values():
        text = text.removeprefix(f"{meant}; ")
    text = text.removeprefix(state).removeprefix(f", {UNGUARDED}")
    return text.removeprefix(": ").removeprefix("; ")


def is_unguarded(text: str) -> bool:
    """text: of a state, as the supervisor says it."""
    return f"{Stage.IN_FLIGHT.name}, {UNGUARDED}: " in text


def _links(
    picture: ReceivedMessages, message: Any, age: float, now: float
) -> tuple[LinkView, ...]:
    columns = (message.links, message.link_states, message.link_ages, message.devices_healthy)
    found = []
    for name, state, link_age, healthy in zip(*columns, strict=False):
        heartbeat = picture.heartbeats.get(name)
        found.append(
            LinkView(
                name=name,
                state="REGAINED" if state == _REGAINED else name_of(LinkState, state),
                age=link_age + age,
                device_age=_device_age(heartbeat, now) if heartbeat else None,
                device_healthy=healthy,
                reasons=tuple(heartbeat.message.reasons) if heartbeat and not healthy else (),
            )
        )
    return tuple(found)


def _device_age(heartbeat: ReceivedMessage, now: float) -> float:
    return float(heartbeat.message.age) + (now - heartbeat.received)


def _parachute(message: Any, age: float) -> ParachuteView:
    mute = message.link_state == LinkState.UNMONITORED
    return ParachuteView(
        link=message.link,
        device=message.device,
        link_state=name_of(LinkState, message.link_state),
        state=name_of(ParachuteState, message.state),
        armed=None if mute else message.armed,
        armed_triggers=_names(message.armed_triggers),
        deployed=None if mute else message.deployed,
        released_by=name_of(DeploymentTrigger, message.deployment_trigger),
        height=message.height,
        backup_voltage=message.backup_voltage,
        packed_date=message.packed_date,
        faults=tuple(message.faults),
        age=age,
    )


def _names(mask: int) -> tuple[str, ...]:
    """Of the trigger sources; a bit that has none is shown as it is."""
    names = [str(one.name) for one in TriggerFlags if one & mask]
    other = mask & ~sum(TriggerFlags)
    return tuple(names + ([f"bits {other:#x}"] if other else []))


def _vehicle(heard: ReceivedMessage | None, now: float) -> VehicleView | None:
    if heard is None:
        return None
    message = heard.message

    def age(of: float) -> float:
        return of + (now - heard.received) if of >= 0.0 else math.nan

    def number(value: float, of: float) -> float:
        # What was not filled in is 0, which is a height.
        return value if of >= 0.0 else math.nan

    return VehicleView(
        source=message.source,
        link_state=name_of(LinkState, message.link_state),
        armed=name_of(Armed, message.armed),
        armed_age=age(message.armed_age),
        landed_state=name_of(LandedState, message.landed_state),
        landed_state_age=age(message.landed_state_age),
        height=number(message.height, message.height_age),
        height_age=age(message.height_age),
        vertical_speed=number(message.vertical_speed, message.vertical_speed_age),
        vertical_speed_age=age(message.vertical_speed_age),
        roll=number(message.roll, message.attitude_age),
        pitch=number(message.pitch, message.attitude_age),
        yaw=number(message.yaw, message.attitude_age),
        tilt=number(message.tilt, message.attitude_age),
        attitude_age=age(message.attitude_age),
        battery_voltage=number(message.battery_voltage, message.battery_age),
        battery_remaining=number(message.battery_remaining, message.battery_age),
        battery_age=age(message.battery_age),
        faults=tuple(message.faults),
    )


def _rule(message: Any) -> RuleView:
    return RuleView(
        name=message.name,
        action=name_of(Action, message.action) if message.action else _ALARM,
        active=message.alive,
        fulfilled=message.fulfilled,
        acted_on=message.latched,
        level=message.level,
        hold=message.hold,
        conditions=tuple(message.conditions),
        denied=message.denied,
    )


def _newest_decision(message: Any) -> str:
    if not message.decision_id:
        return ""
    action = name_of(Action, message.decision_action)
    return f"{action} by rule '{message.decision_rule}' (number {message.decision_id})"


def _decision(picture: ReceivedMessages, heard: ReceivedMessage, now: float) -> DecisionView:
    message = heard.message
    reports = [
        one.message
        for (epoch, number, _), one in picture.reports.items()
        if (epoch, number) == (message.epoch, message.id)
    ]
    return DecisionView(
        epoch=message.epoch,
        id=message.id,
        action=name_of(Action, message.action),
        rule=message.rule,
        shadow=message.shadow,
        reasons=tuple(message.reasons),
        outcomes=tuple(
            f"{one.link} {name_of(Outcome, one.outcome)}: {one.detail}" for one in reports
        ),
        age=now - heard.received,
    )
