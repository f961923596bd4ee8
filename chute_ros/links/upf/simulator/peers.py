"""Whom a simulated UPF controller hears on its bus: one vehicle, and the triggers."""

from __future__ import annotations

import math

#: The vehicle is connected while its VehicleStatus is younger, s.
VEHICLE_TIMEOUT = 1.0
#: A trigger is connected while its TriggerStatus is younger, s.
TRIGGER_TIMEOUT = 1.0


class Peers:
    """Forgets nobody before the next start: who was there and is not is an error."""

    def __init__(self) -> None:
        #: Node id of the vehicle; 0: none was heard yet.
        self.vehicle = 0
        #: Triggers by node id -> when they were heard.
        self.triggers: dict[int, float] = {}
        self._vehicle_heard = -math.inf

    def vehicle_connected(self, now: float) -> bool:
        """VehicleStatus is heard."""
        return now - self._vehicle_heard < VEHICLE_TIMEOUT

    def vehicle_status(self, source: int, now: float) -> bool:
        """A VehicleStatus came; whether the vehicle is there only now."""
        was_there = self.vehicle_connected(now)
        if was_there and source != self.vehicle:
            # A second vehicle speaks into the first one.
            return False
        self.vehicle, self._vehicle_heard = source, now
        return not was_there

    def errors(self, now: float) -> set[str]:
        """Who is missing, by the names of ParachuteStatus without ERROR_."""
        found = set()
        if self.vehicle and not self.vehicle_connected(now):
            found.add("VEHICLE_CONNECTION")
        if any(now - heard >= TRIGGER_TIMEOUT for heard in self.triggers.values()):
            found.add("TRIGGER_CONNECTION")
        return found
