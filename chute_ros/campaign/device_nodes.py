"""The three device nodes: a link and a runtime each, as they are by default."""

from __future__ import annotations

from collections.abc import Callable

from chute_ros.campaign.bus import Bus, spoil_can
from chute_ros.campaign.device_node import DeviceNode
from chute_ros.campaign.ros import Process, Ros
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.runtime import MavlinkRuntime, MavlinkSettings
from chute_ros.links.umbilical.protocol.config import UmbilicalConfig
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.links.umbilical.runtime import UmbilicalRuntime, UmbilicalSettings
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.links.upf.runtime import UpfRuntime, UpfSettings
from chute_ros.protocol.dronecan.can_frame import EXTENDED_MASK
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.runtime.topics import ActionTold
from chute_ros.supervisor.inputs import VehicleReport

MAVLINK_NODE, UPF_NODE, UMBILICAL_NODE = "mavlink_parachute", "upf_can", "umbilical"
#: COMMAND_LONG, and MAV_CMD_DO_PARACHUTE in it.
_COMMAND_LONG, _DO_PARACHUTE = b"\x4c\0\0", 208


class MavlinkNode(DeviceNode):
    """mavlink_parachute. expect_parachute: false where the parachute is on another link."""

    def __init__(self, bus: Bus, process: Process, ros: Ros, expect_parachute: bool) -> None:
        settings = MavlinkSettings(expect_parachute=expect_parachute)

        def runtime(shell: DeviceNode) -> MavlinkRuntime:
            return MavlinkRuntime(process.name, settings, shell)

        super().__init__(bus, process, ros, lambda: MavlinkLink(MavlinkConfig()), runtime)

    def is_release(self, data: bytes) -> bool:
        payload = data[10:]
        command = int.from_bytes(payload[28:30], "little")
        return data[7:10] == _COMMAND_LONG and command == _DO_PARACHUTE


class UpfNode(DeviceNode):
    """upf_can."""

    runtime: UpfRuntime

    def __init__(self, bus: Bus, process: Process, ros: Ros, types: DataTypes) -> None:
        def runtime(shell: DeviceNode) -> UpfRuntime:
            return UpfRuntime(process.name, UpfSettings(), shell)

        make_link: Callable[[], UpfLink] = lambda: UpfLink(UpfConfig(), types)  # noqa: E731
        super().__init__(bus, process, ros, make_link, runtime, spoil_can)
        self._releasing = {
            *(types.request(names.PARACHUTE_SERVICE).id, types.request(names.TRIGGER_SERVICE).id)
        }
        self._launch = types.message(names.TRIGGER_LAUNCH).id
        ros.subscribe(VehicleReport, process, self._vehicle)
        ros.subscribe(ActionTold, process, self._action)

    def is_release(self, data: bytes) -> bool:
        identifier = int.from_bytes(data[:4], "little") & EXTENDED_MASK
        if identifier & 0x80:
            return bool(identifier & 0x8000) and identifier >> 16 & 0xFF in self._releasing
        return identifier >> 8 & 0xFFFF == self._launch

    def _vehicle(self, one: VehicleReport, difference: float, now: float) -> None:
        self.runtime.heard_vehicle(one.state)
        self.after()

    def _action(self, told: ActionTold, difference: float, now: float) -> None:
        self.runtime.heard_action(told)
        self.after()


class UmbilicalNode(DeviceNode):
    """umbilical, of a rocket without an autopilot beside it."""

    def __init__(self, bus: Bus, process: Process, ros: Ros, layouts: list[Layout]) -> None:
        def make_link() -> UmbilicalLink:
            link = UmbilicalLink(UmbilicalConfig(), layouts)
            link.wire_opened(ros.world.now)
            return link

        def runtime(shell: DeviceNode) -> UmbilicalRuntime:
            return UmbilicalRuntime(
                process.name, UmbilicalSettings(publish_vehicle_state=True), shell
            )

        super().__init__(bus, process, ros, make_link, runtime)

    def launch(self) -> None:
        """A person launches the rocket; force: and confirms it."""
        self.runtime.desk.request(
            lambda link, token, now: link.command(token, "launch", True, now), lambda end: None
        )
        self.after()

    def is_release(self, data: bytes) -> bool:
        return data in (b"<D>", b"<d>")
