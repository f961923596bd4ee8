"""Decisions carried out by umbilical, and the health of the flight computer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chute_ros.links.umbilical.protocol.config import UmbilicalConfig
from chute_ros.links.umbilical.protocol.events import TelemetryReceived
from chute_ros.links.umbilical.protocol.line_parser import LogLine
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.model import NAN, Action, Decision, LinkState, ParachuteStatus
from chute_ros.protocol.events import VehicleChanged
from chute_ros.runtime.device import DeviceRuntime, DeviceSettings, Summary, block_reason
from chute_ros.settings import nested, parameter


@dataclass(frozen=True)
class UmbilicalSettings(DeviceSettings):
    """Settings of an UmbilicalRuntime."""

    link: UmbilicalConfig = nested(UmbilicalConfig())
    publish_vehicle_state: bool = parameter(
        False,
        "publish vehicle/state from telemetry: for a vehicle without an autopilot on another link",
    )


class UmbilicalRuntime(DeviceRuntime[UmbilicalSettings]):
    """Its link is an UmbilicalLink."""

    PICTURES = (*DeviceRuntime.PICTURES, TelemetryReceived, LogLine)
    #: The rule of the newest deploy that was decided.
    _ordered_by = ""

    def summarise(self, link: UmbilicalLink, now: float) -> Summary:
        computer = link.computer
        status, record = computer.status(now, link.pause), computer.record
        reasons = reasons_of(status, link.received_bytes, link.config.telemetry.stale_after)
        age = NAN if record is None else now - record.received
        return Summary(computer.liveness.state, status.healthy, age, reasons)

    def take(self, event: Any, now: float) -> None:
        if not isinstance(event, VehicleChanged) or self.settings.publish_vehicle_state:
            super().take(event, now)

    def deploy(self, force: bool, answered: Callable[[Any], None]) -> None:
        """A person who forces it wants it fired again as well."""
        self.desk.request(
            lambda link, token, now: link.deploy(token, force, now, again=force), answered
        )

    def carry_out(self, decision: Decision) -> None:
        if decision.action is Action.KILL:
            # The motor's valve is closed: that is what stops a hybrid motor.
            # And nothing launches after it until the supervisor releases flight.
            reason = self.decided_block = f"killed: {block_reason(decision)}"

            def kill(link: UmbilicalLink, token: int, now: float) -> None:
                link.flight_block(reason, now)
                link.command(token, "safe", True, now)

            self.desk.request_for(decision, kill)
        elif decision.action is Action.DEPLOY:
            force = self.settings.link.decided_deploy_forces
            # What the same rule orders again, as nothing was confirmed, is the same deploy.
            repeated, self._ordered_by = decision.rule == self._ordered_by, decision.rule
            self.deploy_for(
                decision,
                lambda link, token, now: link.deploy(token, force, now, repeated=repeated),
            )
        elif decision.action is not Action.NONE:
            self.carry_out_flight_block(
                decision, "launch is refused", "launch is left to the gate"
            )


def reasons_of(
    status: ParachuteStatus, received_bytes: int, stale_after: float
) -> tuple[str, ...]:
    """Why it is not healthy, in words: what is so, and what is needed. stale_after: s."""
    if status.healthy:
        return ()
    if status.link_state is LinkState.NEVER_SEEN:
        heard = f"{received_bytes} bytes received, no $TELEM record"
        return (f"the flight computer was never received: {heard}, need one",)
    found = [
        f"{fault}, need younger than {stale_after:g} s" if fault.endswith(" s old") else fault
        for fault in status.faults
    ]
    out = ", the parachute is out" if status.deployed else ""
    return (*found, f"flight computer: state {status.state.name}{out}, need READY or ARMED")
