"""Decisions carried out by mavlink_parachute, and the health of its device."""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.mavlink.health import health
from chute_ros.links.mavlink.protocol import results
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.model import Action, Decision
from chute_ros.protocol.effect import EffectFinished
from chute_ros.protocol.events import RequestFinished
from chute_ros.runtime.device import DeviceRuntime, DeviceSettings, Summary
from chute_ros.settings import nested, parameter

#: How a flight block is reported by a node that must leave arming alone.
_NOT_UNDONE = "noted; arming is not undone (disarm_when_blocked is false)"


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

    def summarise(self, link: MavlinkLink, now: float) -> Summary:
        vehicle = link.vehicle_state(now)
        state, age, reasons = health(link, vehicle, self.settings.expect_parachute, now)
        return Summary(state, not reasons, age, reasons)

    def failed_end(self, token: int, text: str) -> RequestFinished:
        finished = EffectFinished(token, False, False, results.NO_ACKNOWLEDGEMENT, text)
        return RequestFinished(finished)

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
            blocked = "arming on the ground is undone" if undone else _NOT_UNDONE
            self.carry_out_flight_block(decision, blocked, "arming is not undone")
