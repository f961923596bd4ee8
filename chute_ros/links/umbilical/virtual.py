"""umbilical and a rocket with a simulated flight computer in virtual time."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any

from chute_ros.campaign.bus import SERIAL, Bus, Plug
from chute_ros.campaign.rig import Rig
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.scenario import Failure, Scenario
from chute_ros.campaign.sensors import Sensors
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.truth import observe_rocket
from chute_ros.campaign.virtual_node import VirtualNode
from chute_ros.links.api import VehicleKind
from chute_ros.links.umbilical import LINK
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol.config import UmbilicalConfig
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.links.umbilical.runtime import UmbilicalRuntime, UmbilicalSettings
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings

#: It is looked at so often, s.
_LOOKS = 0.05
#: The flight computer's own drogue is out before it comes down faster, m/s.
_COMES_DOWN = 1.0
_COMPUTER = "flight_computer"
#: After these nothing brakes it by itself.
_UNBRAKED = (*(Failure.NO_DROGUE, Failure.FAULT, Failure.COMPUTER_REBOOT, Failure.COMPUTER_POWER),)


class CampaignFlightComputer(FlightComputer):
    """Tells what its sensors say."""

    def __init__(self, settings: FlightComputerSettings, layout: Layout, sensors: Sensors) -> None:
        super().__init__(settings, layout)
        self._sensors = sensors

    def _telemetry(self) -> None:
        rocket, read, now = self.flight.rocket, self._sensors.read, self.now
        if self._sensors.faults:
            self.overrides = {
                "altitude": read("height", rocket.altitude, now),
                "vel_d": -read("speed", rocket.vertical_speed, now),
                "accel_z": read("force", rocket.specific_force, now),
                "fix_type": 0 if self._sensors.lies("fix", now) else 3,
            }
        super()._telemetry()


class Lines:
    """Lines on the cable: which of them came whole, and when."""

    def __init__(self) -> None:
        self._said: set[bytes] = set()
        self._saying = self._hearing = b""
        #: Virtual s.
        self.whole: list[float] = []

    def said(self, frames: Sequence[bytes]) -> None:
        """By the flight computer."""
        *lines, self._saying = (self._saying + b"".join(frames)).split(b"\n")
        self._said.update(lines)

    def heard(self, frames: Sequence[bytes], now: float) -> None:
        """By the node."""
        *lines, self._hearing = (self._hearing + b"".join(frames)).split(b"\n")
        self.whole += [now for line in lines if line in self._said]


class VirtualUmbilical(VirtualNode):
    """umbilical, of a rocket without an autopilot beside it."""

    def __init__(self, bus: Bus, process: Process, ros: Ros, layouts: list[Layout]) -> None:
        def make_link() -> UmbilicalLink:
            link = UmbilicalLink(UmbilicalConfig(), layouts)
            link.wire_opened(ros.world.now)
            return link

        settings = UmbilicalSettings(publish_vehicle_state=True)
        runtime = functools.partial(UmbilicalRuntime, process.name, settings)
        super().__init__(bus, process, ros, make_link, runtime)

    def launch(self) -> None:
        """A person launches the rocket; force: and confirms it."""
        self.runtime.desk.request(
            lambda link, token, now: link.command(token, "launch", True, now), lambda end: None
        )
        self.after()

    def is_release(self, data: bytes) -> bool:
        return data in (b"<D>", b"<d>")


class ListeningNode(VirtualUmbilical):
    """Notes which lines came."""

    lines: Lines

    def hear(self, frames: Sequence[bytes], now: float) -> None:
        self.lines.heard(frames, now)
        super().hear(frames, now)


class SpeakingPlug(Plug):
    """Notes which lines left."""

    lines: Lines

    def send(self, frames: Sequence[bytes]) -> None:
        self.lines.said(frames)
        super().send(frames)


class UmbilicalPart:
    """A flight computer on a cable."""

    def ways(self, vehicle: VehicleKind) -> tuple[str, ...]:
        return (_COMPUTER, LINK.name)

    def stopping(self, vehicle: VehicleKind) -> tuple[str, ...]:
        # What becomes of the flight computer is what fails in the flight.
        return ()

    def read(self) -> None:
        assert _layouts() is not None

    def join(self, rig: RocketRig) -> None:
        bus = Bus(rig.world, SERIAL, f"{rig.scenario.seed} umbilical")
        plug = SpeakingPlug(bus, _COMPUTER, rig.computer)
        rig.add_device(plug, rig.computer.reboot)
        node = ListeningNode(bus, rig.process(LINK.name), rig.ros, _layouts())
        rig.add_node(node)
        plug.lines = node.lines = rig.lines


class RocketRig(Rig):
    """The flight computer fires the drogue at the apogee; the supervisor, if that does not."""

    def __init__(self, scenario: Scenario, shipped: Shipped) -> None:
        super().__init__(scenario, shipped)
        fails = scenario.failure is Failure.NO_DROGUE
        settings = FlightComputerSettings(drogue_fails=fails)
        self.computer = CampaignFlightComputer(settings, _layouts()[0], self.sensors)
        self.rocket = self.computer.flight.rocket
        self.rocket.burn_time = scenario.burn
        self.lines = Lines()
        self.join_links()
        self._look_at = 0.0
        self._failed = fails
        self._speed = 0.0
        self.world.add(self)

    def told(self) -> Sequence[float]:
        return self.lines.whole

    # -- the flight ------------------------------------------------------------------------------

    def take_off(self, now: float) -> None:
        node: Any = self.nodes[LINK.name]
        node.launch()

    def is_up(self) -> bool:
        return not math.isnan(self.rocket.burned_for)

    def fail(self, now: float) -> None:
        failure, computer = self.scenario.failure, self.computer
        if failure is Failure.FAULT:
            computer.flight.fail()
        elif failure is Failure.COMPUTER_REBOOT:
            computer.reboot()
        elif failure is Failure.COMPUTER_POWER:
            computer.silent = computer.deaf = computer.flight.is_stuck = True
        elif failure is Failure.COMPUTER_SILENT:
            computer.silent = True
        self._failed |= failure in _UNBRAKED

    def update(self, now: float) -> None:
        """Look at the rocket."""
        self._look_at = now + _LOOKS
        rocket = self.rocket
        if not self.is_up():
            return
        out = not (math.isnan(rocket.drogue_out_for) and math.isnan(rocket.main_out_for))
        if out and math.isnan(self.released):
            self.released, self.release_height = now, rocket.height
        down = rocket.on_ground and rocket.apogee > 1.0
        if down and math.isnan(self.landed):
            self.landed, self.landing_speed = now, self._speed
        falls = self._failed and not out and not down and rocket.vertical_speed < -_COMES_DOWN
        if falls and not self.truth.falls:
            self.truth = observe_rocket(rocket, now)
        self._speed = max(0.0, -rocket.vertical_speed)

    def next_deadline(self) -> float:
        """The next look."""
        return self._look_at


@functools.cache
def _layouts() -> list[Layout]:
    return load_layouts("", "the layouts")
