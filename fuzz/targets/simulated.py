"""What the simulated devices hear. They remember all that came, so that their size is left out."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Protocol

from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import ControllerSettings, UpfController
from chute_ros.links.upf.simulator.memory import CONTROLLER_PARAMETERS
from chute_ros.links.upf.simulator.node import NodeSettings
from chute_ros.links.upf.simulator.trigger import UpfTrigger
from fuzz.program import Program
from fuzz.target import Target
from fuzz.targets.mavlink_frames import good_frame
from fuzz.targets.umbilical_lines import layouts
from fuzz.targets.upf_frames import data_types, transfer_of

_TOKENS = (b"<H>", b"<KA>", b"<L>", b"<D>", b"<d>", b"<V>", b"<G>", b"<W>", b"<X>", b"<f>", b"<I>")


class _Device(Protocol):
    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None: ...

    def update(self, now: float) -> None: ...

    def take_output(self) -> list[bytes]: ...


class Simulated:
    """A device, and what it hears next by a program: pieces of bytes."""

    def __init__(self, device: _Device, hear: Callable[[Program], list[bytes]]) -> None:
        self._device, self._hear = device, hear
        self._now = 1000.0
        device.update(self._now)

    def held(self) -> object:
        return None

    def feed(self, data: bytes) -> None:
        program = Program(data)
        while not program.over:
            self._now += program.choice((0.0, 0.01, 0.5, 2.0))
            for one in self._hear(program):
                self._device.receive(one, self._now)
            self._device.update(self._now)
            self._device.take_output()


def _parachute() -> Simulated:
    def hear(p: Program) -> list[bytes]:
        return [p.piece()] if p.flag() else [good_frame(p, None, 0.0)[0]]

    return Simulated(ParachuteDevice(ParachuteSettings(), []), hear)


def _upf() -> Simulated:
    definitions = Definitions(data_types())
    node = NodeSettings("upf.controller", dict(CONTROLLER_PARAMETERS))
    controller = UpfController(definitions, ControllerSettings(node))
    bus = UpfBus([controller, UpfTrigger(definitions)])
    return Simulated(bus, lambda p: transfer_of(p)[0])


def _flight_computer() -> Simulated:
    device = FlightComputer(FlightComputerSettings(), layouts()[0])
    return Simulated(device, lambda p: [p.piece() if p.flag() else p.choice(_TOKENS)])


TARGETS = (
    Target("simulated.parachute", "the simulated MAVLink parachute", _parachute, 0, 512),
    Target("simulated.upf", "the simulated UPF controller and trigger", _upf, 0, 256),
    Target("simulated.flight_computer", "the simulated flight computer", _flight_computer, 0, 256),
)
