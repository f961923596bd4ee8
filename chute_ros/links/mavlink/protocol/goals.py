"""The goals of the MAVLink parachute protocol: which commands, and what shows their effect.

Sources: Parachute Protocol (MAV_CMD_SET_PARACHUTE_ARM, PARACHUTE_STATUS), MAVLink common.xml
(MAV_CMD_DO_PARACHUTE, MAV_CMD_DO_FLIGHTTERMINATION, MAV_CMD_COMPONENT_ARM_DISARM,
MAV_CMD_REQUEST_MESSAGE, MAV_CMD_SET_MESSAGE_INTERVAL).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from chute_ros.links.mavlink.protocol.autopilot import AutopilotTracker
from chute_ros.links.mavlink.protocol.commands import MavCommand
from chute_ros.links.mavlink.protocol.config import KillMethod
from chute_ros.links.mavlink.protocol.kill import KillPlan
from chute_ros.links.mavlink.protocol.parachute import ParachuteTracker
from chute_ros.model import LinkState, TriggerFlags, flag_names
from chute_ros.protocol.goal import ConfirmedCommand
from chute_ros.protocol.mavlink.dialect import FORCE_DISARM, dialect

MavlinkGoal = ConfirmedCommand[MavCommand]
Device = ParachuteTracker | AutopilotTracker

#: Each bit of a trigger mask that a PARACHUTE_STATUS can show.
_ALL_TRIGGERS = 0xFF

#: Name of the goal that fires.
RELEASE = "release"
#: And of the one that disarms by force, on the ground.
FORCED = "forced disarm on the ground"

#: When the heartbeat is asked for after an answer, s: autopilots change state some 10 ms later.
_LOOKS = (0.0, 0.025, 0.05, 0.1, 0.2)


def command(device: Device, number: int, *params: float) -> MavCommand:
    """A command for device; the params that are not given are 0."""
    p1, p2, p3, p4, p5, p6, p7 = (*map(float, params), *(0.0,) * (7 - len(params)))
    return MavCommand(device.system_id, device.component_id, number, (p1, p2, p3, p4, p5, p6, p7))


def set_interval(device: Device, message_id: int, interval_us: float) -> MavCommand:
    """Have a message sent each interval, microseconds."""
    return command(device, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_us)


def request_heartbeat(autopilot: AutopilotTracker) -> MavCommand:
    """Ask for one HEARTBEAT."""
    return command(autopilot, dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_HEARTBEAT)


def request_status(parachute: ParachuteTracker) -> MavCommand:
    """Ask for one PARACHUTE_STATUS."""
    message_id = dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS
    return command(parachute, dialect.MAV_CMD_REQUEST_MESSAGE, message_id)


def impossible_masks(arm: int, select: int) -> str:
    """Why these trigger masks cannot be set; empty: they can."""
    if 0 <= arm <= _ALL_TRIGGERS and 0 < select <= _ALL_TRIGGERS:
        return ""
    return (
        f"arm {arm}, select {select}: arm is a mask from 0 to {_ALL_TRIGGERS}, select from 1 to "
        f"{_ALL_TRIGGERS} (ParachuteStatus.TRIGGER_*); nothing was sent"
    )


def set_triggers(
    parachute: ParachuteTracker,
    arm: TriggerFlags,
    select: TriggerFlags,
    now: float,
    remark: str = "",
) -> MavlinkGoal:
    """Arm the selected trigger sources that are set in arm, disarm the other selected ones.
    remark: what whoever reads its end must know first.

    A module may refuse a mask with a source that it does not have. Where all are disarmed each is
    disarmed by itself then; a half of what is to be armed is not.
    """

    def shown() -> bool:
        fresh = parachute.status_received > now
        return fresh and parachute.armed_triggers & select == arm & select

    disarmed = TriggerFlags(int(select) & ~int(arm))
    changed = ", ".join(
        [f"{name} armed" for name in flag_names(select & arm)]
        + [f"{name} disarmed" for name in flag_names(disarmed)]
    )
    singles = [one for one in TriggerFlags if one & select and one != select]

    def hint() -> str:
        if not singles or not parachute.arming_refusal(now):
            return ""
        names = ", ".join(flag_names(select))
        return (
            f"it may lack one of {names}: choose those that it has by triggers, or by "
            "default_triggers"
        )

    def way(masks: list[TriggerFlags]) -> MavlinkGoal:
        mask, *others = masks
        alone = "" if mask == select else f" ({', '.join(flag_names(mask))} alone)"
        return ConfirmedCommand(
            f"MAV_CMD_SET_PARACHUTE_ARM{alone}",
            (command(parachute, dialect.MAV_CMD_SET_PARACHUTE_ARM, arm, mask),),
            f"PARACHUTE_STATUS reports {changed}",
            shown,
            request_status(parachute),
            hinders_release=bool(disarmed),
            hint=hint,
            remark=lambda: remark,
            otherwise=lambda: way(others) if others and parachute.arming_refusal(now) else None,
        )

    return way([select] if arm & select else [select, *singles])


def release(
    parachutes: Sequence[ParachuteTracker],
    force: bool,
    patience: float,
    now: float,
    remark: Callable[[], str] = str,
) -> MavlinkGoal:
    """Release the first of these parachutes; with force its triggers for commands are armed on the
    way, each by itself: a module may refuse a mask with a source that it does not have. The next
    one follows if it refuses, or has not answered or opened within patience, s.
    remark: what whoever reads its end must know first.

    A status from before the order is believed only while the status stream is alive and the device
    not lost: what a lost device said long ago must not keep us from sending.
    """
    parachute, *others = parachutes
    before = parachute.armed_triggers
    alive = parachute.liveness.state is not LinkState.LOST and not parachute.overdue(now)

    def next_one() -> MavlinkGoal | None:
        return release(others, force, patience, now, remark) if others else None

    def shown() -> bool:
        return parachute.deployed and (alive or parachute.status_received > now)

    order = command(parachute, dialect.MAV_CMD_DO_PARACHUTE, dialect.PARACHUTE_RELEASE)
    arm = [
        command(parachute, dialect.MAV_CMD_SET_PARACHUTE_ARM, source, source)
        for source in (TriggerFlags.FC, TriggerFlags.OFFBOARD)
        if force
    ]
    return ConfirmedCommand(
        RELEASE,
        (*arm, order),
        "PARACHUTE_STATUS reports deployed",
        shown,
        request_status(parachute),
        insist=force,
        urgent=True,
        hint=lambda: _why_not_released(parachute, now if force else math.inf, before),
        remark=remark,
        otherwise=next_one,
        patience=patience,
    )


def _why_not_released(
    parachute: ParachuteTracker, armed_since: float, before: TriggerFlags
) -> str:
    """What of the device's own words keeps a module from releasing on command. armed_since: when
    arming on the way began; before: what was armed then."""
    hints = []
    if refusal := parachute.arming_refusal(armed_since):
        hints.append(f"arming FC or OFFBOARD on the way: {refusal}")
    if not parachute.armed_triggers & TriggerFlags.FC:
        armed = ", ".join(flag_names(parachute.armed_triggers)) or "none"
        # Some modules go by FC alone, wherever the command comes from.
        offboard = parachute.armed_triggers & TriggerFlags.OFFBOARD
        need = "this module may need FC" if offboard else "need FC or OFFBOARD"
        hints.append(f"armed triggers: {armed}; {need}, which force arms on the way")
    if not parachute.ground_cleared:
        hints.append("its own status does not report GROUND_CLEARED")
    if armed_since < math.inf and (anew := parachute.armed_triggers & ~before):
        hints.append(f"it is ARMED now ({', '.join(flag_names(anew))}): on the ground disarm it")
    return "; ".join(hints)


#: The actions of MAV_CMD_DO_PARACHUTE that do not fire.
ACTION_NAMES: dict[int, str] = {
    dialect.PARACHUTE_DISABLE: "disable",
    dialect.PARACHUTE_ENABLE: "enable",
}


def parachute_action(parachute: ParachuteTracker, action: int) -> MavlinkGoal:
    """MAV_CMD_DO_PARACHUTE disable or enable; the status has no field that shows it."""
    return ConfirmedCommand(
        f"MAV_CMD_DO_PARACHUTE {ACTION_NAMES[action]}",
        (command(parachute, dialect.MAV_CMD_DO_PARACHUTE, action),),
        "acknowledged",
        hinders_release=action == dialect.PARACHUTE_DISABLE,
    )


def kill(
    autopilot: AutopilotTracker,
    plan: Callable[[], KillPlan],
    deploy_decided: Callable[[], bool],
    patience: float,
    now: float,
) -> MavlinkGoal | None:
    """Stop the motors, by the ways that plan has as each is begun. Always sent: a heartbeat from
    before the order proves nothing. patience: without an answer for so long the next way is tried
    as well, s. None: no way is allowed now."""

    def shown() -> bool:
        told = autopilot.motors_off and autopilot.armed_told_at > now
        return told or autopilot.motor_signs.stopped_since(now, stopping())

    def stopping() -> frozenset[int]:
        """Numbers of the commands that stop the motors of this autopilot, once accepted."""
        ways = (way for way in plan().ways if not way.obstacle)
        return frozenset(_stop_order(autopilot, way.method).number for way in ways)

    def next_way(tried: tuple[KillMethod, ...]) -> MavlinkGoal | None:
        way = plan().allowed(tried, deploy_decided())
        if way is None:
            return None
        return ConfirmedCommand(
            f"kill ({way.method.value})",
            (_stop_order(autopilot, way.method),),
            "the autopilot reports motors off",
            shown,
            request_heartbeat(autopilot),
            insist=True,
            urgent=True,
            looks=_LOOKS,
            otherwise=lambda: next_way((*tried, way.method)),
            patience=patience,
        )

    return next_way(())


def _stop_order(autopilot: AutopilotTracker, method: KillMethod) -> MavCommand:
    if method is KillMethod.FLIGHT_TERMINATION:
        return command(autopilot, dialect.MAV_CMD_DO_FLIGHTTERMINATION, 1.0)
    return command(autopilot, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCE_DISARM)


def disarm_on_ground(
    autopilot: AutopilotTracker, may_force: Callable[[], bool], patience: float, now: float
) -> MavlinkGoal:
    """A plain disarm, which an autopilot refuses if it takes the vehicle to fly; where may_force
    says that it stands, a forced one follows then."""

    def disarm(forced: bool) -> MavlinkGoal:
        param2 = (FORCE_DISARM,) if forced else ()
        return ConfirmedCommand(
            FORCED if forced else "disarm on the ground",
            (command(autopilot, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, *param2),),
            "the autopilot's heartbeat reports disarmed",
            lambda: autopilot.motors_off and autopilot.armed_told_at > now,
            request_heartbeat(autopilot),
            # The plain one, which may be tried on, must not keep it waiting.
            urgent=forced,
            looks=_LOOKS,
            otherwise=lambda: disarm(True) if not forced and may_force() else None,
            patience=patience,
        )

    return disarm(False)


@dataclass
class MessageWatch:
    """Waits for one message of one device; field, if given, must hold value."""

    system_id: int
    component_id: int
    message_id: int
    field: str = ""
    value: int = 0
    message: Any = None

    def offer(self, *said: Any) -> None:
        """A message came (system id, component id, message): keep it if it is the one."""
        system_id, component_id, message = said
        if (system_id, component_id) != (self.system_id, self.component_id):
            return
        if message.get_msgId() != self.message_id:
            return
        if not self.field or getattr(message, self.field) == self.value:
            self.message = message

    def seen(self) -> bool:
        """It came."""
        return self.message is not None


def request_message(
    parachute: ParachuteTracker, message_id: int
) -> tuple[MavlinkGoal, MessageWatch]:
    """Ask for one message (MAV_CMD_REQUEST_MESSAGE)."""
    watch = MessageWatch(parachute.system_id, parachute.component_id, message_id)
    kind = dialect.mavlink_map.get(message_id)
    name = kind.msgname if kind is not None else f"message {message_id}"
    ask = command(parachute, dialect.MAV_CMD_REQUEST_MESSAGE, message_id)
    goal = ConfirmedCommand(
        f"request of {name}", (ask,), f"{name} came", watch.seen, needs_acknowledgement=True
    )
    return goal, watch


def set_message_interval(
    parachute: ParachuteTracker, message_id: int, interval_us: int
) -> MavlinkGoal:
    """Set the interval of a message (MAV_CMD_SET_MESSAGE_INTERVAL), microseconds."""
    order = set_interval(parachute, message_id, interval_us)
    return ConfirmedCommand(f"interval of message {message_id}", (order,), "acknowledged")


def read_message_interval(
    parachute: ParachuteTracker, message_id: int
) -> tuple[MavlinkGoal, MessageWatch]:
    """Ask how often a message is sent: a MAV_CMD_REQUEST_MESSAGE of MESSAGE_INTERVAL."""
    wanted = dialect.MAVLINK_MSG_ID_MESSAGE_INTERVAL
    watch = MessageWatch(
        parachute.system_id, parachute.component_id, wanted, "message_id", message_id
    )
    ask = command(parachute, dialect.MAV_CMD_REQUEST_MESSAGE, wanted, message_id)
    name = "MESSAGE_INTERVAL"
    return ConfirmedCommand(f"request of {name}", (ask,), f"{name} came", watch.seen), watch
