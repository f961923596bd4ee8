"""CAN frames to DroneCAN transfers to values: as they come, and with right tails and CRCs."""

from __future__ import annotations

import functools

from chute_ros.errors import MessageError
from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.protocol.dronecan.can_frame import pack
from chute_ros.protocol.dronecan.data_types import DataType, DataTypes
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.dronecan.transfer import MOST_SESSIONS, Transfer, TransferKind, frames_of
from chute_ros.transport.data_types import load_data_types
from fuzz.program import Program
from fuzz.target import Target, WrongError

US, CONTROLLER, TRIGGER = 10, 33, 34
#: The stores that may be larger than others.
LARGER = {"Assembler._sessions": MOST_SESSIONS}
_FRAME = 16
#: Those that something is done with.
NAMES = (
    names.PARACHUTE_STATUS,
    names.TRIGGER_STATUS,
    names.VEHICLE_SERVICE,
    names.PARACHUTE_SERVICE,
    names.TRIGGER_SERVICE,
    names.TRIGGER_LAUNCH,
    names.VEHICLE_STATUS,
    "uavcan.protocol.NodeStatus",
    "uavcan.protocol.GetNodeInfo",
    "uavcan.protocol.RestartNode",
    "uavcan.protocol.GetTransportStats",
    "uavcan.protocol.GlobalTimeSync",
    "uavcan.protocol.dynamic_node_id.Allocation",
    bus_requests.GET_SET,
    bus_requests.EXECUTE_OPCODE,
)


@functools.cache
def data_types() -> DataTypes:
    """The standard ones and those of the parachute."""
    return load_data_types("", "fuzz")


@functools.cache
def kinds() -> tuple[tuple[TransferKind, DataType], ...]:
    """All of them, with their directions; those of NAMES first."""
    types = data_types()
    found = []
    for name in NAMES:
        for kind in TransferKind:
            one = types.find(name, kind.value)
            found += [(kind, one)] if one is not None else []
    known = {one.name for _, one in found}
    for kind in TransferKind:
        for number in range(0x10000 if kind is TransferKind.MESSAGE else 0x100):
            one = types.by_id(number, kind.value)
            found += [(kind, one)] if one is not None and one.name not in known else []
    return tuple(found)


def transfer_of(p: Program) -> tuple[list[bytes], TransferKind, DataType]:
    """The frames of a good transfer, of a payload that is any bytes."""
    how = p.byte()
    few = 2 * len(NAMES) - len([one for one in NAMES if data_types().find(one, None)])
    kind, data_type = kinds()[p.byte() % few] if how & 1 else kinds()[p.whole(2) % len(kinds())]
    payload = p.piece()
    if how & 2:
        payload = payload.ljust(len(data_type.encode({})), b"\0")
    source = p.choice((CONTROLLER, TRIGGER)) if how & 4 else p.byte() % 128
    service = kind is not TransferKind.MESSAGE
    number, priority = p.byte() % 32, p.byte() % 32
    transfer = Transfer(
        kind, data_type.id, source, US if service else 0, number, payload, priority
    )
    try:
        frames = frames_of(transfer, data_type.base_crc, 0)
    except MessageError:  # from nobody, and too long for that
        return [], kind, data_type
    return [pack(frame) for frame in frames], kind, data_type


class Frames:
    """Any frames: sixteen bytes each, the last as long as it is."""

    def __init__(self) -> None:
        self._endpoint = Endpoint(data_types(), US)
        self._now = 1000.0

    def held(self) -> object:
        return self._endpoint

    def feed(self, data: bytes) -> None:
        for start in range(0, len(data), _FRAME):
            self._now += 0.01
            self._endpoint.receive(data[start : start + _FRAME], self._now)


class Transfers:
    """Good transfers, of which frames are lost, come twice or are spoilt."""

    def __init__(self) -> None:
        self._endpoint = Endpoint(data_types(), US)
        self._now = 1000.0

    def held(self) -> object:
        return self._endpoint

    def feed(self, data: bytes) -> None:
        program = Program(data)
        while not program.over:
            # After such a pause every transfer is a new one.
            self._now += program.choice((0.01, 0.01, 0.01, 3.0))
            frames, kind, data_type = transfer_of(program)
            spoil = program.byte()
            if not frames or spoil & 1:
                self._now += 3.0
                self._whole(frames, kind, data_type)
            else:
                self._spoilt(frames, program)

    def _whole(self, frames: list[bytes], kind: TransferKind, data_type: DataType) -> None:
        before = sum(self._endpoint.counts.values())
        heard = [self._endpoint.receive(frame, self._now) for frame in frames]
        counted = sum(self._endpoint.counts.values()) - before
        came = [one for one in heard if one is not None]
        if any((one.kind, one.name) != (kind, data_type.name) for one in came):
            raise WrongError(f"a {data_type.name} was taken for {came}")
        if frames and not came and not counted and data_type.name in NAMES:
            # As our own, that of an unnamed one, or too long: all but the first is counted.
            own = frames[0][0] & 0x7F == US
            if not own:
                raise WrongError(f"a whole {data_type.name} vanished: {frames}")

    def _spoilt(self, frames: list[bytes], p: Program) -> None:
        for frame in frames:
            what = p.byte()
            changed = bytearray(frame)
            if what & 4:
                changed[p.byte() % _FRAME] ^= p.byte()
            for _ in range(what & 3):
                self._endpoint.receive(bytes(changed), self._now)


TARGETS = (
    Target("upf.frames", "any CAN frames to transfers to values", Frames, larger=LARGER),
    Target("upf.transfers", "good transfers, and spoilt ones", Transfers, larger=LARGER),
)
