"""relay and a simulated relay board in virtual time."""

from __future__ import annotations

from functools import partial

from chute_ros.campaign.aircraft import Aircraft
from chute_ros.campaign.bus import SERIAL, Bus, Plug
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.virtual_node import VirtualNode
from chute_ros.links.api import VehicleKind
from chute_ros.links.relay import LINK
from chute_ros.links.relay.protocol.link import RelayConfig, RelayLink
from chute_ros.links.relay.runtime import RelayRuntime, RelaySettings
from chute_ros.links.relay.simulator.relay_board import RelayBoard

_BOARD = "board"
_STANDARD = RelayConfig()


class RelayPart:
    """A relay board on a cable."""

    def ways(self, vehicle: VehicleKind) -> tuple[str, ...]:
        return (_BOARD, LINK.name)

    def stopping(self, vehicle: VehicleKind) -> tuple[str, ...]:
        return (_BOARD,)

    def read(self) -> None:
        """Nothing is shared."""

    def join(self, rig: Aircraft) -> None:
        bus = Bus(rig.world, SERIAL, f"{rig.scenario.seed} relay")
        board = RelayBoard(on_fire=partial(rig.out, LINK.name))
        rig.add_device(Plug(bus, _BOARD, board), board.reboot)
        rig.add_node(VirtualRelay(bus, rig.process(LINK.name), rig.ros))


class VirtualRelay(VirtualNode):
    """relay."""

    def __init__(self, bus: Bus, process: Process, ros: Ros) -> None:
        settings = RelaySettings()

        def make_link() -> RelayLink:
            link = RelayLink(settings.link)
            link.wire_opened(ros.world.now)
            return link

        runtime = partial(RelayRuntime, process.name, settings)
        super().__init__(bus, process, ros, make_link, runtime)

    def is_release(self, data: bytes) -> bool:
        return data == _STANDARD.fire
