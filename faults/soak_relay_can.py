"""The relay on the CAN bus of the soak."""

from __future__ import annotations

import random
import struct
import time
from collections.abc import Callable

from chute_ros.links.upf.protocol.config import CONTROLLER_NODE_ID, TRIGGER_NODE_ID
from chute_ros.links.upf.protocol.definitions import (
    PARACHUTE_SERVICE,
    TRIGGER_LAUNCH,
    TRIGGER_SERVICE,
)
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.dronecan.transfer import TransferKind
from chute_ros.transport.can_address import CanAddress
from chute_ros.transport.can_multicast import CanMulticastWire
from chute_ros.transport.data_types import load_data_types
from faults.soak_relay import DEPLOY, TIMES, VALID, Relay, Seen

#: A node that is nobody's, and what it says: NodeStatus, one frame.
_STRANGER, _NODE_STATUS = 99, 341
_DEVICES = (CONTROLLER_NODE_ID, TRIGGER_NODE_ID)


class CanRelay(Relay):
    """Between the nodes' bus and the devices' bus."""

    def __init__(self, seen: Seen, node: CanAddress, devices: CanAddress) -> None:
        super().__init__("can", seen)
        self._up_wire, self._down_wire = CanMulticastWire(node), CanMulticastWire(devices)
        self._up_wire.open()
        self._down_wire.open()
        #: Hears the requests that go to the devices, as each of them would.
        types = load_data_types("", "dsdl_path")
        self._ears = {node_id: Endpoint(types, node_id) for node_id in _DEVICES}

    def files(self) -> dict[int, Callable[[], None]]:
        (up,), (down,) = self._up_wire.files(), self._down_wire.files()
        return {up: self._down, down: self._up}

    def close(self) -> None:
        self._up_wire.close()
        self._down_wire.close()

    def _down(self) -> None:
        for data, _ in self._up_wire.read(self._up_wire.files()[0]):
            if not self.takes():
                continue
            self._listen(data)
            _write(self._down_wire, data)

    def _up(self) -> None:
        for data, _ in self._down_wire.read(self._down_wire.files()[0]):
            if not self.takes():
                continue
            _write(self._up_wire, data)
            for one in self._more():
                _write(self._up_wire, one)

    def _listen(self, data: bytes) -> None:
        frame = unpack(data)
        if frame is None:
            return
        service = frame.identifier & 0x80
        for node_id, ear in self._ears.items():
            if service and frame.identifier >> 8 & 0x7F != node_id:
                continue
            heard = ear.receive(data, time.monotonic())
            if heard is None:
                continue
            if heard.name == TRIGGER_LAUNCH and node_id == TRIGGER_NODE_ID:
                self.seen(self.name, DEPLOY, heard.name)
            if heard.kind is not TransferKind.REQUEST:
                continue
            # TYPE_DEPLOY and TYPE_DEPLOY_FORCE; a trigger is asked for nothing else.
            asks = heard.name == PARACHUTE_SERVICE and heard.values.get("type") in (5, 6)
            if asks or heard.name == TRIGGER_SERVICE:
                self.seen(self.name, DEPLOY, f"{heard.name} {heard.values.get('type')}")

    def _more(self) -> list[bytes]:
        if not self.flood:
            return []
        return [
            stranger(self.chance) if self.flood == VALID else nonsense(self.chance)
            for _ in range(TIMES)
        ]


def stranger(chance: random.Random) -> bytes:
    """A frame that is right, of a node that nobody needs."""
    identifier = 16 << 24 | _NODE_STATUS << 8 | _STRANGER
    uptime = struct.pack("<I", chance.randrange(2**31))
    return pack(CanFrame(identifier, uptime + b"\0\0\0" + bytes((0xC0 | chance.randrange(32),))))


def nonsense(chance: random.Random) -> bytes:
    """A frame that no transfer can be made of: of strangers, without a beginning or an end."""
    identifier = chance.randrange(2**29) & ~0x7F | chance.randrange(101, 127)
    begins = chance.random() < 0.5
    tail = (0x80 if begins else 0x20) | chance.randrange(32)
    return pack(CanFrame(identifier, chance.randbytes(chance.randrange(8)) + bytes((tail,))))


def _write(wire: CanMulticastWire, data: bytes) -> None:
    try:
        wire.write(data)
    except OSError:
        pass  # the interface is down: lost
