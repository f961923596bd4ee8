"""A UPF controller or trigger that is wrong in one thing: for each clause of the conformance kit
one way."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import TRIGGER_NODE_ID
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.machine import ControllerEvent
from chute_ros.links.upf.simulator.controller import ControllerSettings, UpfController
from chute_ros.links.upf.simulator.node import NODE_STATUS, NodeSettings, UpfNode
from chute_ros.links.upf.simulator.spoilt import WIRE_BREAKS, SpoiltRequests
from chute_ros.links.upf.simulator.trigger import (
    STATUS_INTERVAL,
    TRIGGER_PARAMETERS,
    UpfTrigger,
)
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.allocation import MESSAGE as ALLOCATION
from chute_ros.protocol.dronecan.can_frame import pack, unpack
from chute_ros.protocol.dronecan.endpoint import ReceivedTransfer
from chute_ros.protocol.dronecan.transfer import TransferKind, head_of

_S = ParachuteState
#: It falls silent so long after its first start, for so long, s.
_PAUSES_AT, _PAUSES_FOR = 25.0, 5.0
#: It goes on by itself after so long, s; and tells no state for so long at first.
_MOVES_AFTER, _TELLS_NONE_FOR = 1.5, 2.0
#: It is silent for so long after it was first told the time, and after spoilt frames, s.
_STANDS_STILL, _STUNNED = 6.4, 2.3
#: It is LAUNCHED, and fires so long after that, s.
_FIRES_AFTER = 0.3
#: Its TriggerStatus comes so seldom, for so long after its first start, s.
_SELDOM, _SELDOM_FOR = 4.0, 9.0
#: With what the names of the clauses of a trigger begin.
_TRIGGER = "trigger-"
#: Request -> the clause that it breaks by its answer, though it does as it is told.
_ANSWERS = {
    "TYPE_TAKEOFF": "takeoff",
    "TYPE_ARM": "arm",
    "TYPE_DISARM": "disarm",
    "TYPE_LAND": "land",
}
#: Request -> the clause that it breaks as it says SUCCESS to it and does not fire.
_DEPLOYS = {"TYPE_DEPLOY": "deploy", "TYPE_DEPLOY_FORCE": "deploy-force"}
#: The state that it leaves by itself though this is off, and how.
_BY_ITSELF = {
    "no-auto-takeoff": (_S.READY, p.AUTO_TAKEOFF, ControllerEvent.TAKEOFF),
    "no-auto-arm": (_S.TAKEOFF, p.AUTO_ARM, ControllerEvent.ARM),
    "no-auto-disarm": (_S.ARMED, p.AUTO_DISARM, ControllerEvent.DISARM),
    "no-auto-land": (_S.TAKEOFF, p.AUTO_LAND, ControllerEvent.LAND),
}
#: What it does not ask of the vehicle.
_NOT_ASKED = {
    "block-at-start": "TYPE_FLIGHT_BLOCK",
    "release-when-ready": "TYPE_FLIGHT_BLOCK_RELEASE",
    "kill-first": "TYPE_KILLSWITCH",
}


class BrokenNode(UpfNode):
    """Wrong as a node on the bus. breaks: the name of a clause, of a trigger without trigger-."""

    _first_start, _dumb_until = math.nan, -math.inf
    #: Who asked first; 0: nobody has.
    _client = 0

    def __init__(self, definitions: Definitions, settings: Any, breaks: str) -> None:
        self.breaks = breaks
        super().__init__(definitions, settings)
        self._spoilt = SpoiltRequests(definitions.types)

    @property
    def up(self) -> float:
        """Since its first start, s."""
        return self.now - self._first_start

    def start(self, now: float) -> None:
        if math.isnan(self._first_start):
            self._first_start = now
        super().start(now)

    def reboot(self) -> None:
        """It keeps the node id that it was given, where it must not."""
        given = self._dna.node_id
        super().reboot()
        if self.breaks == "dna-forgets" and given and not self.node_id:
            self.endpoint.node_id = given

    def receive(self, data: bytes, now: float) -> None:
        asked, synced = not self.node_id, self.clock.master
        if self.breaks == "other-node":
            data = self._as_its_own(data)
        super().receive(data, now)
        if self.breaks == "time-sync" and self.clock.master and not synced:
            self._dumb_until = now + _STANDS_STILL
        if self.breaks == "dna" and asked and self.node_id:
            self.endpoint.node_id -= 1
        if self.breaks in WIRE_BREAKS and self._spoilt.observe(data, self.node_id) == self.breaks:
            self._is_wrong_about_it(now)

    def _allocation(self, source: int, values: Mapping[str, Any]) -> None:
        if self.breaks == "dna-client" and not source:
            self.broadcast(ALLOCATION, {"unique_id": values["unique_id"]})
        super()._allocation(source, values)

    def _serve(self, request: ReceivedTransfer) -> None:
        self._client = self._client or request.source
        if self.breaks != "two-senders" or request.source == self._client:
            super()._serve(request)

    def _is_wrong_about_it(self, now: float) -> None:
        """It carries out what has a wrong CRC; all else makes it silent for a while."""
        if self.breaks == "wrong-crc":
            for frame in self._spoilt.mended():
                super().receive(pack(frame), now)
        else:
            self._dumb_until = now + _STUNNED

    def _as_its_own(self, data: bytes) -> bytes:
        """A request to another node, as if it were for this one."""
        frame = unpack(data)
        if frame is None or not frame.extended or not frame.data:
            return data
        if head_of(frame).kind is not TransferKind.REQUEST:
            return data
        identifier = frame.identifier & ~0x7F00 | self.node_id << 8
        return pack(replace(frame, identifier=identifier))

    def take_output(self) -> list[bytes]:
        frames = super().take_output()
        if self.now < self._dumb_until:
            return []
        pauses = self.breaks == "soak" and _PAUSES_AT <= self.up < _PAUSES_AT + _PAUSES_FOR
        return [] if pauses else frames


class BrokenController(BrokenNode, UpfController):
    """breaks: the name of a clause."""

    def __init__(
        self, definitions: Definitions, settings: ControllerSettings, breaks: str
    ) -> None:
        super().__init__(definitions, settings, breaks)
        self._there_since = math.inf
        if change := _NODE_CHANGES.get(breaks) or _CONTROLLER_CHANGES.get(breaks):
            change(self)

    def step(self, now: float) -> None:
        super().step(now)
        if self.breaks not in _BY_ITSELF:
            return
        state, parameter, event = _BY_ITSELF[self.breaks]
        there = self.state is state and not self.switch(parameter)
        self._there_since = min(self._there_since, now) if there else math.inf
        if now - self._there_since >= _MOVES_AFTER:
            self._move(event)

    def decide(self, name: str) -> str:
        if name == "" and self.breaks == "unknown-type":
            return "SUCCESS"
        switch, word = p.EXCLUDES.get(name), name.removeprefix("TYPE_").lower()
        if switch is not None and self.breaks == f"exclude-{word}" and self.switch(switch):
            return "SUCCESS"
        by_hand = self.state is _S.READY and not self.switch(p.AUTO_ARM)
        if name == "TYPE_ARM" and self.breaks == "arm-order" and by_hand:
            self._enter(_S.ARMED)
            return "SUCCESS"
        disabled = not self.switch(p.ENABLE_PARACHUTE)
        if self.breaks == _DEPLOYS.get(name) and not disabled:
            return "SUCCESS"
        if name == "TYPE_DEPLOY_FORCE" and self.breaks == "disabled" and disabled:
            self._fire(self.now)
            return "SUCCESS"
        result = super().decide(name)
        turned = result == "SUCCESS" and self.breaks == _ANSWERS.get(name)
        return "FAILED" if turned else result

    def _fire(self, now: float) -> None:
        if self.breaks == "launched-after-trigger" and self.state is not _S.LAUNCHED:
            self._enter(_S.LAUNCHED)
            self._launch_at = now + _FIRES_AFTER
            return
        super()._fire(now)

    def _move(self, event: ControllerEvent) -> None:
        if event is not ControllerEvent.AT_REST or self.breaks != "touchdown":
            super()._move(event)

    def _ask_vehicle(self, type_name: str) -> int:
        if _NOT_ASKED.get(self.breaks) == type_name:
            return 0
        if self.breaks == "block-when-abnormal" and self.state is _S.ABNORMAL:
            return 0
        return super()._ask_vehicle(type_name)


class BrokenTrigger(BrokenNode, UpfTrigger):
    """clause: its name."""

    def __init__(self, definitions: Definitions, settings: NodeSettings, clause: str) -> None:
        super().__init__(definitions, settings, clause.removeprefix(_TRIGGER))
        if change := _NODE_CHANGES.get(self.breaks) or _TRIGGER_CHANGES.get(clause):
            change(self)


def simulated_controller(
    definitions: Definitions, settings: ControllerSettings, breaks: str
) -> UpfController:
    """A simulated controller. breaks: a name of BREAKS; empty: it is sound."""
    if breaks:
        return BrokenController(definitions, settings, breaks)
    return UpfController(definitions, settings)


def simulated_trigger(
    definitions: Definitions, name: str, node_id: int, breaks: str
) -> UpfTrigger:
    """A simulated trigger, as it is delivered. breaks: as simulated_controller."""
    wrong = breaks == "trigger-node-id" and node_id == TRIGGER_NODE_ID
    values = {**TRIGGER_PARAMETERS, p.STATIC_NODE_ID: node_id + wrong}
    if breaks.startswith(_TRIGGER):
        return BrokenTrigger(definitions, NodeSettings(name, values), breaks)
    return UpfTrigger(definitions, NodeSettings(name, values))


Answer = dict[str, Any] | None
NodeT = TypeVar("NodeT", bound=BrokenNode)


def _answers(
    service: str, change: Callable[[NodeT, ReceivedTransfer, Any], Answer]
) -> Callable[[NodeT], None]:
    """It answers a request otherwise: change gets the right answer."""

    def apply(device: NodeT) -> None:
        right = device.services[service]
        device.services[service] = lambda request: change(device, request, right(request))

    return apply


def _parameter(name: str, **told: Any) -> Callable[[BrokenNode], None]:
    """It tells this parameter otherwise, by its name."""

    def change(_: BrokenNode, request: ReceivedTransfer, answer: Any) -> Answer:
        return {**answer, **told} if _named(request) == name else answer

    return _answers(bus_requests.GET_SET, change)


def _named(request: ReceivedTransfer) -> str:
    return bytes(request.values["name"]).decode()


def _interval(
    message: str, interval: Callable[[BrokenNode], float]
) -> Callable[[BrokenNode], None]:
    def apply(device: BrokenNode) -> None:
        _, make = device.broadcasts[message]
        device.broadcasts[message] = (lambda: interval(device), make)

    return apply


def _tells(message: str, until: float = math.inf, **told: int) -> Callable[[BrokenNode], None]:
    """Its message tells this, until so long after its first start (s)."""

    def apply(device: BrokenNode) -> None:
        interval, make = device.broadcasts[message]
        device.broadcasts[message] = (
            interval,
            lambda: {**make(), **(told if device.up < until else {})},
        )

    return apply


def _is_slow(device: BrokenNode) -> None:
    """Its clock."""
    interval, make = device.broadcasts[NODE_STATUS]
    device.broadcasts[NODE_STATUS] = (
        interval,
        lambda: {**(told := make()), "uptime_sec": told["uptime_sec"] // 2},
    )


def _no_id(_: BrokenNode, request: ReceivedTransfer, answer: Any) -> Answer:
    return {**answer, "hardware_version": {"major": 3, "unique_id": bytes(16)}}


def _lacks_light(_: BrokenController, request: ReceivedTransfer, answer: Any) -> Answer:
    return {} if _named(request) == p.LIGHT else answer


def _endless(device: BrokenNode, request: ReceivedTransfer, answer: Any) -> Answer:
    at_end = not _named(request) and not answer
    return device.memory.answer(p.LIGHT) if at_end else answer


def _any_name(device: BrokenNode, request: ReceivedTransfer, answer: Any) -> Answer:
    known = bool(answer) or not _named(request)
    return answer if known else device.memory.answer(p.LIGHT)


def _takes_all(*named: str) -> Callable[[BrokenNode], None]:
    """Any value of these parameters."""

    def change(device: BrokenNode, request: ReceivedTransfer, answer: Any) -> Answer:
        wanted, told = p.value_of(request.values["value"]), dict(answer)
        if wanted is not None and told and _named(request) in named:
            device.memory.values[_named(request)] = wanted
            told["value"] = p.union_of(wanted)
        return told

    return _answers(bus_requests.GET_SET, change)


def _keeps_light(device: BrokenController, request: ReceivedTransfer, answer: Any) -> Answer:
    """On, whatever it is set to."""
    if _named(request) != p.LIGHT:
        return dict(answer)
    device.memory.values[p.LIGHT] = True
    return device.memory.answer(p.LIGHT)


def _always_saves(device: BrokenController) -> None:
    right = device.memory.set

    def keep(name: str, wanted: p.Value) -> bool:
        done = right(name, wanted)
        device.memory.saved = dict(device.memory.values)
        return done

    device.memory.set = keep  # type: ignore[method-assign]


def _any_magic(service: str) -> Callable[[BrokenNode], None]:
    def apply(device: BrokenNode) -> None:
        right = device.services[service]
        magic = device.definitions.types.request(service).constants[names.MAGIC]
        device.services[service] = lambda request: right(
            replace(request, values={**request.values, "magic_number": magic})
        )

    return apply


def _pace(device: BrokenNode, name: str) -> float:
    """A third of what its parameter says as it is delivered; as it says when it is set."""
    told, delivered = device.values[name], device.settings.values[name]
    return float(told) / 1000.0 * (3.0 if told == delivered else 1.0)


def _is_type(device: UpfNode, request: ReceivedTransfer, name: str) -> bool:
    """A TriggerService request of this type; empty: one that is none."""
    service = names.TRIGGER_SERVICE
    is_good = device.definitions.magic_is_good(service, request.values)
    return is_good and device.definitions.type_name(service, request.values) == name


def _says_yes(type_name: str) -> Callable[[BrokenTrigger], None]:
    """TriggerService answers this with SUCCESS, and does nothing."""

    def apply(device: BrokenTrigger) -> None:
        service = names.TRIGGER_SERVICE
        right, yes = device.services[service], device.definitions.result(service, "SUCCESS")
        device.services[service] = lambda request: (
            yes if _is_type(device, request, type_name) else right(request)
        )

    return apply


def _fires_by_test(device: BrokenTrigger, request: ReceivedTransfer, answer: Any) -> Answer:
    if _is_type(device, request, "TYPE_SELF_TEST"):
        device.fire("its self test")
    return dict(answer)


def _hears_launch(**otherwise: Callable[[BrokenTrigger], int]) -> Callable[[BrokenTrigger], None]:
    """It takes these fields of TriggerLaunch for something else."""

    def apply(device: BrokenTrigger) -> None:
        right = device.messages[names.TRIGGER_LAUNCH]

        def hear(source: int, values: Mapping[str, Any]) -> None:
            right(source, {**values, **{name: one(device) for name, one in otherwise.items()}})

        device.messages[names.TRIGGER_LAUNCH] = hear

    return apply


def _launch_magic(device: UpfNode) -> int:
    return int(device.definitions.constant(names.TRIGGER_LAUNCH, names.MAGIC))


_NODE_CHANGES: dict[str, Callable[[BrokenNode], None]] = {
    "node-status": _interval(NODE_STATUS, lambda device: _pace(device, p.NODE_STATUS_INTERVAL)),
    "node-mode": _tells(NODE_STATUS, mode=3),
    "uptime": _is_slow,
    "node-info": _answers(bus_requests.GET_NODE_INFO, _no_id),
    "transport-stats": _answers(bus_requests.TRANSPORT_STATS, lambda *_: None),
    "parameter-list": _answers(bus_requests.GET_SET, _endless),
    "parameter-unknown": _answers(bus_requests.GET_SET, _any_name),
    "opcode-save": _answers(bus_requests.EXECUTE_OPCODE, lambda *_: {"ok": False}),
    "restart-magic": _answers(bus_requests.RESTART_NODE, lambda *_: {"ok": True}),
    "restart": _answers(bus_requests.RESTART_NODE, lambda *_: {"ok": False}),
    "node-id-range": _takes_all(p.STATIC_NODE_ID),
}
_CONTROLLER_CHANGES: dict[str, Callable[[BrokenController], None]] = {
    "status-interval": _interval(
        names.PARACHUTE_STATUS, lambda device: _pace(device, p.PARACHUTE_STATUS_INTERVAL)
    ),
    "state-known": _tells(names.PARACHUTE_STATUS, _TELLS_NONE_FOR, state=0),
    "node-id": _parameter(p.STATIC_NODE_ID, default_value=p.union_of(12)),
    "parameters": _answers(bus_requests.GET_SET, _lacks_light),
    "parameter-kinds": _parameter(p.LIGHT, value=p.union_of("on")),
    "resister-off": _parameter(p.CANBUS_RESISTER, default_value=p.union_of(True)),
    "node-interval": _interval(NODE_STATUS, lambda device: 1.0),
    "parachute-interval": _interval(names.PARACHUTE_STATUS, lambda device: 0.1),
    "parameter-range": _takes_all(p.NODE_STATUS_INTERVAL, p.PARACHUTE_STATUS_INTERVAL),
    "switch-range": _takes_all(*(one.name for one in p.PARAMETERS if one.kind is bool)),
    "light": _answers(bus_requests.GET_SET, _keeps_light),
    "auto-save": _always_saves,
    "bad-magic": _any_magic(names.PARACHUTE_SERVICE),
}
_TRIGGER_CHANGES: dict[str, Callable[[BrokenTrigger], None]] = {
    "trigger-status": _interval(
        names.TRIGGER_STATUS,
        lambda device: _SELDOM if device.up < _SELDOM_FOR else STATUS_INTERVAL,
    ),
    "trigger-state-known": _tells(names.TRIGGER_STATUS, _TELLS_NONE_FOR, state=0),
    "trigger-bad-magic": _any_magic(names.TRIGGER_SERVICE),
    "trigger-unknown-type": _says_yes(""),
    "trigger-self-test": _answers(names.TRIGGER_SERVICE, _fires_by_test),
    "trigger-broadcast-magic": _hears_launch(magic_number=_launch_magic),
    "trigger-broadcast-other": _hears_launch(node_id=lambda device: device.node_id),
    "trigger-broadcast": _hears_launch(magic_number=lambda _: 0),
    "trigger-launch": _says_yes("TYPE_LAUNCH"),
    "trigger-is-launched": _tells(names.TRIGGER_STATUS, is_launched=False),
}
#: Breaks of any node that have no entry above.
_NODE_BREAKS = (
    *("time-sync", "soak", "other-node", "two-senders", "dna", "dna-forgets", "dna-client"),
    *WIRE_BREAKS,
)
#: Clauses that a device can break.
BREAKS = (
    *_NODE_CHANGES,
    *_NODE_BREAKS,
    *_CONTROLLER_CHANGES,
    *_NOT_ASKED,
    *_ANSWERS.values(),
    *(f"exclude-{name}" for name in _ANSWERS.values()),
    *("unknown-type", *_BY_ITSELF, "arm-order", "disabled", *_DEPLOYS.values(), "touchdown"),
    *("launched-after-trigger", "block-when-abnormal"),
    *(f"{_TRIGGER}{name}" for name in (*_NODE_CHANGES, *_NODE_BREAKS, "node-id")),
    *_TRIGGER_CHANGES,
)
