"""The simulated autopilots and parachutes of several vehicles, at usual rates, in one process.

python -m faults.fleet_simulators NUMBER=PORT ...    a vehicle's node listens on PORT of loopback

Standard input: "NUMBER ACTION", an action of sim_autopilot. Standard output: "TIME NUMBER WHAT",
what the devices do, by the monotonic clock: what has really happened to a vehicle.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.sim.bundle import WireBundle
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.transport.address import parse_address
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire import make_wire
from chute_ros.transport.wire_events import LoopFault, WireChange


class Vehicle:
    """An autopilot and a parachute, which hear each other, and their node's port."""

    def __init__(self, number: int, port: int) -> None:
        (air,) = free_udp_ports(1)
        network = f"udpout:127.0.0.1:{port}"
        self.autopilot = _loop(
            number, AutopilotDevice(number, []), network, f"udpin:127.0.0.1:{air}"
        )
        parachute = ParachuteDevice(ParachuteSettings(system_id=number), [])
        self.parachute = _loop(number, parachute, network, f"udpout:127.0.0.1:{air}")

    def start(self) -> None:
        """Both."""
        self.autopilot.start()
        self.parachute.start()

    def act(self, action: str) -> None:
        """Have the autopilot do something."""
        self.autopilot.call(lambda device, now: device.act(action))

    def stop(self) -> None:
        """Both."""
        self.autopilot.stop()
        self.parachute.stop()


def _loop(number: int, device: Any, *connections: str) -> WireLoop[Any]:
    def show(events: list[Any]) -> None:
        for event in events:
            if not isinstance(event, WireChange):
                text = event.text if isinstance(event, LoopFault) else event
                # One write: several threads share the line.
                sys.stdout.write(f"{time.monotonic():.6f} {number} {text}\n")
                sys.stdout.flush()

    return WireLoop(device, WireBundle([make_wire(parse_address(c)) for c in connections]), show)


def main() -> None:
    """Until standard input ends."""
    vehicles = {}
    for argument in sys.argv[1:]:
        number, _, port = argument.partition("=")
        vehicles[number] = Vehicle(int(number), int(port))
    for vehicle in vehicles.values():
        vehicle.start()
    try:
        for line in sys.stdin:
            number, action = line.split()
            vehicles[number].act(action)
    finally:
        for vehicle in vehicles.values():
            vehicle.stop()


if __name__ == "__main__":
    main()
