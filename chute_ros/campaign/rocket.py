"""A rocket with its flight computer on the umbilical."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from chute_ros.campaign.bus import SERIAL, Bus, Plug
from chute_ros.campaign.device_nodes import UMBILICAL_NODE, UmbilicalNode
from chute_ros.campaign.rig import Rig
from chute_ros.campaign.scenario import Failure, Scenario
from chute_ros.campaign.sensors import Sensors
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.truth import observe_rocket
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.sim.flight_computer import FlightComputer
from chute_ros.sim.flight_computer_settings import FlightComputerSettings

#: It is looked at so often, s.
_LOOKS = 0.05
#: The flight computer's own drogue is out before it comes down faster, m/s.
_COMES_DOWN = 1.0
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


class ListeningNode(UmbilicalNode):
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


class RocketRig(Rig):
    """The flight computer fires the drogue at the apogee; the supervisor, if that does not."""

    def __init__(self, scenario: Scenario, shipped: Shipped) -> None:
        super().__init__(scenario, shipped)
        bus = Bus(self.world, SERIAL, f"{scenario.seed} umbilical")
        fails = scenario.failure is Failure.NO_DROGUE
        settings = FlightComputerSettings(drogue_fails=fails)
        self.computer = CampaignFlightComputer(settings, shipped.layouts[0], self.sensors)
        self.rocket = self.computer.flight.rocket
        self.rocket.burn_time = scenario.burn
        plug = SpeakingPlug(bus, "flight_computer", self.computer)
        self.add_device(plug, self.computer.reboot)
        process = self.process(UMBILICAL_NODE)
        node = ListeningNode(bus, process, self.ros, shipped.layouts)
        self.add_node(node)
        self._lines = plug.lines = node.lines = Lines()
        self._look_at = 0.0
        self._failed = fails
        self._speed = 0.0
        self.world.add(self)

    def told(self) -> Sequence[float]:
        return self._lines.whole

    # -- the flight ------------------------------------------------------------------------------

    def take_off(self, now: float) -> None:
        node: Any = self.nodes[UMBILICAL_NODE]
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
