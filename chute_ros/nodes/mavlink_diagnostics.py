"""What /diagnostics says of a MAVLink link: the wire, each parachute, the autopilot."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.nodes import diagnostics
from chute_ros.protocol.mavlink.link import MavlinkLink
from chute_ros.protocol.mavlink.parachute import ParachuteTracker


@dataclass(frozen=True)
class ParachuteDetails:
    """One parachute: its picture, and times in s (NaN: has not happened)."""

    status: model.ParachuteStatus
    status_interval: float
    heartbeat_age: float
    state_age: float
    regained_ago: float
    lost_count: int


@dataclass(frozen=True)
class Details:
    """A picture of the link, made in its thread and read in the executor's."""

    parachutes: tuple[ParachuteDetails, ...]
    vehicle: model.VehicleState
    doubts: tuple[str, ...]
    received: int
    sent: int
    dropped: Counter[str]
    late_acknowledgements: int
    not_followed: int


def details_of(link: MavlinkLink, now: float) -> Details:
    """In the link's thread: all that the tasks below say."""

    def parachute(one: ParachuteTracker) -> ParachuteDetails:
        live = one.liveness
        return ParachuteDetails(
            one.status(now),
            one.status_interval,
            live.age(now),
            now - live.since,
            now - live.regained_at,
            live.lost_count,
        )

    return Details(
        tuple(map(parachute, link.parachutes.all())),
        link.vehicle_state(now),
        tuple(link.doubts()),
        link.received_count,
        link.sent_count,
        Counter(link.counts),
        link.requests.commands.late_count,
        link.parachutes.refused_count + link.autopilots.refused_count,
    )


def link_task(
    name: str,
    details: Details,
    traffic: dict[str, object],
    is_open: bool,
    wire_text: str,
    connection: str,
) -> DiagnosticStatus:
    """The wire, and what was dropped on it."""
    level, text = (diagnostics.OK if is_open else diagnostics.ERROR), wire_text
    if details.doubts:
        level, text = diagnostics.ERROR, "; ".join(details.doubts)
    elif is_open and not details.received:
        level, text = diagnostics.WARN, f"{text}, nothing received yet"
    values = {
        **traffic,
        "acknowledgements that came late": details.late_acknowledgements,
        "heartbeats of devices beyond the sixteen that are followed": details.not_followed,
    }
    values |= {f"dropped: {reason}": n for reason, n in sorted(details.dropped.items())}
    return diagnostics.status(name, "link", level, text, values, connection)


def parachute_tasks(name: str, details: Details, expected: bool) -> list[DiagnosticStatus]:
    """One task for each parachute of ours."""
    if not details.parachutes and expected:
        stale = diagnostics.STALE
        return [diagnostics.status(name, "parachute", stale, "never heard", {}, "")]
    return [_parachute_task(name, one) for one in details.parachutes]


def _parachute_task(name: str, one: ParachuteDetails) -> DiagnosticStatus:
    status = one.status
    return diagnostics.status(
        name,
        f"parachute {status.device}",
        diagnostics.OK if status.healthy else diagnostics.ERROR,
        "; ".join(status.faults) or status.state.name,
        {
            "link": status.link_state.name,
            "in this link state for (s)": one.state_age,
            "times lost": one.lost_count,
            "regained (s ago)": one.regained_ago,
            "heartbeat age (s)": one.heartbeat_age,
            "PARACHUTE_STATUS interval (s)": one.status_interval,
            "state": status.state.name,
            "armed triggers": ", ".join(model.flag_names(status.armed_triggers)),
            "errors": ", ".join(model.flag_names(status.error_flags)),
            "safety": ", ".join(model.flag_names(status.safety_flags)),
            "packed date": status.packed_date,
            "uptime (s)": status.uptime,
        },
        status.device,
    )


def autopilot_task(name: str, vehicle: model.VehicleState) -> DiagnosticStatus:
    """The autopilot on the same network."""
    level, text = diagnostics.OK, f"{vehicle.armed.name}, {vehicle.landed_state.name}"
    if vehicle.link_state is model.LinkState.NEVER_SEEN:
        level, text = diagnostics.STALE, "never heard"
    elif vehicle.link_state is not model.LinkState.OK:
        level, text = diagnostics.ERROR, f"heartbeat {vehicle.link_state.name}"
    elif vehicle.rebooted_in_flight:
        level, text = diagnostics.ERROR, "restarted in flight"
    values = {
        "heartbeat age (s)": vehicle.armed_age,
        "height (m)": vehicle.height,
        "height age (s)": vehicle.height_age,
        "attitude age (s)": vehicle.attitude_age,
        "landed state age (s)": vehicle.landed_state_age,
        "battery (V)": vehicle.battery_voltage,
        "restarts": vehicle.reboot_count,
    }
    return diagnostics.status(name, "autopilot", level, text, values, vehicle.source)
