"""flyfire.VehicleStatus: what the vehicle tells the controller ten times a second.

What is missing or too old is told as not known (state UNKNOWN, NaN), never as its last value.
Source: flyfire.VehicleStatus, and Flyfire UPF UAVCAN protocol V1.0, "UPF custom protocol".
"""

from __future__ import annotations

import math
from typing import Any

from chute_ros.model import NAN, LandedState, LinkState, VehicleState
from chute_ros.protocol.upf.definitions import VEHICLE_STATUS, Definitions

#: Largest number that a float16 carries with sense, m or m/s.
_LARGEST = 60000.0


def vehicle_status(
    definitions: Definitions,
    vehicle: VehicleState,
    received: float,
    limit: float,
    parachute_connected: bool,
    now: float,
) -> dict[str, Any]:
    """The fields that the types in use have. received: of vehicle, monotonic s; limit: s."""
    passed = now - received
    lost = vehicle.link_state is LinkState.LOST

    def fresh(age: float) -> bool:
        return not lost and age + passed <= limit

    known = vehicle.landed_state is not LandedState.UNKNOWN and fresh(vehicle.landed_state_age)
    name = "STATE_UNKNOWN"
    if known:
        on_ground = vehicle.landed_state is LandedState.ON_GROUND
        name = "STATE_ON_GROUND" if on_ground else "STATE_IN_AIR"
    number = definitions.constant(VEHICLE_STATUS, name)
    values = {
        "state": 0 if number is None else number,
        "is_parachute_connected": parachute_connected,
        "height_of_home": _told(vehicle.height, fresh(vehicle.height_age)),
        "vz": _told(vehicle.vertical_speed, fresh(vehicle.vertical_speed_age)),
    }
    return definitions.present(VEHICLE_STATUS, values)


def _told(value: float, fresh: bool) -> float:
    return value if fresh and math.isfinite(value) and abs(value) <= _LARGEST else NAN
