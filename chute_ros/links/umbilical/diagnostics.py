"""/diagnostics of an umbilical: the port, the flight computer, our heartbeat, memory."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.links.umbilical.protocol import events
from chute_ros.links.umbilical.protocol.decoder import NOT_YET
from chute_ros.links.umbilical.protocol.line_parser import UNKNOWN_LINE
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.ros import diagnostics

#: Reasons for which something is dropped that could be read, or that a beginning brings along.
READABLE = (
    UNKNOWN_LINE,
    NOT_YET,
    "record held until the next one agrees",
    "first line after the opening",
    "bytes right after the opening",
    "lines for the log beyond fifty a second",
    "mark of a dump that was not under way",
)


@dataclass(frozen=True)
class UmbilicalDetails:
    """A picture of the link, made in its thread and read in the executor's. work: a dump or a wipe
    that is under way, in words."""

    received: int
    records: int
    layout: str
    commands: Mapping[str, object]
    dropped: Counter[str]
    computer: diagnostics.Task
    heartbeat: diagnostics.Task
    work: str


def details_of(link: UmbilicalLink, now: float) -> UmbilicalDetails:
    """In the link's turn: all that the tasks say."""
    layout = link.decoder.layout
    scheduler = link.scheduler
    return UmbilicalDetails(
        link.received_bytes,
        link.computer.records,
        "not recognised yet" if layout is None else layout.name,
        {"commands sent": scheduler.commands_sent, "commands waiting": scheduler.waiting},
        Counter(link.counts),
        _computer(link, now),
        _heartbeat(link, now),
        link.pause,
    )


def port_task(
    name: str,
    details: UmbilicalDetails,
    traffic: Mapping[str, object],
    wire: diagnostics.WirePicture,
) -> DiagnosticStatus:
    """The port, and what was dropped on it."""
    received, records = details.received, details.records
    waits = received and not records
    troubles = ["bytes are received, but no telemetry record yet"] if waits else []
    values = {
        "bytes received": received,
        "records": records,
        "layout": details.layout,
        **traffic,
        **details.commands,
    }
    return diagnostics.wire_task(name, wire, troubles, received, values, details.dropped, READABLE)


def memory_task(
    name: str, details: UmbilicalDetails, progress: events.WorkProgress
) -> DiagnosticStatus:
    """A dump or a wipe that is under way. progress: the newest."""
    text = details.work or "no dump or wipe under way"
    level = diagnostics.WARN if details.work else diagnostics.OK
    percent = f"{100.0 * progress.done / progress.total:.0f}" if progress.total else ""
    values = {"newest progress": progress.text, "newest progress (%)": percent}
    return diagnostics.status(name, "memory", level, text, values, "")


def _computer(link: UmbilicalLink, now: float) -> diagnostics.Task:
    """The flight computer by its telemetry."""
    computer, record = link.computer, link.computer.record
    if record is None:
        return "parachute", diagnostics.STALE, "never received", {}, ""
    status = computer.status(now, link.pause)
    mode = "not known" if computer.mode is None else computer.mode.label
    values = {
        **diagnostics.liveness_values(computer.liveness, now),
        "telemetry age (s)": now - record.received,
        "telemetry interval (s)": computer.interval,
        "flight mode": mode,
        "state": status.state.name,
        "deployed": status.deployed,
        "altitude (m)": status.height,
        "restarts": computer.restarts,
        "uptime (s)": status.uptime,
    }
    level = diagnostics.OK if not status.faults else diagnostics.ERROR
    if status.link_state is model.LinkState.OK and link.pause:
        level = diagnostics.WARN
    text = "; ".join(status.faults) or f"{mode}, {status.state.name}"
    return "parachute", level, text, values, status.device


def _heartbeat(link: UmbilicalLink, now: float) -> diagnostics.Task:
    """Our heartbeat to the flight computer, without which it takes the umbilical for lost."""
    scheduler = link.scheduler
    age = now - scheduler.last_heartbeat
    level, text = diagnostics.OK, "sent"
    if not scheduler.is_open:
        level, text = diagnostics.ERROR, "not sent: the port is closed"
    elif scheduler.heartbeats_held:
        text = "not sent in flight (parameter heartbeat_in_flight)"
    elif math.isnan(age):
        level, text = diagnostics.STALE, "none sent yet"
    elif age > scheduler.limits.latest_heartbeat:
        level, text = diagnostics.ERROR, f"the newest was sent {age:.1f} s ago"
    values = {"sent": scheduler.heartbeats_sent, "newest (s ago)": age}
    return "umbilical heartbeat", level, text, values, ""
