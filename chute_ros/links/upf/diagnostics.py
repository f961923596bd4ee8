"""/diagnostics of a UPF link: the bus, the devices, their requests to the vehicle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros import model
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.devices import Controller, Device
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.ros import diagnostics


@dataclass(frozen=True)
class DeviceDetails:
    """One controller or trigger, ready to be told."""

    kind: str
    task: str
    device: str
    healthy: bool
    text: str
    values: Mapping[str, object]


@dataclass(frozen=True)
class Details:
    """A picture of the link, made in its thread and read in the executor's."""

    devices: tuple[DeviceDetails, ...]
    troubles: tuple[str, ...]
    received: int
    sent: int
    dropped: Counter[str]
    bus_off_count: int
    nodes: Mapping[str, str]
    asked: Counter[str]
    newest_answer: str
    given: Mapping[str, str]
    refusal: str
    allocation_left_to: int
    time_master: bool
    data_types: Mapping[str, str]


def details_of(link: UpfLink, now: float) -> Details:
    """In the link's turn: all that the tasks below say."""
    bus = link.bus
    return Details(
        devices=(
            *(_controller(link, one, now) for one in link.devices.controllers.values()),
            *(
                _details(one, one.state, one.faults(now), {"has fired": one.launched}, now)
                for one in link.devices.triggers.values()
            ),
        ),
        troubles=tuple(bus.troubles()),
        received=bus.endpoint.received_count,
        sent=bus.endpoint.sent_count,
        dropped=bus.counts + link.requests.commands.counts + link.devices.counts,
        bus_off_count=bus.endpoint.bus_off_count,
        nodes={
            f"node {node.node_id}": f"{node.name or 'not known'} {node.unique_id.hex()}".strip()
            for node in bus.nodes.all()
        },
        asked=Counter(link.vehicle_service.counts),
        newest_answer=link.vehicle_service.newest_answer,
        given={f"node {n}": key.hex() for key, n in bus.allocator.table.items()},
        refusal=bus.allocator.refusal,
        allocation_left_to=bus.allocator.left_to,
        time_master=bus.time.is_master(now),
        data_types={
            "fields missing here": ", ".join(link.definitions.absent),
            "fields new here": ", ".join(link.definitions.new),
        },
    )


def bus_task(
    name: str, details: Details, traffic: Mapping[str, object], wire: diagnostics.WirePicture
) -> DiagnosticStatus:
    """The bus, who is on it, and what was dropped on it."""
    values = {
        **traffic,
        "times bus-off": details.bus_off_count,
        "time master": details.time_master,
        **details.nodes,
        **details.data_types,
    }
    return diagnostics.wire_task(
        name, wire, details.troubles, details.received, values, details.dropped
    )


def device_tasks(name: str, details: Details, without_controller: bool) -> list[DiagnosticStatus]:
    """One task for each controller and trigger, and one for a controller that is missing."""
    if not details.devices:
        return [diagnostics.never_heard(name)]
    heard = [
        diagnostics.status(
            name,
            one.task,
            diagnostics.OK if one.healthy else diagnostics.ERROR,
            one.text,
            one.values,
            one.device,
        )
        for one in details.devices
    ]
    if without_controller or any(one.kind == Controller.kind for one in details.devices):
        return heard
    told = "never received, and without it this link has no parachute (controller_node_id: "
    told += "its node id, or 0; without_controller: true where the vehicle has none)"
    return [diagnostics.status(name, Controller.kind, diagnostics.ERROR, told, {}, ""), *heard]


def vehicle_service_task(name: str, details: Details) -> DiagnosticStatus:
    """Requests of devices to the vehicle, and their answers."""
    failed = details.newest_answer.endswith(("FAILED", "BAD_MAGIC_NUMBER"))
    level = diagnostics.WARN if failed else diagnostics.OK
    text = details.newest_answer or "nothing was requested yet"
    values = dict(sorted(details.asked.items()))
    return diagnostics.status(name, "vehicle service", level, text, values, "")


def allocation_task(name: str, details: Details, path: str) -> DiagnosticStatus:
    """The node ids given out."""
    level = diagnostics.WARN if details.refusal else diagnostics.OK
    text = details.refusal or f"{len(details.given)} node ids given out"
    if details.allocation_left_to:
        level, text = diagnostics.OK, f"node {details.allocation_left_to} gives out node ids"
    return diagnostics.status(name, "node ids", level, text, {**details.given, "file": path}, "")


def _controller(link: UpfLink, one: Controller, now: float) -> DeviceDetails:
    values: dict[str, object] = {
        "state": one.state.name,
        "in this state for (s)": now - one.state_since,
        "changes of state that are not in the document": one.unknown_jumps,
        "newest such change": one.newest_unknown_jump,
        "height (m)": one.number("height_of_home"),
        "backup supply (V)": one.number("backup_power_voltage"),
    }
    values |= {name: p.words(value) for name, value in one.parameters.items()}
    return _details(one, one.state.name, one.faults(now), values, now)


def _details(
    one: Device, state: str, faults: list[str], values: Mapping[str, Any], now: float
) -> DeviceDetails:
    return DeviceDetails(
        one.kind,
        f"{one.kind} {one.node_id}",
        one.device,
        one.liveness.state is model.LinkState.OK and not faults,
        "; ".join(faults) or state or "state not known",
        {
            **diagnostics.liveness_values(one.liveness, now),
            "status interval (s)": one.status_interval,
            "restarts": one.restart_count,
            "uptime (s)": one.uptime,
            **values,
            **{f"new field {name}": value for name, value in one.unknown_fields.items()},
        },
    )
