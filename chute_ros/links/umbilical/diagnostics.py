"""/diagnostics of an umbilical: the port, the flight computer, our heartbeat, memory."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.ros import diagnostics


@dataclass(frozen=True)
class Details:
    """A picture of the link, made in its thread and read in the executor's."""

    status: model.ParachuteStatus
    received_bytes: int
    records: int
    layout: str
    counts: Counter[str]
    liveness: Mapping[str, object]
    record_age: float
    interval: float
    mode: str
    restarts: int
    commands_sent: int
    waiting: int
    heartbeats: int
    heartbeat_age: float
    latest_heartbeat: float
    heartbeats_held: bool
    work: str


def details_of(link: UmbilicalLink, now: float) -> Details:
    """In the link's turn: all that the tasks below say."""
    computer, scheduler = link.computer, link.scheduler
    record, layout = computer.record, link.decoder.layout
    mode = computer.mode
    return Details(
        status=computer.status(now, link.pause),
        received_bytes=link.received_bytes,
        records=computer.records,
        layout="not recognised yet" if layout is None else layout.name,
        counts=Counter(link.counts),
        liveness=diagnostics.liveness_values(computer.liveness, now),
        record_age=math.nan if record is None else now - record.received,
        interval=computer.interval,
        mode="not known" if mode is None else mode.label,
        restarts=computer.restarts,
        commands_sent=scheduler.commands_sent,
        waiting=scheduler.waiting,
        heartbeats=scheduler.heartbeats_sent,
        heartbeat_age=now - scheduler.last_heartbeat,
        latest_heartbeat=scheduler.limits.latest_heartbeat,
        heartbeats_held=scheduler.heartbeats_held,
        work=link.pause,
    )


def port_task(
    name: str, details: Details, traffic: Mapping[str, object], wire: diagnostics.WirePicture
) -> DiagnosticStatus:
    """The port, and what was dropped on it."""
    troubles = []
    if details.received_bytes and not details.records:
        troubles.append("bytes are received, but no telemetry record yet")
    values = {
        "bytes received": details.received_bytes,
        "records": details.records,
        "layout": details.layout,
        **traffic,
        "commands sent": details.commands_sent,
        "commands waiting": details.waiting,
    }
    received = details.received_bytes
    return diagnostics.wire_task(name, wire, troubles, received, values, details.counts)


def computer_task(name: str, details: Details) -> DiagnosticStatus:
    """The flight computer by its telemetry."""
    status = details.status
    if not status.device:
        return diagnostics.never_heard(name)
    values = {
        **details.liveness,
        "telemetry age (s)": details.record_age,
        "telemetry interval (s)": details.interval,
        "flight mode": details.mode,
        "state": status.state.name,
        "deployed": status.deployed,
        "altitude (m)": status.height,
        "restarts": details.restarts,
        "uptime (s)": status.uptime,
    }
    paused = status.link_state is model.LinkState.OK and details.work
    level = diagnostics.OK if not status.faults else diagnostics.ERROR
    level = diagnostics.WARN if paused else level
    text = "; ".join(status.faults) or f"{details.mode}, {status.state.name}"
    return diagnostics.status(name, "parachute", level, text, values, status.device)


def heartbeat_task(name: str, details: Details, is_open: bool) -> DiagnosticStatus:
    """Our heartbeat to the flight computer, without which it takes the umbilical for lost."""
    age = details.heartbeat_age
    level, text = diagnostics.OK, "sent"
    if not is_open:
        level, text = diagnostics.ERROR, "not sent: the port is closed"
    elif details.heartbeats_held:
        text = "not sent in flight (parameter heartbeat_in_flight)"
    elif math.isnan(age):
        level, text = diagnostics.STALE, "none sent yet"
    elif age > details.latest_heartbeat:
        level, text = diagnostics.ERROR, f"the newest was sent {age:.1f} s ago"
    values = {"sent": details.heartbeats, "newest (s ago)": age}
    return diagnostics.status(name, "umbilical heartbeat", level, text, values, "")


def memory_task(name: str, details: Details, progress: str) -> DiagnosticStatus:
    """A dump or a wipe that is under way."""
    text = details.work or "no dump or wipe under way"
    level = diagnostics.WARN if details.work else diagnostics.OK
    return diagnostics.status(name, "memory", level, text, {"newest progress": progress}, "")
