"""Which of the devices on the network are ours.

More than one vehicle may be heard. A command that fires goes only to a system that was named by a
parameter, or, where none was, to the first one heard; a second system then makes the choice
doubtful, which is said and forbids take-off until the parameter is set.
"""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar

from chute_ros.protocol.liveness import Liveness


class Device(Protocol):
    """What a roster knows of a device."""

    liveness: Liveness

    @property
    def device(self) -> str:
        """ "system/component"."""


DeviceT = TypeVar("DeviceT", bound=Device)

#: More devices of one kind than this are not followed: a flood of made-up ids must not grow us.
MOST_DEVICES = 16


class Roster(Generic[DeviceT]):
    """The devices of one kind, by (system id, component id). An id of 0 means any."""

    def __init__(self, kind: str, system_id: int, component_id: int) -> None:
        self.kind, self.system_id, self.component_id = kind, system_id, component_id
        self.refused_count = 0
        #: The system was named by a parameter, not taken as the first one heard.
        self.fixed = system_id != 0
        self._ours: dict[tuple[int, int], DeviceT] = {}
        self._other_systems: set[int] = set()

    def fits(self, system_id: int, component_id: int) -> bool:
        """May a device with these ids be ours, as far as is known?"""
        return self._possible(system_id, component_id) and self.system_id in (0, system_id)

    def admits(self, system_id: int, component_id: int) -> bool:
        """Is a device with these ids ours? If no system was named, the first one heard is."""
        if not self._possible(system_id, component_id):
            return False
        if self.system_id == 0:
            self.system_id = system_id
        if self.system_id != system_id:
            if len(self._other_systems) < MOST_DEVICES:
                self._other_systems.add(system_id)
            return False
        full = len(self._ours) >= MOST_DEVICES and (system_id, component_id) not in self._ours
        self.refused_count += full
        return not full

    def _possible(self, system_id: int, component_id: int) -> bool:
        # A command to system 0 would go to every vehicle.
        return system_id != 0 and self.component_id in (0, component_id)

    def get(self, system_id: int, component_id: int) -> DeviceT | None:
        """The device with these ids, if it is ours and was heard."""
        return self._ours.get((system_id, component_id))

    def add(self, system_id: int, component_id: int, device: DeviceT) -> None:
        """A device that admits let in was received for the first time."""
        self._ours[system_id, component_id] = device

    def all(self) -> list[DeviceT]:
        """Our devices in the order in which they were first heard."""
        return list(self._ours.values())

    def named(self, device: str) -> DeviceT | None:
        """Our device with this name ("1/161")."""
        return next((ours for ours in self._ours.values() if ours.device == device), None)

    def doubt(self) -> str:
        """Why the choice is doubtful; empty: it is not."""
        if self.fixed or not self._other_systems:
            return ""
        systems = sorted({self.system_id, *self._other_systems})
        return (
            f"{self.kind}s of systems {', '.join(map(str, systems))} received, using "
            f"{self.system_id}: set {self.kind}_system_id"
        )
