"""Keeps the vehicle that stories are flown on, for as long as it is fit for the next."""

from __future__ import annotations

from pathlib import Path

from sitl.autopilots import PX4, Autopilot
from sitl.flight import Flight
from sitl.vehicle import Setup, Vehicle


class Hangar:
    """Of one autopilot, until it is closed. folder: for all that is written."""

    def __init__(self, autopilot: Autopilot, folder: Path) -> None:
        self.autopilot, self.folder = autopilot, folder
        self.version = autopilot.version
        self._vehicle: Vehicle | None = None
        self._count = 0

    def flight(self, setup: Setup) -> Flight:
        """On a vehicle that is put together so."""
        vehicle = self._vehicle
        if vehicle is None or vehicle.setup != setup or not vehicle.renew():
            self.close()
            vehicle = self._new(setup)
        return Flight(vehicle)

    def close(self) -> None:
        """The vehicle is of no use any more, if there is one."""
        vehicle, self._vehicle = self._vehicle, None
        if vehicle is not None:
            vehicle.close()

    def _new(self, setup: Setup) -> Vehicle:
        self._count += 1
        folder = self.folder / f"{self.autopilot.kind}_{self._count}"
        folder.mkdir(parents=True)
        vehicle = self._vehicle = Vehicle(self.autopilot, setup, folder)
        self.version = vehicle.version()
        if setup.line_rate and self.autopilot.kind == PX4:
            vehicle.simulator.slow_down()
        return vehicle
