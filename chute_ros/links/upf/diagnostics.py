"""/diagnostics of a UPF link: the bus, the devices, their requests to the vehicle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.devices import Controller, Device, Trigger
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.ros import diagnostics

_NO_CONTROLLER = (
    "never received, and without it this link has no parachute (controller_node_id: its node id, "
    "or 0; without_controller: true where the vehicle has none)"
)

#: Reasons for which something is dropped that could be read.
READABLE = (
    "transfers of unknown types",
    "messages that a newer one has overtaken",
    "duplicate transfers",
    "requests that this node does not serve",
    "status of devices not followed",
)


@dataclass(frozen=True)
class UpfDetails:
    """A picture of the link, made in its thread and read in the executor's."""

    troubles: tuple[str, ...]
    received: int
    sent: int
    dropped: Counter[str]
    bus: Mapping[str, object]
    #: Of the devices and of the vehicle service.
    tasks: tuple[diagnostics.Task, ...]
    given: Mapping[str, str]
    refusal: str
    allocation_left_to: int


def details_of(link: UpfLink, now: float) -> UpfDetails:
    """In the link's turn: all that the tasks say."""
    bus = link.bus
    nodes = {
        f"node {node.node_id}": f"{node.name or 'not known'} {node.unique_id.hex()}".strip()
        for node in bus.nodes.all()
    }
    return UpfDetails(
        troubles=tuple(bus.troubles()),
        received=bus.endpoint.received_count,
        sent=bus.endpoint.sent_count,
        dropped=bus.counts + link.requests.commands.counts + link.devices.counts,
        bus={
            "times bus-off": bus.endpoint.bus_off_count,
            "time master": bus.time.is_master(now),
            **nodes,
            "fields missing here": ", ".join(link.definitions.absent),
            "fields new here": ", ".join(link.definitions.new),
        },
        tasks=(*_devices(link, now), _vehicle_service(link)),
        given={f"node {n}": key.hex() for key, n in bus.allocator.table.items()},
        refusal=bus.allocator.refusal,
        allocation_left_to=bus.allocator.left_to,
    )


def bus_task(
    name: str, details: UpfDetails, traffic: Mapping[str, object], wire: diagnostics.WirePicture
) -> DiagnosticStatus:
    """The bus, who is on it, and what was dropped on it."""
    values = {**traffic, **details.bus}
    return diagnostics.wire_task(
        name, wire, details.troubles, details.received, values, details.dropped, READABLE
    )


def allocation_task(name: str, details: UpfDetails, path: str) -> DiagnosticStatus:
    """The node ids given out."""
    level = diagnostics.WARN if details.refusal else diagnostics.OK
    text = details.refusal or f"{len(details.given)} node ids given out"
    if details.allocation_left_to:
        level, text = diagnostics.OK, f"node {details.allocation_left_to} gives out node ids"
    return diagnostics.status(name, "node ids", level, text, {**details.given, "file": path}, "")


def _devices(link: UpfLink, now: float) -> Iterator[diagnostics.Task]:
    """One task for each controller and trigger, and one for a controller that is missing."""
    controllers, triggers = link.devices.controllers, link.devices.triggers
    if not controllers and not triggers:
        yield "parachute", diagnostics.STALE, "never received", {}, ""
    elif not controllers and not link.config.without_controller:
        yield Controller.kind, diagnostics.ERROR, _NO_CONTROLLER, {}, ""
    if missing := link.devices.missing_trigger():
        text = f"never received: need its TriggerStatus (trigger_node_id {missing})"
        yield f"{Trigger.kind} {missing}", diagnostics.ERROR, text, {}, ""
    for controller in controllers.values():
        values = _of_controller(controller, now)
        task = _device(controller, controller.state.name, controller.faults(now), values, now)
        if node_id := link.devices.came_back_as(controller):
            name, _, _, told, device = task
            task = name, diagnostics.WARN, f"came back as {node_id}", told, device
        yield task
    for trigger in triggers.values():
        values = {"has fired": trigger.launched}
        yield _device(trigger, trigger.state, trigger.faults(now), values, now)


def _of_controller(one: Controller, now: float) -> dict[str, object]:
    return {
        "state": one.state.name,
        "in this state for (s)": now - one.state_since,
        "changes of state that are not in the document": one.unknown_jumps,
        "newest such change": one.newest_unknown_jump,
        "height (m)": one.number("height_of_home"),
        "backup supply (V)": one.number("backup_power_voltage"),
        **{name: p.words(value) for name, value in one.parameters.items()},
    }


def _device(
    one: Device, state: str, faults: list[str], special: Mapping[str, Any], now: float
) -> diagnostics.Task:
    healthy = one.liveness.state is model.LinkState.OK and not faults
    values = {
        **diagnostics.liveness_values(one.liveness, now),
        "status interval (s)": one.status_interval,
        "restarts": one.restart_count,
        "uptime (s)": one.uptime,
        **special,
        **{f"new field {name}": value for name, value in one.unknown_fields.items()},
    }
    level = diagnostics.OK if healthy else diagnostics.ERROR
    text = "; ".join(faults) or state or "state not known"
    return f"{one.kind} {one.node_id}", level, text, values, one.device


def _vehicle_service(link: UpfLink) -> diagnostics.Task:
    """Requests of devices to the vehicle, and their answers."""
    answer = link.vehicle_service.newest_answer
    failed = answer.endswith(("FAILED", "BAD_MAGIC_NUMBER"))
    level = diagnostics.WARN if failed else diagnostics.OK
    values = dict(sorted(link.vehicle_service.counts.items()))
    return "vehicle service", level, answer or "nothing was requested yet", values, ""
