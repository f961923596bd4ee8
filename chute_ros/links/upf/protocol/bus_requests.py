"""Requests to a UPF device besides flying: its parameters, its memory, its identity.

Source: Flyfire UPF UAVCAN protocol V1.0, "standard UAVCAN protocols" and "parameters";
uavcan.protocol.param.GetSet, param.ExecuteOpcode, GetTransportStats, GetNodeInfo, RestartNode.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.protocol.dronecan.calls import Call, CallFinished

GET_SET = "uavcan.protocol.param.GetSet"
EXECUTE_OPCODE = "uavcan.protocol.param.ExecuteOpcode"
TRANSPORT_STATS = "uavcan.protocol.GetTransportStats"
GET_NODE_INFO = "uavcan.protocol.GetNodeInfo"
RESTART_NODE = "uavcan.protocol.RestartNode"
RESTART_MAGIC = 0xACCE551B1E
OPCODE_SAVE, OPCODE_ERASE = 0, 1
#: More parameters than this are not asked for: a device that never ends its list must not hold us.
MOST_PARAMETERS = 128


@dataclass(frozen=True)
class DeviceParameter:
    """One parameter as the device tells it; values in words, empty: none."""

    name: str
    value: p.Value | None = None
    kind: str = ""
    minimum: p.Value | None = None
    maximum: p.Value | None = None
    default: p.Value | None = None


@dataclass(frozen=True)
class BusRequestDone:
    """The end of a bus request. node_id: of the device; values: of the response asked for last."""

    success: bool
    message: str
    node_id: int
    parameters: tuple[DeviceParameter, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict)


BusRequest = Generator[Call, CallFinished, BusRequestDone]


def get_parameter(node_id: int, name: str) -> BusRequest:
    """Read one by name."""
    found = yield from _find(node_id, name)
    if isinstance(found, BusRequestDone):
        return found
    text = f"{name} is {p.words(found.value)}{_range(found)}"
    return BusRequestDone(True, text, node_id, (found,))


def set_parameter(
    node_id: int,
    name: str,
    text: str,
    auto_save: Callable[[], bool | None] = lambda: None,
    status_timeout: float = math.inf,
) -> BusRequest:
    """Read one for its type and range, set it, and read it back. auto_save: whether the device
    keeps a change by itself; None: not known. status_timeout: of ParachuteStatus, s."""
    before = yield from _find(node_id, name)
    if isinstance(before, BusRequestDone):
        return before
    try:
        wanted = p.parse(text, before.kind, name)
    except ParameterError as error:
        return BusRequestDone(False, f"{error}; nothing was sent", node_id, (before,))
    low, high = _limits(before)
    number = isinstance(wanted, (int, float)) and not isinstance(wanted, bool)
    if number and (_below(wanted, low) or _below(high, wanted)):
        why = f"{name} cannot be {text}: need {p.words(low)} to {p.words(high)}; nothing was sent"
        return BusRequestDone(False, why, node_id, (before,))
    values = {"name": _encoded(name), "value": p.union_of(wanted)}
    answer = yield Call(node_id, GET_SET, values)
    unknown = replace(before, value=None)
    if answer.values is None:
        return BusRequestDone(
            False, f"{name} may or may not be set: {answer.text()}", node_id, (unknown,)
        )
    answer = yield _get(node_id, name)
    after = _read(answer)
    if after is None or after.name != name:
        why = f"{name} was sent, but not read back: {answer.text()}"
        return BusRequestDone(False, why, node_id, (unknown,))
    if not _same(after.value, wanted):
        why = f"{name} was not accepted: it is still {p.words(after.value)}"
        return BusRequestDone(False, why, node_id, (after,))
    keeps = p.as_switch(after.value) if name == p.AUTO_SAVE else auto_save()
    text = f"{name} is {p.words(after.value)}"
    if name == p.STATIC_NODE_ID:
        asks = "" if after.value else " (0: requests a node id at each start)"
        text += f"; takes effect at the next start{asks}"
    if keeps is not None:
        lost = f"lost at a restart until ~/save_params: {p.AUTO_SAVE} is off"
        text += "; kept" if keeps else f"; {lost}"
    if name == p.PARACHUTE_STATUS_INTERVAL and _below(status_timeout * 1000.0, after.value):
        text += (
            f"; WARNING: status_timeout is {status_timeout:g} s: need a shorter interval, or each "
            "ParachuteStatus is too old and the controller ABNORMAL"
        )
    return BusRequestDone(True, text, node_id, (after,))


def list_parameters(node_id: int) -> BusRequest:
    """Read all, by index until the device names none."""
    found: list[DeviceParameter] = []
    for index in range(MOST_PARAMETERS):
        answer = yield Call(node_id, GET_SET, {"index": index})
        one = _read(answer)
        if one is None:
            why = f"stopped after {len(found)} parameters: {answer.text()}"
            return BusRequestDone(False, why, node_id, tuple(found))
        if not one.name:
            return BusRequestDone(True, f"{len(found)} parameters", node_id, tuple(found))
        found.append(one)
    why = f"stopped after {MOST_PARAMETERS} parameters: the device does not end its list"
    return BusRequestDone(False, why, node_id, tuple(found))


def execute_opcode(node_id: int, opcode: int) -> BusRequest:
    """Save all parameters, or erase what was saved."""
    name = "save" if opcode == OPCODE_SAVE else "erase"
    texts = f"{name}: done", f"{name}: the device answered: not done"
    return (yield from _ask(Call(node_id, EXECUTE_OPCODE, {"opcode": opcode}), name, *texts))


def restart(node_id: int) -> BusRequest:
    """RestartNode with its magic number."""
    will = "restart: the device answered that it will"
    call = Call(node_id, RESTART_NODE, {"magic_number": RESTART_MAGIC})
    return (yield from _ask(call, "restart", will, f"{will} not"))


def transport_stats(node_id: int) -> BusRequest:
    """GetTransportStats."""
    what = "transport statistics"
    return (yield from _ask(Call(node_id, TRANSPORT_STATS, {}), what, what))


def node_info(node_id: int) -> BusRequest:
    """GetNodeInfo."""
    what = "node information"
    return (yield from _ask(Call(node_id, GET_NODE_INFO, {}), what, what))


def _ask(call: Call, what: str, done: str, not_done: str = "") -> BusRequest:
    """One call; the response's ok, where it has one, tells whether it was done."""
    answer = yield call
    if answer.values is None:
        return BusRequestDone(False, f"{what}: {answer.text()}", call.server)
    ok = bool(answer.values.get("ok", True))
    return BusRequestDone(ok, done if ok else not_done, call.server, values=answer.values)


def _find(
    node_id: int, name: str
) -> Generator[Call, CallFinished, DeviceParameter | BusRequestDone]:
    """The parameter of this name as it is; BusRequestDone: there is none."""
    # An empty name would be a question by index, and set whatever has index 0.
    if not 1 <= len(_encoded(name)) <= p.MOST_NAME_BYTES:
        why = f"{name!r} is no parameter's name: need 1 to {p.MOST_NAME_BYTES} bytes"
        return BusRequestDone(False, why, node_id)
    answer = yield _get(node_id, name)
    found = _read(answer)
    if found is not None and found.kind and found.name == name:
        return found
    why = f"{name}: {answer.text()}"
    if found is not None:
        known = ", ".join(one.name for one in p.PARAMETERS)
        why = f"the device has no parameter {name!r}; the document lists {known}"
    return BusRequestDone(False, why, node_id)


def _get(node_id: int, name: str) -> Call:
    return Call(node_id, GET_SET, {"name": _encoded(name)})


def _encoded(name: str) -> bytes:
    return name.encode("utf-8", "replace")


def _read(answer: CallFinished) -> DeviceParameter | None:
    values = answer.values
    if values is None:
        return None
    return DeviceParameter(
        bytes(values["name"]).decode("utf-8", "replace"),
        p.value_of(values["value"]),
        p.kind_of(values["value"]),
        p.value_of(values["min_value"]),
        p.value_of(values["max_value"]),
        p.value_of(values["default_value"]),
    )


def _limits(one: DeviceParameter) -> tuple[p.Value | None, p.Value | None]:
    """What the device says, else what the document means."""
    documented = p.BY_NAME.get(one.name)
    if one.minimum is None and one.maximum is None and documented is not None:
        return documented.minimum, documented.maximum
    return one.minimum, one.maximum


def _range(one: DeviceParameter) -> str:
    if one.minimum is None or one.maximum is None:
        return ""
    return f" ({p.words(one.minimum)} to {p.words(one.maximum)})"


def _below(low: p.Value | None, high: p.Value | None) -> bool:
    return isinstance(low, (int, float)) and isinstance(high, (int, float)) and bool(low < high)


def _same(read_back: p.Value | None, wanted: p.Value) -> bool:
    if isinstance(wanted, float) and isinstance(read_back, float):
        # It came back as a float of 32 bits.
        return abs(read_back - wanted) <= 1e-6 * max(1.0, abs(wanted))
    return read_back == wanted
