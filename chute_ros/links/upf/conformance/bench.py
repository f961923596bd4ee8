"""The vehicle on a UPF parachute's bus: calls services, answers, and remembers all that comes."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, zip_longest
from typing import Any

from chute_ros.conformance.bench import (
    NotAllowedError,
    ReceivedPacket,
    RecordingBench,
    first_of,
    in_words,
)
from chute_ros.conformance.clause import Risk, Trial, Wait, failed
from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import CONTROLLER_NODE_ID, TRIGGER_NODE_ID
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan import time_sync
from chute_ros.protocol.dronecan.allocation import MESSAGE as ALLOCATION
from chute_ros.protocol.dronecan.allocation import Allocator
from chute_ros.protocol.dronecan.endpoint import Endpoint, ReceivedTransfer
from chute_ros.protocol.dronecan.transfer import HIGHEST_NODE_ID, TRANSFER_IDS, TransferKind

NODE_STATUS = "uavcan.protocol.NodeStatus"
#: Node id of the vehicle that is simulated here, unless another is chosen.
VEHICLE = 110
#: Of our own messages, s.
_BEAT, _TELLS = 1.0, 0.1
_FOUND_WITHIN = 10.0
#: An answer comes within this, s; a call is made so often before it counts as not answered.
ANSWER = 0.5
TRIES = 3
#: DroneCAN: a node tells its status at least so often, s.
LONGEST_STATUS = 1.0
#: It starts anew so long after it was told to at the latest, s.
_STARTS_WITHIN = 5.0
#: A state is broadcast at the latest after this, s.
STATUS_WITHIN = 3.0
#: The option of clauses that take the device's node id from it, and how long it may be away, s.
DNA, _AWAY = "--dna", 12.0
#: The option with which a trigger is tried, in place of a controller.
TRIGGER = "--trigger"
#: The option with which a controller is fired by TYPE_DEPLOY_FORCE, in place of TYPE_DEPLOY.
DEPLOY_FORCE = "--deploy-force"
_FIRES = ("TYPE_DEPLOY", "TYPE_DEPLOY_FORCE")
#: The first part of a unique id that nobody has.
_NOBODYS_ID = b"nobody"
#: Whether these are set may decide whether it fires.
_HARMLESS = (p.AUTO_SAVE, p.LIGHT, p.NODE_STATUS_INTERVAL, p.PARACHUTE_STATUS_INTERVAL)


@dataclass(frozen=True)
class DeviceKind:
    """What can be tried. status: the message by which it is found; up: the state that ends its
    start (empty: any); node_id, parameters: what the document gives it."""

    status: str
    up: str
    node_id: int
    parameters: tuple[str, ...]


A_CONTROLLER = DeviceKind(
    names.PARACHUTE_STATUS, "READY", CONTROLLER_NODE_ID, tuple(one.name for one in p.PARAMETERS)
)
A_TRIGGER = DeviceKind(names.TRIGGER_STATUS, "", TRIGGER_NODE_ID, (p.STATIC_NODE_ID,))


@dataclass(frozen=True)
class TransferPacket(ReceivedPacket):
    """A message, request or response of the device."""

    transfer: ReceivedTransfer

    @property
    def values(self) -> Mapping[str, Any]:
        """Its fields."""
        return self.transfer.values


class UpfBench(RecordingBench[TransferPacket]):
    """risk: the highest that the person allows; nothing above it is ever sent. node: of the
    device, 0: whoever tells its state. vehicle: the node id that is used here. dna: its own
    node id may be taken from it. device: what is tried; a trigger is told nothing unless it is."""

    def __init__(
        self,
        definitions: Definitions,
        risk: Risk = Risk.NONE,
        node: int = 0,
        vehicle: int = VEHICLE,
        soak: float = 0.0,
        dna: bool = False,
        device: DeviceKind = A_CONTROLLER,
    ) -> None:
        super().__init__(risk)
        self.definitions, self.soak, self.node = definitions, soak, 0
        self.device = device
        #: Of everybody on the bus.
        self.every: list[TransferPacket] = []
        #: Parameters that were changed -> what they were.
        self.changed: dict[str, p.Value] = {}
        #: From which of every it was told to deploy, or a trigger has fired; negative: it was not.
        self.deployed_from = -1
        #: Gives out node ids, while it shall.
        self.allocator, self.gives_out = Allocator({}, (vehicle,)), dna
        self._wanted, self._dna = node, dna
        #: Its node id as it was found, and all that it has had.
        self._home, self._ids = 0, {0}
        self._endpoint = Endpoint(definitions.types, vehicle)
        #: Node id of a controller or a trigger -> what is sent to it.
        self._overheard: dict[int, Endpoint] = {}
        self._numbers: dict[tuple[int, str], int] = {}
        #: A second node that asks, and what is answered to it.
        self._second: Endpoint | None = None
        self.to_second: list[TransferPacket] = []
        #: Frames of ours, some of them spoilt, that leave before others.
        self._spoilt: list[bytes] = []
        self._beat_at = self._tell_at = -math.inf

    # -- as the session wants it ----------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        self.at(now)
        if self.device is A_CONTROLLER:
            self._overhear(data, now)
        heard = self._endpoint.receive(data, now)
        if heard is None:
            self._hear_second(data, now)
            return
        one = self._take(heard, data, now)
        if heard.source == self.node and one.kind == NODE_STATUS:
            self.device_is_up(one.values["uptime_sec"], 2.0**32)
        if heard.kind is TransferKind.REQUEST:
            self._answer(heard)
        elif heard.name == ALLOCATION and self.gives_out:
            self._allocate(heard)
        elif heard.source and (heard.name == names.TRIGGER_STATUS or heard.source == self.node):
            self._overheard.setdefault(
                heard.source, Endpoint(self.definitions.types, heard.source)
            )

    def _overhear(self, data: bytes, now: float) -> None:
        """What controller and triggers ask each other."""
        for endpoint in self._overheard.values():
            told = endpoint.receive(data, now)
            if told is not None and told.name == names.TRIGGER_SERVICE:
                self._take(told, data, now)

    def _hear_second(self, data: bytes, now: float) -> None:
        heard = None if self._second is None else self._second.receive(data, now)
        if heard is not None and heard.kind is TransferKind.RESPONSE:
            self.to_second.append(self._packet(heard, data, now))

    def _take(self, heard: ReceivedTransfer, data: bytes, now: float) -> TransferPacket:
        one = self._packet(heard, data, now)
        self.every.append(one)
        if heard.source == self.node:
            self.heard.append(one)
            self.heard_at = now
        return one

    def _packet(self, heard: ReceivedTransfer, data: bytes, now: float) -> TransferPacket:
        label = (
            heard.name
            if heard.kind is TransferKind.MESSAGE
            else f"{heard.name} {heard.kind.value}"
        )
        packet = self.noted(False, f"node {heard.source}", label, in_words(heard.values), data)
        return TransferPacket(now, heard.name, packet, heard)

    def stream_ended(self, stream: Hashable) -> None:
        pass

    def update(self, now: float) -> None:
        self.at(now)
        if now >= self._beat_at:
            self._beat_at = now + _BEAT
            status = {"uptime_sec": int(now - self._began), "health": 0, "mode": 0}
            self._endpoint.broadcast(NODE_STATUS, status)
        if now >= self._tell_at:
            self._tell_at = now + _TELLS
            told = self.definitions.present(names.VEHICLE_STATUS, {"is_parachute_connected": True})
            self._endpoint.broadcast(names.VEHICLE_STATUS, told)

    def next_deadline(self) -> float:
        return min(self._beat_at, self._tell_at)

    def take_output(self) -> list[bytes]:
        spoilt, self._spoilt = self._spoilt, []
        return [*spoilt, *self._endpoint.take_output()]

    def _answer(self, request: ReceivedTransfer) -> None:
        """As a vehicle that obeys."""
        if request.name == names.VEHICLE_SERVICE:
            result = self.definitions.result(names.VEHICLE_SERVICE, "SUCCESS")
            self._endpoint.respond(request, result)

    def _allocate(self, message: ReceivedTransfer) -> None:
        """As the one allocator of the bus, whose table needs no keeping."""
        in_use = {one.transfer.source: b"" for one in self.every if one.transfer.source}
        self.allocator.heard(message.source, message.values, in_use, True, self.now)
        for one in self.allocator.take_keep():
            self.allocator.kept(one.number)
        for values in self.allocator.take_answers():
            self._endpoint.broadcast(ALLOCATION, values)

    # -- what is sent ---------------------------------------------------------------------------

    def call(
        self, service: str, values: Mapping[str, Any], tries: int = TRIES, node: int | None = None
    ) -> Any:
        """The response (its values) of the device, or of this node; None: none came."""
        server = self.node if node is None else node
        self._check(service, values)
        for _ in range(tries):
            number = self._next_number(server, service)
            name = f"{service} request to node {server}"
            self.noted(True, "us", name, in_words(values), b"")
            self._endpoint.request(server, service, number, values, 16)
            answer = yield from self._response(server, service, number)
            if answer is not None:
                return answer
        return None

    def _next_number(self, server: int, service: str) -> int:
        """The transfer id of a request."""
        number = self._numbers.get((server, service), 0)
        self._numbers[server, service] = (number + 1) % TRANSFER_IDS
        return number

    def send_spoilt(
        self,
        name: str,
        value: p.Value,
        before: p.Value,
        spoils: Callable[[list[bytes]], list[bytes]],
    ) -> None:
        """Set a parameter, which is this before, by a request whose frames are spoilt so (sixteen
        bytes each: can_frame)."""
        values = {"index": 0, "value": p.union_of(value), "name": name.encode()}
        self._check(bus_requests.GET_SET, values)
        self.changed.setdefault(name, before)
        self.noted(True, "us", f"spoilt {bus_requests.GET_SET}", f"{name} {value}", b"")
        whole = self._endpoint.take_output()
        number = self._next_number(self.node, bus_requests.GET_SET)
        self._endpoint.request(self.node, bus_requests.GET_SET, number, values, 16)
        self._spoilt += [*whole, *spoils(self._endpoint.take_output())]

    def _response(self, server: int, service: str, number: int) -> Any:
        found = _answer_in(self.every, server, service, number)
        yield Wait(self.now + ANSWER, found)
        answer = found()
        return None if answer is None else answer.values

    def get_twice(self, first: str, second: str) -> Any:
        """The responses of GetSet (their values) to us and to a second node, each for its name;
        None: none came. The frames of the two requests alternate, and both have one number."""
        service, asked = bus_requests.GET_SET, (first, second)
        if self._second is None:
            self._second = Endpoint(self.definitions.types, self.nobody())
        number, whole = self._next_number(self.node, service), self._endpoint.take_output()
        frames = []
        for endpoint, who, name in zip(
            (self._endpoint, self._second), ("us", "a second node"), asked, strict=True
        ):
            values = {"index": 0, "value": {"empty": {}}, "name": name.encode()}
            asks = f"{service} request to node {self.node}"
            self.noted(True, who, asks, in_words(values), b"")
            endpoint.request(self.node, service, number, values, 16)
            frames.append(endpoint.take_output())
        alternating = chain.from_iterable(zip_longest(*frames))
        self._spoilt += [*whole, *(one for one in alternating if one is not None)]
        ours = _answer_in(self.every, self.node, service, number)
        its = _answer_in(self.to_second, self.node, service, number)
        yield Wait(self.now + ANSWER, lambda: ours() and its())
        return [None if one is None else one.values for one in (ours(), its())]

    def _check(self, service: str, values: Mapping[str, Any]) -> None:
        """Nothing leaves that is not allowed."""
        risk = Risk.NONE
        if service in (names.TRIGGER_SERVICE, names.TRIGGER_LAUNCH):
            if self.device is not A_TRIGGER:
                raise NotAllowedError(f"{service} needs {TRIGGER}")
            risk = Risk.FIRES
        elif service == names.PARACHUTE_SERVICE:
            kind = self._type_of(service, values["type"])
            risk = Risk.FIRES if kind in _FIRES else Risk.ARMS
        elif service == bus_requests.GET_SET and "empty" not in values["value"]:
            named = bytes(values["name"]).decode()
            if named == p.STATIC_NODE_ID:
                if self._dna:
                    return
                raise NotAllowedError(f"{named} needs {DNA}")
            risk = Risk.NONE if named in _HARMLESS else Risk.ARMS
        self.takes(risk, f"{service} {dict(values)}")

    def _type_of(self, service: str, number: int) -> str:
        """Whatever the magic number is."""
        constants = self.definitions.types.request(service).constants
        return self.definitions.type_name(
            service, {"magic_number": constants[names.MAGIC], "type": number}
        )

    # -- steps of trials ------------------------------------------------------------------------

    def find(self) -> Trial:
        """Who tells the state of such a device."""
        found = self._teller(0, lambda node: self._wanted in (0, node))
        yield Wait(self.now + _FOUND_WITHIN, found)
        self.node = self._home = _node_of(found())
        self._ids.add(self.node)
        if not self.node:
            others = sorted({one.transfer.source for one in self.every})
            heard = ", ".join(map(str, others)) or "nobody"
            raise failed(
                f"no {self.status} is received within {_FOUND_WITHIN:g} s (received from nodes: "
                f"{heard}): check the bus and its bit rate, and the data types (--dsdl-path)"
            )
        self.heard = [one for one in self.every if one.transfer.source == self.node]
        self.heard_at = self.now
        yield from self.call(bus_requests.GET_NODE_INFO, {}, 1)
        return f"node {self.node}"

    @property
    def status(self) -> str:
        """The message that tells its state, in a word."""
        return self.device.status.rpartition(".")[2]

    def _teller(
        self, since: int, fits: Callable[[int], bool]
    ) -> Callable[[], TransferPacket | None]:
        """The first that tells the state of such a device, from this place of every on, of a node
        that fits."""
        status = self.device.status
        return first_of(
            self.every, since, lambda one: one.kind == status and fits(one.transfer.source)
        )

    def others(self) -> set[int]:
        """The nodes of other devices of its kind."""
        told = (one for one in self.every if one.kind == self.device.status)
        return {one.transfer.source for one in told} - self._ids

    def ask_for_node_id(self) -> None:
        """As a node without one, with the first part of a unique id that nobody has."""
        anonymous = Endpoint(self.definitions.types, 0)
        values = {"first_part_of_unique_id": True, "unique_id": _NOBODYS_ID}
        self.noted(True, "a node without a node id", ALLOCATION, _NOBODYS_ID.hex(), b"")
        anonymous.broadcast(ALLOCATION, values)
        self._spoilt += anonymous.take_output()

    def nobody(self) -> int:
        """A node id that nobody on the bus has."""
        heard = {one.transfer.source for one in self.every}
        return next(one for one in range(HIGHEST_NODE_ID - 2, 0, -1) if one not in heard)

    def identity(self) -> Mapping[str, str]:
        """Of its GetNodeInfo."""
        told = [one for one in self.heard if one.kind == bus_requests.GET_NODE_INFO]
        if not told:
            return {}
        values = told[-1].values
        software, hardware = values["software_version"], values["hardware_version"]
        return {
            "name": bytes(values["name"]).decode("utf-8", "replace"),
            "software": f"{software['major']}.{software['minor']}",
            "hardware": f"{hardware['major']}.{hardware['minor']}",
            "unique id": bytes(hardware["unique_id"]).hex(),
        }

    def leave(self) -> Trial:
        """Not armed, and its parameters as they were."""
        may_be_armed = self.device is A_CONTROLLER and self.done is not Risk.NONE
        if not self.node or not (may_be_armed or self.changed):
            return "nothing was changed"
        left = []
        if p.STATIC_NODE_ID in self.changed:
            yield from self.comes_back(_AWAY)
            if not (yield from self.static_again()):
                left.append(f"{p.STATIC_NODE_ID} is LEFT 0: a node id must be given to it")
                self.changed.pop(p.STATIC_NODE_ID, None)
        if may_be_armed:
            for name in ("TYPE_DISARM", "TYPE_LAND"):
                yield from self.ask(name)
        for name, value in [*self.changed.items()]:
            if not (yield from self.put_back(name)):
                left.append(f"{name} is not {p.words(value)} again")
        if may_be_armed:
            left += yield from self._left_armed()
        if left:
            raise failed(f"the device: {'; '.join(left)}")
        return "as it was"

    def _left_armed(self) -> Any:
        """In words, by its own state."""
        status = yield from self.wait_for(self.device.status, STATUS_WITHIN)
        if status is None:
            return [f"it may be LEFT ARMED: no {self.status} shows it"]
        armed = self.state_in(status) is ParachuteState.ARMED
        return ["it is LEFT ARMED"] if armed else []

    def ask(self, type_name: str) -> Any:
        """The name of the result of a ParachuteService request; None: not answered."""
        service = names.PARACHUTE_SERVICE
        answer = yield from self.call(service, self.definitions.request(service, type_name))
        return None if answer is None else self.definitions.result_name(service, answer)

    def tell_time(self, microseconds: int) -> None:
        """GlobalTimeSync: the one before was sent at this time; 0: there was none."""
        values = {"previous_transmission_timestamp_usec": microseconds}
        self.noted(True, "us", time_sync.MESSAGE, str(microseconds), b"")
        self._endpoint.broadcast(time_sync.MESSAGE, values)

    def launch(self, **told: int) -> None:
        """TriggerLaunch, which is for every trigger on the bus, with these fields otherwise."""
        name = names.TRIGGER_LAUNCH
        magic = {"magic_number": self.definitions.constant(name, names.MAGIC)}
        values = self.definitions.present(name, {**magic, **told})
        self._check(name, values)
        self.noted(True, "us", name, in_words(values), b"")
        self._endpoint.broadcast(name, values)

    def get(self, name: str = "", index: int = 0) -> Any:
        """The response of GetSet (its values); None: not answered."""
        values = {"index": index, "value": {"empty": {}}, "name": name.encode()}
        return (yield from self.call(bus_requests.GET_SET, values))

    def value(self, name: str, which: str = "value") -> Any:
        """The value of a parameter, or its default_value; None: not answered, or it has none."""
        answer = yield from self.get(name)
        return None if answer is None else p.value_of(answer[which])

    def set(self, name: str, value: p.Value) -> Any:
        """The value that a parameter has afterwards; None: not answered, or none of this name."""
        if name not in self.changed:
            known = yield from self.value(name)
            if known is not None:
                self.changed[name] = known
        values = {"index": 0, "value": p.union_of(value), "name": name.encode()}
        answer = yield from self.call(bus_requests.GET_SET, values)
        told = None if answer is None else p.value_of(answer["value"])
        return bool(told) if isinstance(value, bool) and told is not None else told

    def put_back(self, name: str) -> Any:
        """Whether a parameter is as it was before it was set."""
        if name in self.changed:
            if (yield from self.set(name, self.changed[name])) != self.changed[name]:
                return False
            del self.changed[name]
        return True

    def save(self) -> Any:
        """The answer (its values) as its parameters are to be kept; None: not answered."""
        values = {"opcode": bus_requests.OPCODE_SAVE, "argument": 0}
        return (yield from self.call(bus_requests.EXECUTE_OPCODE, values))

    def save_and_restart(self) -> Any:
        """What was set is kept, whether it saves by itself or not; then as restart."""
        yield from self.save()
        return (yield from self.restart())

    def restart(self) -> Any:
        """Whether RestartNode is not refused; then it begins to start anew, if it does."""
        node, starts, since = self.node, self.starts, len(self.every)
        magic = {"magic_number": bus_requests.RESTART_MAGIC}
        # It may be gone before it has answered.
        answer = yield from self.call(bus_requests.RESTART_NODE, magic, 1)
        if answer is not None and not answer["ok"]:
            return False

        def begins(one: TransferPacket) -> bool:
            source = one.transfer.source
            if one.kind == ALLOCATION:
                return not source
            if one.kind != self.device.status or source not in self._ids:
                return False
            return source != node or self.state_in(one) is ParachuteState.NOT_READY

        # It may begin a moment after it has answered, and tell its old state until then.
        begun = first_of(self.every, since, begins)
        yield Wait(self.now + _STARTS_WITHIN, lambda: self.starts > starts or begun())
        return True

    def is_back(self, within: float) -> Any:
        """Whether its start has ended within so many s. Its NodeStatus shows the start then."""
        shows = first_of(
            self.every,
            len(self.every),
            lambda one: one.kind == NODE_STATUS and one.transfer.source == self.node,
        )
        is_up = yield from self.is_up(within)
        yield Wait(self.now + LONGEST_STATUS, shows)
        return is_up

    def comes_back(self, within: float) -> Any:
        """Whether it tells its state within so many s, under its new node id."""
        # Another one on this bus is not the one that was sent away.
        others = self.others()
        found = self._teller(len(self.every), lambda node: node not in others)
        self.gives_out = True
        yield Wait(self.now + within, found)
        self.node = _node_of(found()) or self.node
        self._ids.add(self.node)
        return found() is not None

    def static_again(self) -> Any:
        """Whether it is under its own node id again, with the static node id that it had."""
        if not (yield from self.put_back(p.STATIC_NODE_ID)):
            return False
        yield from self.save_and_restart()
        self.node = self._home
        return (yield from self.is_back(_AWAY))

    def state_in(self, status: TransferPacket) -> ParachuteState | None:
        """The state in its status; None: a number without a name, or the types do not tell it."""
        name = self.definitions.state_name(status.kind, status.values)
        return ParachuteState.__members__.get(name)

    def state(self) -> Any:
        """The state (state_in) that it tells next."""
        status = yield from self.wait_for(self.device.status, STATUS_WITHIN)
        if status is None:
            raise failed(f"no {self.status} within {STATUS_WITHIN:g} s")
        return self.state_in(status)

    def reaches(self, state: ParachuteState, within: float) -> Any:
        """Whether it tells this state within so many s."""
        told = yield from self.wait_for(
            self.device.status, within, lambda one: self.state_in(one) is state
        )
        return told is not None

    def is_up(self, within: float) -> Any:
        """Whether its start has ended within so many s."""
        if self.device.up:
            return (yield from self.reaches(ParachuteState[self.device.up], within))
        return (yield from self.wait_for(self.device.status, within)) is not None


def _answer_in(
    heard: Sequence[TransferPacket], server: int, service: str, number: int
) -> Callable[[], TransferPacket | None]:
    """The first response from now on to the request of this number."""

    def answers(one: TransferPacket) -> bool:
        told = one.transfer
        is_from = told.kind, told.source, told.name, told.transfer_id
        return is_from == (TransferKind.RESPONSE, server, service, number)

    return first_of(heard, len(heard), answers)


def _node_of(one: TransferPacket | None) -> int:
    """Who sent it; 0: nobody."""
    return 0 if one is None else one.transfer.source
