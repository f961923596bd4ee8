"""upf_can and a simulated UPF parachute in virtual time."""

from __future__ import annotations

import functools
from collections.abc import Callable
from functools import partial

from chute_ros.campaign.aircraft import Aircraft
from chute_ros.campaign.bus import CAN, Bus, Plug, spoil_can
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.virtual_node import VirtualNode
from chute_ros.links.api import VehicleKind
from chute_ros.links.upf import LINK
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.links.upf.runtime import UpfRuntime, UpfSettings
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import ControllerSettings, UpfController
from chute_ros.links.upf.simulator.memory import CONTROLLER_PARAMETERS
from chute_ros.links.upf.simulator.node import NodeSettings, UpfNode
from chute_ros.links.upf.simulator.trigger import UpfTrigger
from chute_ros.protocol.dronecan import time_sync
from chute_ros.protocol.dronecan.allocation import MESSAGE as ALLOCATION
from chute_ros.protocol.dronecan.can_frame import EXTENDED_MASK
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.runtime.topics import ActionTold
from chute_ros.sim.motion import Motion
from chute_ros.supervisor.inputs import VehicleReport
from chute_ros.transport.data_types import load_data_types

_CONTROLLER, _TRIGGER = _DEVICES = ("controller", "trigger")


class UpfPart:
    """A controller and a trigger."""

    def ways(self, vehicle: VehicleKind) -> tuple[str, ...]:
        return (*_DEVICES, LINK.name)

    def stopping(self, vehicle: VehicleKind) -> tuple[str, ...]:
        return _DEVICES

    def read(self) -> None:
        assert _definitions() is not None

    def join(self, rig: Aircraft) -> None:
        scenario, definitions = rig.scenario, _definitions()
        bus = Bus(rig.world, CAN, f"{scenario.seed} can")
        by_itself = dict.fromkeys((p.AUTO_TAKEOFF, p.AUTO_ARM), not scenario.arms)
        values = {**CONTROLLER_PARAMETERS, p.ENABLE_APS: scenario.aps, **by_itself}
        node = NodeSettings("upf.controller", values)
        controller = UpfController(definitions, ControllerSettings(node))
        trigger = UpfTrigger(definitions, on_fire=partial(rig.out, LINK.name))
        for name, device in ((_CONTROLLER, controller), (_TRIGGER, trigger)):
            plug = Plug(bus, name, UpfBus([device]), _is_for(device))
            rig.add_device(plug, device.reboot)
        rig.add_node(VirtualUpf(bus, rig.process(LINK.name), rig.ros, definitions.types))

        def feel(motion: Motion) -> None:
            controller.motion = motion

        rig.feeling.append(feel)


class VirtualUpf(VirtualNode):
    """upf_can."""

    runtime: UpfRuntime

    def __init__(self, bus: Bus, process: Process, ros: Ros, types: DataTypes) -> None:
        make_link = partial(UpfLink, UpfConfig(), types)
        runtime = partial(UpfRuntime, process.name, UpfSettings())
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


@functools.cache
def _definitions() -> Definitions:
    return Definitions(load_data_types("", "the data types"))


def _is_for(node: UpfNode) -> Callable[[bytes], bool]:
    """A service's frame, an anonymous one, or one of a message to which this node reacts."""
    names = (*node.messages, ALLOCATION, time_sync.MESSAGE)
    wanted = frozenset(node.definitions.types.message(name).id for name in names)

    def hears(frame: bytes) -> bool:
        identifier = int.from_bytes(frame[:4], "little")
        is_service, source = identifier & 0x80, identifier & 0x7F
        return bool(is_service) or not source or identifier >> 8 & 0xFFFF in wanted

    return hears
