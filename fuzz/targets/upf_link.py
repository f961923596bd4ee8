"""A UPF link with all its transactions, driven by a program: transfers, time, requests."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from chute_ros.links.upf.protocol import bus_requests, parameters
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.events import BusRequestFinished
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.model import Armed, LandedState, LinkState, VehicleState
from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.protocol.dronecan.can_frame import pack, unpack
from chute_ros.protocol.dronecan.transfer import (
    TRANSFER_IDS,
    Assembler,
    Transfer,
    TransferKind,
    frames_of,
)
from fuzz.program import Program
from fuzz.target import Target, WrongError
from fuzz.targets.linked import Linked
from fuzz.targets.upf_frames import CONTROLLER, LARGER, TRIGGER, US, data_types, transfer_of

_NODES = (0, CONTROLLER, TRIGGER, 99)
_TEXTS = ("true", "false", "50", "-1", "nan", "9" * 40, "", "x" * 200)
#: Said all the time, and nothing that fires.
_CONSTANTLY = (
    "uavcan.protocol.NodeStatus",
    names.VEHICLE_STATUS,
    "uavcan.protocol.GlobalTimeSync",
)
_DEPLOYS = ("TYPE_DEPLOY", "TYPE_DEPLOY_FORCE")
_REQUESTS = ("TYPE_TAKEOFF", "TYPE_ARM", "TYPE_DISARM", "TYPE_LAND", *_DEPLOYS)
#: Any node is asked who it is, and a few for more.
_LARGER = {**LARGER, "ServiceCalls._given_up": 2 * 128 * TRANSFER_IDS}


class UpfLinked(Linked):
    """One link, and what it was asked for."""

    def __init__(self, without_controller: bool = False) -> None:
        config = UpfConfig(without_controller=without_controller)
        super().__init__(UpfLink(config, data_types()))
        self._definitions = self._link.definitions
        self._ear = Assembler(data_types(), Counter())
        self._kept: list[int] = []
        self._owner_lives = False
        self._steps = (
            self._wait,
            self._to_next_deadline,
            self._transfer,
            self._transfer,
            self._kindly,
            self._kindly,
            self._answer,
            self._bytes,
            self._deploy,
            self._service,
            self._bus_request,
            self._parameter,
            self._vehicle,
            self._supervisor,
            self._owner,
        )
        #: The newest requests that left: what a device may answer.
        self._asked: list[Transfer] = []

    # -- steps of a program ----------------------------------------------------------------------

    def _transfer(self, p: Program) -> None:
        frames, _, _ = transfer_of(p)
        for frame in frames:
            self._link.receive(frame, self._now)

    def _kindly(self, p: Program) -> None:
        """A device says what it says all the time."""
        what, node = p.byte(), p.choice((CONTROLLER, TRIGGER))
        name = (names.PARACHUTE_STATUS, names.TRIGGER_STATUS, "uavcan.protocol.NodeStatus")
        self._say(node, name[what % 3], p)

    def _say(self, node: int, name: str, p: Program) -> None:
        values: dict[str, Any]
        if name == names.PARACHUTE_STATUS:
            values = {"state": p.byte() % 8, "is_vehicle_connected": True, "error_flags": p.byte()}
        elif name == names.TRIGGER_STATUS:
            values = {"state": p.byte() % 4, "is_launched": p.flag()}
        else:
            values = {"uptime_sec": p.byte(), "health": p.byte() % 4}
        kind = data_types().message(name)
        payload = kind.encode(self._definitions.present(name, values))
        self._deliver(Transfer(TransferKind.MESSAGE, kind.id, node, 0, p.byte() % 32, payload))

    def _answer(self, p: Program) -> None:
        """A device answers one of the newest requests, with any payload or a small number."""
        if not self._asked:
            return
        asked = p.choice(self._asked)
        payload = p.piece() if p.flag() else bytes((p.byte() % 8,))
        answer = Transfer(
            TransferKind.RESPONSE, asked.type_id, asked.destination, US, asked.transfer_id, payload
        )
        self._deliver(answer)

    def _deliver(self, transfer: Transfer) -> None:
        kind = data_types().by_id(transfer.type_id, transfer.kind.value)
        assert kind is not None
        for frame in frames_of(transfer, kind.base_crc):
            self._link.receive(pack(frame), self._now)

    def _bytes(self, p: Program) -> None:
        self._link.receive(p.some(16), self._now)

    def _deploy(self, p: Program) -> None:
        token, what = self._orders.begin("deploy"), p.byte()
        if what & 4:
            self._link.fire_triggers(token, self._now)
        else:
            self._link.deploy(token, bool(what & 1), self._now, p.choice(_NODES))

    def _service(self, p: Program) -> None:
        type_name, node = p.choice(_REQUESTS), p.choice(_NODES)
        if p.flag():
            arm = type_name in ("TYPE_TAKEOFF", "TYPE_ARM")
            self._link.arm(self._orders.begin("arm" if arm else "disarm"), arm, 0, self._now)
            return
        token = self._orders.begin("deploy" if type_name in _DEPLOYS else type_name)
        self._link.service(token, type_name, node, self._now)

    def _bus_request(self, p: Program) -> None:
        token, what, node = self._orders.begin("bus request"), p.byte(), p.choice(_NODES)
        if what % 3 == 0:
            self._link.bus_request(token, node, bus_requests.list_parameters, self._now)
        elif what % 3 == 1:
            self._link.bus_request(token, node, bus_requests.node_info, self._now)
        else:
            self._link.disturb(token, node, bool(what & 64), bus_requests.restart, self._now)

    def _parameter(self, p: Program) -> None:
        token, node, text = self._orders.begin("bus request"), p.choice(_NODES), p.choice(_TEXTS)
        name = p.choice((parameters.LIGHT, parameters.ENABLE_APS, text))
        self._link.set_parameter(token, node, name, text, p.flag(), self._now)

    def _vehicle(self, p: Program) -> None:
        what = p.byte()
        armed = Armed.ARMED if what & 1 else Armed.DISARMED
        landed = LandedState.IN_AIR if what & 2 else LandedState.ON_GROUND
        state = VehicleState(
            link_state=LinkState.OK,
            armed=armed,
            armed_age=0.0,
            landed_state=landed,
            landed_state_age=p.byte() / 10.0,
            height=float(p.whole(4)),
            height_age=0.0,
            vertical_speed=float(p.whole(2)),
            vertical_speed_age=0.0,
        )
        self._link.vehicle(state, self._now)

    def _supervisor(self, p: Program) -> None:
        what = p.byte()
        if what & 1:
            self._link.kill_confirmed(self._now)
        else:
            self._link.supervisor_said(bool(what & 2), {str(p.choice(_NODES))}, self._now)

    def _owner(self, p: Program) -> None:
        self._owner_lives = p.flag()
        self._link.devices.picture(self._now)
        if self._kept and p.flag():
            self._link.table_kept(self._kept.pop(0), self._now)

    # -- what comes of it ------------------------------------------------------------------------

    def _run_out(self) -> None:
        # What is under way ends also without us; and what we say all the time takes its time.
        lived, self._owner_lives = self._owner_lives, False
        super()._run_out()
        self._owner_lives = lived

    def _turn(self, now: float) -> None:
        if self._owner_lives:
            self._link.owner_alive(now + 1.0)
        super()._turn(now)

    def _happened(self, event: object) -> None:
        if isinstance(event, BusRequestFinished):
            self._orders.ended(event.token)
        elif isinstance(event, KeepTable):
            self._kept = [*self._kept, event.number][-4:]
        else:
            super()._happened(event)

    def _left(self, data: bytes) -> None:
        frame = unpack(data)
        if frame is None or not frame.extended:
            raise WrongError(f"what left is no frame: {data.hex()}")
        service = bool(frame.identifier & 0x80)
        listener = frame.identifier >> 8 & 0x7F if service else US
        came = self._ear.feed(data, listener, self._now)
        if not isinstance(came, Transfer):
            return
        kind = data_types().by_id(came.type_id, came.kind.value)
        assert kind is not None
        if kind.name in _CONSTANTLY:
            return
        values = kind.decode(came.payload)
        if values is None:
            raise WrongError(f"a {kind.name} left that cannot be read: {came}")
        if came.kind is TransferKind.REQUEST:
            self._asked = [*self._asked, came][-4:]
        if came.kind is not TransferKind.RESPONSE:
            self._check(kind.name, values)

    def _check(self, name: str, values: Mapping[str, Any]) -> None:
        """What fires, or changes how ready the parachute is, was ordered."""
        if name in (names.TRIGGER_SERVICE, names.TRIGGER_LAUNCH):
            self._orders.left(name, ("deploy",))
        elif name == names.PARACHUTE_SERVICE:
            type_name = self._definitions.type_name(name, values)
            by = {
                "TYPE_TAKEOFF": ("arm", "TYPE_TAKEOFF"),
                "TYPE_ARM": ("arm", "TYPE_ARM"),
                "TYPE_DISARM": ("disarm", "TYPE_DISARM"),
                "TYPE_LAND": ("TYPE_LAND",),
            }
            self._orders.left(type_name, by.get(type_name, ("deploy",)))
        elif name in (bus_requests.EXECUTE_OPCODE, "uavcan.protocol.RestartNode"):
            self._orders.left(name, ("bus request",))


TARGETS = (
    Target(
        "upf.link",
        "the link with its transactions, allocator and time",
        UpfLinked,
        longest=256,
        larger=_LARGER,
    ),
    Target(
        "upf.link_triggers",
        "the same where there is no controller",
        lambda: UpfLinked(without_controller=True),
        longest=256,
        larger=_LARGER,
    ),
)
