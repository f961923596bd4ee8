"""Decisions carried out by mavlink_parachute, and the health of its device."""

from __future__ import annotations

import math
from dataclasses import dataclass

from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.protocol.parachute import ParachuteTracker
from chute_ros.model import NAN, Action, Armed, Decision, LinkState, VehicleState
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.runtime.device import DeviceRuntime, DeviceSettings, Summary
from chute_ros.runtime.topics import SafetyPicture
from chute_ros.settings import nested, parameter
from chute_ros.supervisor.kinds import kind

#: How a flight block is reported by a node that must leave arming alone.
_LEFT_ALONE = "noted; a vehicle that arms is not disarmed (disarm_when_blocked is false)"
_DISARMED = "a vehicle that arms on the ground is disarmed from now on; in the air nothing is done"

_NO_PARACHUTE = (
    "no parachute was received: check its power and wiring, parachute_system_id, and that its "
    f"HEARTBEAT (type MAV_TYPE_PARACHUTE, {dialect.MAV_TYPE_PARACHUTE}) reaches this connection"
)
_ONE_OF_SEVERAL = "parachute_component_id chooses one of several"
_HEARTBEATS_ALONE = (
    f"sends heartbeats but no PARACHUTE_STATUS ({dialect.MAVLINK_MSG_ID_PARACHUTE_STATUS}), "
    "although requested: check its "
    "firmware, and that every router on the way passes it on (ArduPilot does with "
    "MAVn_OPTIONS bit 3; PX4 does not)"
)
_NO_AUTOPILOT = (
    "no autopilot was received to send a kill to: check its wiring, "
    "autopilot_system_id and autopilot_component_id"
)


@dataclass(frozen=True)
class MavlinkSettings(DeviceSettings):
    """Settings of a MavlinkRuntime."""

    link: MavlinkConfig = nested(MavlinkConfig())
    expect_parachute: bool = parameter(
        True,
        "a parachute is on this network; false: it is on another link, and safety/heartbeat of "
        "this node reports the autopilot",
    )
    deploy_arms_trigger: bool = parameter(
        True, "a deploy that the supervisor decided also arms the flight-controller trigger"
    )


class MavlinkRuntime(DeviceRuntime[MavlinkSettings]):
    """Its link is a MavlinkLink."""

    #: Of the newest deploy that is another node's: its number, and who releases, until it is out.
    _deploy_number = (0, 0)
    _releases = ""
    #: Why flight is blocked by now; empty: it is not, or nobody has said so yet.
    _reason = ""
    #: Those of the supervisor that were announced.
    _alarms: tuple[str, ...] = ()

    def summarise(self, link: MavlinkLink, now: float) -> Summary:
        vehicle = link.vehicle_state(now)
        # Doubt about which devices are ours, and one that does not hear us, forbid take-off, but
        # take nothing back in flight. Nor does one that arms under the block lift it by that.
        on_ground = vehicle.armed is not Armed.ARMED or link.held_on_ground(now)
        doubts = link.doubts(now) if on_ground else []
        autopilot = _why_no_kill(vehicle)
        if not self.settings.expect_parachute:
            reasons = [*autopilot, *doubts]
            return Summary(vehicle.link_state, not reasons, vehicle.armed_age, tuple(reasons))
        chosen = link.chosen_parachute(now)
        state, age, reasons = LinkState.NEVER_SEEN, NAN, [_NO_PARACHUTE]
        if chosen is not None:
            state, age = chosen.liveness.state, chosen.liveness.age(now)
            reasons = _why_unhealthy(chosen, now)
            if on_ground:
                reasons += link.deaf_parachutes(now)
                # Whoever has two counts on two.
                others = [one for one in link.parachutes.all() if one is not chosen]
                wrong = [why for one in others for why in _why_unhealthy(one, now)]
                # Beside them: each is told once, as its own status says it too.
                reasons += [*wrong, _ONE_OF_SEVERAL] if wrong else []
        reasons += doubts
        if reasons:
            reasons += autopilot
        return Summary(state, not reasons, age, tuple(reasons))

    def carry_out(self, decision: Decision) -> None:
        if decision.action is Action.KILL:
            self.desk.request_once(
                decision,
                lambda link, token, now: link.kill(token, now),
                MavlinkLink.has_autopilot,
                self.settings.link.give_up_after,
            )
        elif decision.action is Action.DEPLOY:
            force, device = self.settings.deploy_arms_trigger, decision.device
            self.deploy_for(
                decision, lambda link, token, now: link.deploy(token, force, now, device)
            )
        elif decision.action is not Action.NONE:
            undone = self.settings.link.disarm_when_blocked
            blocked = _DISARMED if undone else _LEFT_ALONE
            self.carry_out_flight_block(decision, blocked, "a vehicle that arms is left alone")

    def decided_for_others(self, decision: Decision) -> None:
        number = (decision.epoch, decision.id)
        if decision.action is not Action.DEPLOY or number == self._deploy_number:
            return
        self._deploy_number, self._releases = number, ", ".join(decision.targets)
        self.shell.in_link(lambda link, now: link.deploy_decided(now))
        self._announce(f"DEPLOY by {self._releases} ordered: {decision.rule}")

    def picture(self, one: SafetyPicture) -> None:
        known = {kind(text) for text in self._alarms}
        self._alarms = one.alarms
        for text in one.alarms:
            if kind(text) not in known:
                self._announce(text)
        self._keep_reason(one)
        if self._releases and one.released:
            self._announce(f"DEPLOY by {self._releases} confirmed")
            self._releases = ""

    def _keep_reason(self, one: SafetyPicture) -> None:
        """A block lasts longer than the reason of its first moment: the pilot reads today's."""
        reason = "; ".join(one.block_reasons) if self.decided_block else ""
        if reason and kind(reason) != kind(self._reason or self.decided_block):
            self.shell.in_link(lambda link, now: link.flight_block(reason, now))
        self._reason = reason

    def _announce(self, text: str) -> None:
        """To the ground station, whose only way is this link."""
        self.shell.in_link(lambda link, now: link.announce(text))


def _why_unhealthy(one: ParachuteTracker, now: float) -> list[str]:
    """In words that say what a person can do; empty: it is healthy."""
    status = one.status(now)
    if status.healthy:
        return []
    reasons = [f"{one.device} {fault}" for fault in status.faults]
    if math.isnan(one.status_received) and status.link_state is LinkState.OK:
        # Its own fault says so too, in fewer words.
        reasons = [f"{one.device} {_HEARTBEATS_ALONE}"]
    if status.deployed:
        reasons.append(f"{one.device} is released")
    return reasons or [f"{one.device} is {status.state.name}"]


def _why_no_kill(vehicle: VehicleState) -> list[str]:
    """Why the autopilot cannot be told to kill; empty: it can."""
    if vehicle.link_state is LinkState.NEVER_SEEN:
        return [_NO_AUTOPILOT]
    if vehicle.link_state is LinkState.OK:
        return []
    state, age = vehicle.link_state.name, vehicle.armed_age
    return [f"autopilot {vehicle.source} is {state}: its heartbeat is {age:.1f} s old"]
