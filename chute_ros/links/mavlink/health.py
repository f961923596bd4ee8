"""Why the device of a MAVLink link is not healthy, in words that say what a person can do."""

from __future__ import annotations

import math

from chute_ros import model
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.protocol.parachute import ParachuteTracker


def health(
    link: MavlinkLink, vehicle: model.VehicleState, expect_parachute: bool, now: float
) -> tuple[model.LinkState, float, tuple[str, ...]]:
    """State of the device's link, s since it was heard, and every reason why it is not healthy;
    none: it is. vehicle: the link's picture at now."""
    # Doubt about which devices are ours forbids take-off, but takes nothing back in flight.
    doubts = [] if vehicle.armed is model.Armed.ARMED else link.doubts(now)
    autopilot = _autopilot(vehicle)
    if not expect_parachute:
        reasons = [autopilot] if autopilot else []
        return vehicle.link_state, vehicle.armed_age, (*reasons, *doubts)
    chosen = link.chosen_parachute()
    state, age = model.LinkState.NEVER_SEEN, model.NAN
    if chosen is None:
        reasons = [_NO_PARACHUTE]
    else:
        state, age = chosen.liveness.state, chosen.liveness.age(now)
        reasons = _parachute(chosen, now)
    reasons += doubts
    if reasons and autopilot:
        reasons.append(autopilot)
    return state, age, tuple(reasons)


_NO_PARACHUTE = (
    "no parachute was received: check its power and wiring, parachute_system_id, and that its "
    "HEARTBEAT (type MAV_TYPE_PARACHUTE, 43) reaches this connection"
)

_HEARTBEATS_ALONE = (
    "sends heartbeats but no PARACHUTE_STATUS (430), although requested: check its "
    "firmware, and that every router on the way passes it on (ArduPilot does with "
    "MAVn_OPTIONS bit 3; PX4 does not)"
)


def _parachute(one: ParachuteTracker, now: float) -> list[str]:
    status = one.status(now)
    if status.healthy:
        return []
    reasons = [f"{one.device} {fault}" for fault in status.faults]
    if math.isnan(one.status_received) and status.link_state is model.LinkState.OK:
        # Its own fault says so too, in fewer words.
        reasons = [f"{one.device} {_HEARTBEATS_ALONE}"]
    if status.deployed:
        reasons.append(f"{one.device} is released")
    if not reasons:
        reasons = [f"{one.device} is {status.state.name}"]
    return reasons


def _autopilot(vehicle: model.VehicleState) -> str:
    """Why no kill can be ordered; empty: it can."""
    if vehicle.link_state is model.LinkState.NEVER_SEEN:
        return (
            "no autopilot was received to send a kill to: check its wiring, "
            "autopilot_system_id and autopilot_component_id"
        )
    if vehicle.link_state is not model.LinkState.OK:
        state, age = vehicle.link_state.name, vehicle.armed_age
        return f"autopilot {vehicle.source} is {state}: its heartbeat is {age:.1f} s old"
    return ""
