"""/diagnostics of a MAVLink link: the wire, each parachute, the autopilot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.protocol.parachute import ParachuteTracker
from chute_ros.links.mavlink.protocol.setup_check import Setup
from chute_ros.ros import diagnostics


@dataclass(frozen=True)
class ParachuteDetails:
    """One parachute: its picture, s between its statuses, and how well it is heard."""

    status: model.ParachuteStatus
    status_interval: float
    liveness: Mapping[str, object]


@dataclass(frozen=True)
class Details:
    """A picture of the link, made in its thread and read in the executor's."""

    parachutes: tuple[ParachuteDetails, ...]
    vehicle: model.VehicleState
    #: Of each message that is read of the autopilot, Hz.
    rates: Mapping[str, float]
    #: How long the autopilot takes to answer, s; NaN: it does not.
    round_trip: float
    doubts: tuple[str, ...]
    received: int
    sent: int
    dropped: Counter[str]
    late_acknowledgements: int
    not_followed: int
    setup: Setup | None


def details_of(link: MavlinkLink, now: float) -> Details:
    """In the link's turn: all that the tasks below say."""

    def parachute(one: ParachuteTracker) -> ParachuteDetails:
        values = diagnostics.liveness_values(one.liveness, now)
        return ParachuteDetails(one.status(now), one.status_interval, values)

    return Details(
        tuple(map(parachute, link.parachutes.all())),
        link.vehicle_state(now),
        link.autopilot_rates(now),
        link.autopilot_round_trip(now),
        tuple(link.doubts(now)),
        link.received_count,
        link.sent_count,
        Counter(link.counts),
        link.requests.commands.late_count,
        link.parachutes.refused_count + link.autopilots.refused_count,
        link.setup(),
    )


def link_task(
    name: str, details: Details, traffic: Mapping[str, object], wire: diagnostics.WirePicture
) -> DiagnosticStatus:
    """The wire, and what was dropped on it."""
    values = {
        **traffic,
        "late acknowledgements": details.late_acknowledgements,
        "heartbeats of devices beyond the limit of sixteen": details.not_followed,
    }
    return diagnostics.wire_task(
        name, wire, details.doubts, details.received, values, details.dropped
    )


def parachute_tasks(name: str, details: Details, expected: bool) -> list[DiagnosticStatus]:
    """One task for each parachute of ours."""
    if not details.parachutes and expected:
        return [diagnostics.never_heard(name)]
    return [_parachute_task(name, one) for one in details.parachutes]


def _parachute_task(name: str, one: ParachuteDetails) -> DiagnosticStatus:
    status = one.status
    return diagnostics.status(
        name,
        f"parachute {status.device}",
        diagnostics.OK if status.healthy else diagnostics.ERROR,
        "; ".join(status.faults) or status.state.name,
        {
            **one.liveness,
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


def autopilot_task(name: str, details: Details) -> DiagnosticStatus:
    """The autopilot on the same network."""
    vehicle = details.vehicle
    level, text = diagnostics.OK, f"{vehicle.armed.name}, {vehicle.landed_state.name}"
    if vehicle.link_state is model.LinkState.NEVER_SEEN:
        level, text = diagnostics.STALE, "never received"
    elif vehicle.link_state is not model.LinkState.OK:
        level, text = diagnostics.ERROR, f"heartbeat {vehicle.link_state.name}"
    elif vehicle.rebooted_in_flight:
        level, text = diagnostics.ERROR, "restarted in flight"
    elif vehicle.faults:
        level, text = diagnostics.ERROR, "; ".join(vehicle.faults)
    values = {
        "heartbeat age (s)": vehicle.armed_age,
        "height (m)": vehicle.height,
        "height age (s)": vehicle.height_age,
        "altitude (m)": vehicle.altitude,
        "pressure (Pa)": vehicle.pressure,
        "attitude age (s)": vehicle.attitude_age,
        "landed state age (s)": vehicle.landed_state_age,
        "battery (V)": vehicle.battery_voltage,
        "restarts": vehicle.reboot_count,
        "rates (Hz)": ", ".join(f"{kind} {hz:.1f}" for kind, hz in sorted(details.rates.items())),
        "answers after (s, TIMESYNC)": details.round_trip,
        "not detected": "; ".join(not_seen(details.rates)),
    }
    return diagnostics.status(name, "autopilot", level, text, values, vehicle.source)


#: Messages, one of which at least is needed for what the text says.
_SIGHTS = (
    (
        ("SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3", "HIGHRES_IMU"),
        "no SCALED_PRESSURE: a wrong estimator is not contradicted by a barometer",
    ),
    (
        ("SCALED_IMU2", "SCALED_IMU3"),
        "no SCALED_IMU2: a wrong accelerometer is not contradicted by another",
    ),
    (
        ("ATTITUDE_TARGET",),
        "no ATTITUDE_TARGET: a commanded attitude looks like an accident",
    ),
    (
        ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "NAV_CONTROLLER_OUTPUT"),
        "no targets: an uncommanded level sink raises only an alarm",
    ),
)


def not_seen(rates: Mapping[str, float]) -> list[str]:
    """Accidents that the supervisor does not detect without these messages."""
    return [text for kinds, text in _SIGHTS if not any(kind in rates for kind in kinds)]


def kill_task(name: str, setup: Setup | None) -> DiagnosticStatus:
    """Which way a kill goes, whether the autopilot's settings allow it, and the flight block."""
    if setup is None:
        return diagnostics.never_heard(name, "kill")
    level, told = diagnostics.OK, [f"{setup.firmware}: {setup.kill}"]
    if setup.fault:
        level, told = diagnostics.ERROR, [f"forbids take-off: {setup.fault}"]
    elif setup.warnings:
        level = diagnostics.WARN
    values = {"kill": setup.kill, "flight block": setup.block, **setup.settings}
    return diagnostics.status(name, "kill", level, "; ".join([*told, *setup.warnings]), values, "")
