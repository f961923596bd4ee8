"""/diagnostics of a MAVLink link: the wire, each parachute, the autopilot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.protocol.parachute import ParachuteTracker
from chute_ros.model import NAN, LinkState, flag_names
from chute_ros.protocol.mavlink.frames import UNKNOWN_MESSAGE
from chute_ros.ros import diagnostics

_NEVER: tuple[bytes, str, dict[str, object], str] = (diagnostics.STALE, "never received", {}, "")

#: Reasons for which something is dropped that could be read.
READABLE = (
    UNKNOWN_MESSAGE,
    "frames with our own system and component id",
    "acknowledgements for another component",
    "duplicate acknowledgements",
    "duplicate heartbeats",
)


@dataclass(frozen=True)
class MavlinkDetails:
    """A picture of the link, made in its thread and read in the executor's."""

    doubts: tuple[str, ...]
    received: int
    sent: int
    #: What came, and was of no use.
    useless: Mapping[str, object]
    dropped: Counter[str]
    parachutes: tuple[diagnostics.Task, ...]
    autopilot: diagnostics.Task
    kill: diagnostics.Task


def details_of(link: MavlinkLink, now: float) -> MavlinkDetails:
    """In the link's turn: all that the tasks say."""
    refused = link.parachutes.refused_count + link.autopilots.refused_count
    return MavlinkDetails(
        tuple(link.doubts(now)),
        link.received_count,
        link.sent_count,
        {
            "late acknowledgements": link.requests.commands.late_count,
            "unexpected acknowledgements": link.requests.commands.unexpected_count,
            "heartbeats of devices beyond the limit of sixteen": refused,
        },
        Counter(link.counts),
        tuple(_parachute(one, now) for one in link.parachutes.all()),
        _autopilot(link, now),
        _kill(link),
    )


def link_task(
    name: str,
    details: MavlinkDetails,
    traffic: Mapping[str, object],
    wire: diagnostics.WirePicture,
) -> DiagnosticStatus:
    """The wire, and what was dropped on it."""
    values = {**traffic, **details.useless}
    return diagnostics.wire_task(
        name, wire, details.doubts, details.received, values, details.dropped, READABLE
    )


def tasks(name: str, details: MavlinkDetails, expects_parachute: bool) -> list[DiagnosticStatus]:
    """Each parachute of ours, the autopilot on the same network, and how it is killed."""
    parachutes = details.parachutes
    if not parachutes and expects_parachute:
        parachutes = (("parachute", *_NEVER),)
    told = (*parachutes, details.autopilot, details.kill)
    return [diagnostics.status(name, *task) for task in told]


def _parachute(one: ParachuteTracker, now: float) -> diagnostics.Task:
    status = one.status(now)
    values = {
        **diagnostics.liveness_values(one.liveness, now),
        "PARACHUTE_STATUS interval (s)": one.status_interval,
        "state": status.state.name,
        "armed triggers": ", ".join(flag_names(status.armed_triggers)),
        "errors": ", ".join(flag_names(status.error_flags)),
        "safety": ", ".join(flag_names(status.safety_flags)),
        "packed date": status.packed_date,
        "uptime (s)": status.uptime,
    }
    faults = [text for text in (*status.faults, one.deaf(now)) if text]
    level = diagnostics.OK if status.healthy and not faults else diagnostics.ERROR
    text = "; ".join(faults) or status.state.name
    text = f"released; {text}" if status.deployed else text
    return f"parachute {status.device}", level, text, values, status.device


def _autopilot(link: MavlinkLink, now: float) -> diagnostics.Task:
    vehicle, autopilot = link.vehicle_state(now), link.chosen_autopilot()
    rates, round_trip = {}, NAN
    if autopilot is not None:
        rates, round_trip = autopilot.rates(now), autopilot.round_trip.seconds(now)
    level, text = diagnostics.OK, f"{vehicle.armed.name}, {vehicle.landed_state.name}"
    if vehicle.link_state is LinkState.NEVER_SEEN:
        level, text = diagnostics.STALE, "never received"
    elif vehicle.link_state is not LinkState.OK:
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
        "rates (Hz)": ", ".join(f"{kind} {hz:.1f}" for kind, hz in sorted(rates.items())),
        "answers after (s, TIMESYNC)": round_trip,
        "not detected": "; ".join(not_seen(rates)),
    }
    return "autopilot", level, text, values, vehicle.source


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
    (("ATTITUDE_TARGET",), "no ATTITUDE_TARGET: a commanded attitude looks like an accident"),
    (
        ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "NAV_CONTROLLER_OUTPUT"),
        "no targets: an uncommanded level sink raises only an alarm",
    ),
)


def not_seen(rates: Mapping[str, float]) -> list[str]:
    """Accidents that the supervisor does not detect without these messages."""
    return [text for kinds, text in _SIGHTS if not any(kind in rates for kind in kinds)]


def _kill(link: MavlinkLink) -> diagnostics.Task:
    """Which way a kill goes, whether the autopilot's settings allow it, and the flight block."""
    setup = link.setup()
    if setup is None:
        return ("kill", *_NEVER)
    level, told = diagnostics.OK, [f"{setup.firmware}: {setup.kill}"]
    if setup.fault:
        level, told = diagnostics.ERROR, [f"forbids take-off: {setup.fault}"]
    elif setup.warnings:
        level = diagnostics.WARN
    values = {"kill": setup.kill, "flight block": setup.block, **setup.settings}
    return "kill", level, "; ".join([*told, *setup.warnings]), values, ""
