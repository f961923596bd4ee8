"""The three device nodes, as far as they decide anything themselves."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from chute_ros.campaign.bus import Bus, spoil_can
from chute_ros.campaign.device_node import ActionTold, DeviceNode
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.supervisor_host import SafetyPicture
from chute_ros.model import Action, Armed, Decision, LinkState, Outcome
from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.protocol.dronecan.can_frame import EXTENDED_MASK
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.protocol.mavlink.config import MavlinkConfig
from chute_ros.protocol.mavlink.link import MavlinkLink
from chute_ros.protocol.umbilical.config import UmbilicalConfig
from chute_ros.protocol.umbilical.layouts import Layout
from chute_ros.protocol.umbilical.link import UmbilicalLink
from chute_ros.protocol.upf import definitions as names
from chute_ros.protocol.upf.config import UpfConfig
from chute_ros.protocol.upf.link import UpfLink
from chute_ros.protocol.upf.vehicle_service import Ask, AskSupervisor
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import TRIGGER

MAVLINK_NODE, UPF_NODE, UMBILICAL_NODE = "mavlink_parachute", "upf_can", "umbilical"
#: COMMAND_LONG, and MAV_CMD_DO_PARACHUTE in it.
_COMMAND_LONG, _DO_PARACHUTE = b"\x4c\0\0", 208


class MavlinkNode(DeviceNode):
    """mavlink_parachute. expect_parachute: false where the parachute is on another link."""

    def __init__(self, bus: Bus, process: Process, ros: Ros, expect_parachute: bool) -> None:
        self._expects = expect_parachute
        super().__init__(bus, process, ros, lambda: MavlinkLink(MavlinkConfig()))

    def carry_out(self, decision: Decision, now: float) -> None:
        if decision.action is Action.KILL:
            self.request_once(decision, self.link.kill, self.link.has_autopilot, now)
        elif decision.action is Action.DEPLOY:
            device = decision.device
            self.deploy_for(
                decision, lambda token, at: self.link.deploy(token, True, at, device), now
            )
        else:
            self.decided_flight_block(decision, now)

    def summary(self, now: float) -> tuple[LinkState, bool]:
        if not self._expects:
            state = self.link.vehicle_state(now).link_state
            return state, state is LinkState.OK
        chosen = self.link.chosen_parachute()
        if chosen is None:
            return LinkState.NEVER_SEEN, False
        flying = self.link.vehicle_state(now).armed is Armed.ARMED
        healthy = chosen.status(now).healthy and (flying or not self.link.doubts(now))
        return chosen.liveness.state, healthy

    def is_release(self, data: bytes) -> bool:
        payload = data[10:]
        command = int.from_bytes(payload[28:30], "little")
        return data[7:10] == _COMMAND_LONG and command == _DO_PARACHUTE


class UpfNode(DeviceNode):
    """upf_can."""

    def __init__(self, bus: Bus, process: Process, ros: Ros, types: DataTypes) -> None:
        super().__init__(bus, process, ros, lambda: UpfLink(UpfConfig(), types), spoil_can)
        self._releasing = {
            *(types.request(names.PARACHUTE_SERVICE).id, types.request(names.TRIGGER_SERVICE).id)
        }
        self._launch = types.message(names.TRIGGER_LAUNCH).id
        ros.subscribe(i.VehicleReport, process, self._vehicle)
        ros.subscribe(ActionTold, process, self._action)

    def _begin(self, now: float) -> None:
        super()._begin(now)
        #: Kills that were confirmed: (epoch, id, link) of the newest reports.
        self._kills: deque[tuple[int, int, str]] = deque(maxlen=50)

    def carry_out(self, decision: Decision, now: float) -> None:
        if decision.action is Action.KILL:
            self.report(decision, Outcome.FAILED, "a UPF parachute stops no motors")
        elif decision.action is Action.DEPLOY:
            self.deploy_for(decision, self._deploy(decision.device), now)
        else:
            self.decided_flight_block(decision, now)

    def _deploy(self, device: str) -> Callable[[int, float], None]:
        if device == TRIGGER:
            fire: Callable[[int, float], None] = self.link.fire_triggers
            return fire

        def begin(token: int, now: float) -> None:
            self.link.kill_waited_for(now)
            self.link.deploy(token, True, now, int(device or 0))

        return begin

    def flight_block(self, reason: str, now: float) -> None:
        """It asks for it and does nothing about it itself."""

    def summary(self, now: float) -> tuple[LinkState, bool]:
        link = self.link
        picture = link.devices.picture(now)
        device = link.devices.controller() or link.devices.trigger()
        if picture is None or device is None:
            return LinkState.NEVER_SEEN, False
        triggers = link.devices.triggers.values()
        sound = not link.bus.troubles() and all(one.sound for one in triggers)
        return device.liveness.state, picture.healthy and (sound or link.in_air(now))

    def event(self, event: Any) -> None:
        if isinstance(event, AskSupervisor):
            if event.ask is Ask.KILL:
                by = f"{self.name} {event.device}"
                self.publish(i.KillRequest(0, by, event.reason))
            else:
                block = event.ask is Ask.FLIGHT_BLOCK
                self.publish(i.BlockRequest(self.name, event.device, block, event.reason))
        elif isinstance(event, KeepTable):
            self.link.table_kept(event.number, self._ros.world.now)

    def is_release(self, data: bytes) -> bool:
        identifier = int.from_bytes(data[:4], "little") & EXTENDED_MASK
        if identifier & 0x80:
            return bool(identifier & 0x8000) and identifier >> 16 & 0xFF in self._releasing
        return identifier >> 8 & 0xFFFF == self._launch

    def _vehicle(self, one: i.VehicleReport, difference: float, now: float) -> None:
        self.link.vehicle(one.state, now)
        self._after(now)

    def _action(self, told: ActionTold, difference: float, now: float) -> None:
        one = told.report
        report = (one.epoch, one.id, one.link)
        confirmed = told.action is Action.KILL and one.outcome is Outcome.CONFIRMED
        if confirmed and report not in self._kills:
            self._kills.append(report)
            self.link.kill_confirmed(now)
            self._after(now)

    def safety_state(self, one: SafetyPicture, now: float) -> None:
        prefix = f"{self.name} "
        standing = [
            block.removeprefix(prefix) for block in one.device_blocks if block.startswith(prefix)
        ]
        self.link.supervisor_said(one.blocked, standing, now)
        self._after(now)


class UmbilicalNode(DeviceNode):
    """umbilical."""

    def __init__(self, bus: Bus, process: Process, ros: Ros, layouts: list[Layout]) -> None:
        def make_link() -> UmbilicalLink:
            link = UmbilicalLink(UmbilicalConfig(), layouts)
            link.wire_opened(ros.world.now)
            return link

        super().__init__(bus, process, ros, make_link)

    def carry_out(self, decision: Decision, now: float) -> None:
        if decision.action is Action.KILL:
            # Nothing launches after it until the supervisor releases flight.
            self.decided_block = f"killed: {'; '.join(decision.reasons) or decision.rule}"
            self.link.flight_block(self.decided_block, now)
            self.request_for(
                decision, lambda token, at: self.link.command(token, "safe", True, at), now
            )
        elif decision.action is Action.DEPLOY:
            self.deploy_for(decision, lambda token, at: self.link.deploy(token, True, at), now)
        else:
            self.decided_flight_block(decision, now)

    def launch(self) -> None:
        """A person launches the rocket; force: and confirms it."""
        now = self._ros.world.now
        self.link.command(next(self._tokens), "launch", True, now)
        self._after(now)

    def summary(self, now: float) -> tuple[LinkState, bool]:
        computer = self.link.computer
        return computer.liveness.state, computer.status(now, self.link.pause).healthy

    def is_release(self, data: bytes) -> bool:
        return data in (b"<D>", b"<d>")
