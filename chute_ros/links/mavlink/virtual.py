"""mavlink_parachute and a simulated parachute in virtual time."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from chute_ros.campaign.aircraft import Aircraft, is_for_devices
from chute_ros.campaign.bus import Bus, Plug
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.scenario import AUTOPILOT_WAYS, HomeMove, Scenario
from chute_ros.campaign.virtual_node import VirtualNode
from chute_ros.links.api import AUTOPILOT_LINK, VehicleKind
from chute_ros.links.mavlink import carries_parachute
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.runtime import MavlinkRuntime, MavlinkSettings
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.model import DeploymentTrigger
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.home import Homing

#: COMMAND_LONG, and MAV_CMD_DO_PARACHUTE in it.
_COMMAND_LONG, _DO_PARACHUTE = b"\x4c\0\0", 208
#: FC and OFFBOARD.
_ARMED_TRIGGERS = 12
_PARACHUTE = "parachute"
_STANDARD = MavlinkConfig()


class MavlinkPart:
    """The autopilot itself is the aircraft's."""

    def ways(self, vehicle: VehicleKind) -> tuple[str, ...]:
        return (*AUTOPILOT_WAYS, *self.stopping(vehicle))

    def stopping(self, vehicle: VehicleKind) -> tuple[str, ...]:
        return (_PARACHUTE,) if carries_parachute(vehicle) else ()

    def read(self) -> None:
        """Nothing is shared."""

    def join(self, rig: Aircraft) -> None:
        scenario, bus = rig.scenario, rig.network
        carries = carries_parachute(scenario.carries)
        if carries:
            settings = ParachuteSettings(armed_triggers=0 if scenario.arms else _ARMED_TRIGGERS)
            parachute = ReleasedParachute(
                settings,
                partial(rig.out, AUTOPILOT_LINK),
                lambda: rig.model.clearance,
                feels=not _heights_are_true(scenario),
            )
            rig.add_device(Plug(bus, _PARACHUTE, parachute, is_for_devices), parachute.reboot)
            if len(scenario.carries.supervised("deploy_links")) == 1:
                rig.refused_at = lambda: parachute.misled_at
        rig.add_node(VirtualMavlink(bus, rig.process(AUTOPILOT_LINK), rig.ros, carries))


class VirtualMavlink(VirtualNode):
    """mavlink_parachute. expect_parachute: false where the parachute is on another link."""

    def __init__(
        self,
        bus: Bus,
        process: Process,
        ros: Ros,
        expect_parachute: bool,
        config: MavlinkConfig = _STANDARD,
    ) -> None:
        settings = MavlinkSettings(expect_parachute=expect_parachute)
        runtime = partial(MavlinkRuntime, process.name, settings)
        super().__init__(bus, process, ros, lambda: MavlinkLink(config), runtime)

    def is_release(self, data: bytes) -> bool:
        payload = data[10:]
        command = int.from_bytes(payload[28:30], "little")
        return data[7:10] == _COMMAND_LONG and command == _DO_PARACHUTE


class ReleasedParachute(ParachuteDevice):
    """Its release acts on the vehicle, whoever hears of it. true_height: above ground, m; feels:
    it goes by that, and not by the height that it is told."""

    def __init__(
        self,
        settings: ParachuteSettings,
        out: Callable[[], None],
        true_height: Callable[[], float],
        feels: bool,
    ) -> None:
        super().__init__(settings, [])
        self._out, self._true_height, self._feels = out, true_height, feels
        #: When it first refused a release because the height that it is told is wrong, virtual s.
        self.misled_at = math.nan

    def _height(self) -> float:
        return self._true_height() if self._feels else super()._height()

    def _release(self) -> int:
        result = super()._release()
        refused = result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        first = refused and math.isnan(self.misled_at)
        if first and self._true_height() >= self.settings.clear_height:
            self.misled_at = self.now
        return result

    def deploy(self, trigger: DeploymentTrigger) -> None:
        super().deploy(trigger)
        self._out()


def _heights_are_true(scenario: Scenario) -> bool:
    """Those above home are above the ground; elsewhere a parachute has a sensor of its own."""
    moves = any(isinstance(one, HomeMove) for one in scenario.faults)
    autopilot = scenario.autopilot
    stays = autopilot.homing is Homing.STAYS and not autopilot.home_drift
    return stays and not moves and not scenario.ground
