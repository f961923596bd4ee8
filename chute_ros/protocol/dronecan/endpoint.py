"""One node's place on a DroneCAN bus: frames in, values out, and the other way round."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chute_ros.protocol.dronecan.can_frame import ERROR_BUS_OFF, ERROR_RESTARTED, CanFrame, pack
from chute_ros.protocol.dronecan.data_types import DataType, DataTypes
from chute_ros.protocol.dronecan.transfer import (
    TRANSFER_IDS,
    Assembler,
    Transfer,
    TransferKind,
    frames_of,
)


@dataclass(frozen=True)
class ReceivedTransfer:
    """A message, request or response for us. source 0: anonymous."""

    kind: TransferKind
    name: str
    source: int
    transfer_id: int
    values: Mapping[str, Any]


class Endpoint:
    """Speaks for node_id (0: anonymous, may only listen and send anonymous messages)."""

    def __init__(self, types: DataTypes, node_id: int) -> None:
        self.types = types
        self.node_id = node_id
        #: Why something that came was dropped -> how often.
        self.counts: Counter[str] = Counter()
        self.received_count = 0
        self.sent_count = 0
        #: When somebody else was last seen to send under our node id.
        self.own_id_heard = float("nan")
        self.bus_off = False
        self.bus_off_count = 0
        self._assembler = Assembler(types, self.counts)
        self._next_ids: dict[str, int] = {}
        self._output: list[bytes] = []

    def receive(self, data: bytes, now: float) -> ReceivedTransfer | None:
        """Bytes of one frame came; what it completes, or None."""
        came = self._assembler.feed(data, self.node_id, now)
        if came is None:
            return None
        if isinstance(came, CanFrame):
            self._bus_error(came.identifier)
            return None
        # Whoever can be heard is not off the bus.
        self.bus_off = False
        if self.node_id and came.source == self.node_id:
            self.own_id_heard = now
            return None
        self.received_count += 1
        data_type = self.types.by_id(came.type_id, came.kind.value)
        assert data_type is not None  # the assembler has looked
        values = data_type.decode(came.payload)
        if values is None:
            self.counts[f"{data_type.name} too short"] += 1
            return None
        return ReceivedTransfer(came.kind, data_type.name, came.source, came.transfer_id, values)

    def broadcast(self, name: str, values: Mapping[str, Any], priority: int = 16) -> None:
        """Send a message."""
        data_type = self.types.message(name)
        number = self._next_ids.get(name, 0)
        payload = data_type.encode(values)
        kind, source = TransferKind.MESSAGE, self.node_id
        transfer = Transfer(kind, data_type.id, source, 0, number, payload, priority)
        discriminator = 0
        if not source:
            # Told apart by what is said, as the specification suggests.
            discriminator = sum(byte * (i + 1) * 131 for i, byte in enumerate(payload)) & 0x3FFF
        self._send(transfer, data_type.base_crc, discriminator)
        self._next_ids[name] = (number + 1) % TRANSFER_IDS

    def request(
        self, server: int, service: str, transfer_id: int, values: Mapping[str, Any], priority: int
    ) -> None:
        """Send a request."""
        data_type = self.types.request(service)
        self._call(TransferKind.REQUEST, data_type, server, transfer_id, values, priority)

    def respond(
        self, request: ReceivedTransfer, values: Mapping[str, Any], priority: int = 16
    ) -> None:
        """Answer a request."""
        self.respond_to(request.source, request.name, request.transfer_id, values, priority)

    def respond_to(
        self,
        client: int,
        service: str,
        transfer_id: int,
        values: Mapping[str, Any],
        priority: int = 16,
    ) -> None:
        """Answer the request with this transfer id."""
        data_type = self.types.response(service)
        self._call(TransferKind.RESPONSE, data_type, client, transfer_id, values, priority)

    def take_output(self) -> list[bytes]:
        """Frames to send, oldest first; each is handed out once."""
        output, self._output = self._output, []
        return output

    def _call(
        self,
        kind: TransferKind,
        data_type: DataType,
        other: int,
        transfer_id: int,
        values: Mapping[str, Any],
        priority: int,
    ) -> None:
        where = (self.node_id, other, transfer_id)
        transfer = Transfer(kind, data_type.id, *where, data_type.encode(values), priority)
        self._send(transfer, data_type.base_crc)

    def _send(self, transfer: Transfer, base_crc: int, discriminator: int = 0) -> None:
        self._output += [pack(frame) for frame in frames_of(transfer, base_crc, discriminator)]
        self.sent_count += 1

    def _bus_error(self, classes: int) -> None:
        if classes & ERROR_BUS_OFF:
            self.bus_off = True
            self.bus_off_count += 1
        elif classes & ERROR_RESTARTED:
            self.bus_off = False
        else:
            self.counts["error frames of the bus"] += 1
