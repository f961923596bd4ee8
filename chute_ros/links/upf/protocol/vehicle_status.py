"""flyfire.VehicleStatus: what the vehicle tells the controller ten times a second.

What is missing or too old is told as not known (state UNKNOWN, NaN), never as its last value.
Source: flyfire.VehicleStatus, and Flyfire UPF UAVCAN protocol V1.0, "UPF custom protocol".
"""

from __future__ import annotations

import math
from typing import Any

from chute_ros.errors import MessageError
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.definitions import VEHICLE_STATUS, Definitions
from chute_ros.links.upf.protocol.device_table import DeviceTable
from chute_ros.model import NAN, Armed, LandedState, LinkState, ParachuteState, VehicleState
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.events import Severity

#: Largest number that a float16 carries with sense, m or m/s.
_LARGEST = 60000.0
_FLYING = (ParachuteState.TAKEOFF, ParachuteState.ARMED)


class VehicleStatusSender:
    """Keeps what the vehicle says of itself, and tells it to the controllers."""

    def __init__(self, config: UpfConfig, devices: DeviceTable, endpoint: Endpoint) -> None:
        self._config, self._devices, self._endpoint = config, devices, endpoint
        self._definitions = devices.definitions
        self._state, self._received = VehicleState(), -math.inf
        self._tell_at = -math.inf
        self._owner_until = -math.inf
        self._unsendable = False

    def take(self, state: VehicleState, now: float) -> None:
        """A vehicle/state came."""
        self._state, self._received = state, now

    def owner_alive(self, until: float) -> None:
        """We may seem alive until this time."""
        self._owner_until = until

    def in_air(self, now: float) -> bool:
        """By the vehicle or by the controller; also if the vehicle has stopped to say so.

        A vehicle that never said anything is on a bench.
        """
        vehicle, passed = self._state, now - self._received
        limit = self._config.vehicle_state_age
        landed_fresh = vehicle.landed_state_age + passed <= limit
        armed_fresh = vehicle.armed_age + passed <= limit
        flies = vehicle.landed_state not in (LandedState.UNKNOWN, LandedState.ON_GROUND)
        if (flies and landed_fresh) or (vehicle.armed is Armed.ARMED and armed_fresh):
            return True
        controllers = self._devices.controllers.values()
        if any(one.alive and one.state in _FLYING for one in controllers):
            return True
        spoke = self._received > -math.inf
        return spoke and not (
            (landed_fresh and vehicle.landed_state is LandedState.ON_GROUND)
            or (armed_fresh and vehicle.armed is Armed.DISARMED)
        )

    def armed_at(self, now: float) -> float:
        """When the vehicle said that it is armed, if that is still young enough to be so; NaN."""
        age = self._state.armed_age + now - self._received
        known = self._state.armed is Armed.ARMED and age <= self._config.vehicle_state_age
        return now - age if known and self._state.link_state is not LinkState.LOST else NAN

    def update(self, now: float) -> None:
        """Tell it, if it is time to."""
        if now < self._tell_at:
            return
        if now >= self._owner_until:
            # Silent, and at once again when the owner is back.
            self._tell_at = self._owner_until
            return
        self._tell_at = now + 1.0 / self._config.vehicle_status_rate
        connected = any(one.alive for one in self._devices.controllers.values())
        age = self._config.vehicle_state_age
        try:
            values = vehicle_status(
                self._definitions, self._state, self._received, age, connected, now
            )
            self._endpoint.broadcast(VEHICLE_STATUS, values)
        except MessageError as error:
            # The vendor's types have no way to say "not known": then nothing is said at all.
            if not self._unsendable:
                self._unsendable = True
                self._devices.notice(Severity.WARNING, f"VehicleStatus is not sent: {error}")

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return self._tell_at if self._tell_at < self._owner_until else math.inf


def vehicle_status(
    definitions: Definitions,
    vehicle: VehicleState,
    received: float,
    limit: float,
    parachute_connected: bool,
    now: float,
) -> dict[str, Any]:
    """The fields that the types in use have. received: of vehicle, monotonic s; limit: s.

    MessageError if the state is not known and the types cannot say so.
    """
    passed = now - received
    lost = vehicle.link_state is LinkState.LOST

    def fresh(age: float) -> bool:
        return not lost and age + passed <= limit

    known = vehicle.landed_state is not LandedState.UNKNOWN and fresh(vehicle.landed_state_age)
    name = "STATE_UNKNOWN"
    if known:
        on_ground = vehicle.landed_state is LandedState.ON_GROUND
        name = "STATE_ON_GROUND" if on_ground else "STATE_IN_AIR"
    values = {
        "state": _number(definitions, name),
        "is_parachute_connected": parachute_connected,
        "height_of_home": _told(vehicle.height, fresh(vehicle.height_age)),
        "vz": _told(vehicle.vertical_speed, fresh(vehicle.vertical_speed_age)),
    }
    present = definitions.present(VEHICLE_STATUS, values)
    if present.get("state", 0) is None:
        raise MessageError(f"{VEHICLE_STATUS} has no {name}, and 0 means another state")
    return present


def _number(definitions: Definitions, name: str) -> Any:
    """The number of a state; one that has none is told as 0, unless that is another; None."""
    number = definitions.constant(VEHICLE_STATUS, name)
    if number is None and not definitions.state_name(VEHICLE_STATUS, {"state": 0}):
        return 0
    return number


def _told(value: float, fresh: bool) -> float:
    return value if fresh and math.isfinite(value) and abs(value) <= _LARGEST else NAN
