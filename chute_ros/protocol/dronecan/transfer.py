"""DroneCAN transfers: one message, request or response, in one frame or several.

Source: DroneCAN specification, "CAN bus transport layer". What is wrong with a frame never raises:
it is counted under its reason, and dropped with the transfer that it belongs to.
"""

from __future__ import annotations

import enum
from binascii import crc_hqx
from collections import Counter, OrderedDict, deque
from dataclasses import dataclass, field

from chute_ros.errors import MessageError
from chute_ros.protocol.dronecan.can_frame import CanFrame, unpack
from chute_ros.protocol.dronecan.data_types import DataTypes

#: Bits of the last byte of a frame, beside the transfer id.
START, END, TOGGLE = 0x80, 0x40, 0x20
TRANSFER_IDS = 32
_FRAME_PAYLOAD = 7
#: A transfer whose next frame does not come within this time (s) is given up; after it, the same
#: transfer id is a new transfer (specification: 2 s).
TRANSFER_TIMEOUT = 2.0
#: Most senders and types that are followed at once, so that made-up ids cannot grow us.
MOST_SESSIONS = 1024
#: Longest payload that is put together, bytes: more than any standard type has.
MOST_PAYLOAD = 512
HIGHEST_NODE_ID = 127
_HIGHEST_PRIORITY = 31
#: A frame that was overtaken comes at most so late (s): within it a transfer that has the id of
#: one of the last so many is the same again; after it, only one that has the id of the newest.
#: And a message whose id is up to so many before the newest one's tells of a state that is over.
#: Longer would make a device that restarted, and counts from 0 again, go unheard.
_OVERTAKEN = 0.1
_REMEMBERED = 8
#: uavcan.protocol.NodeStatus. Each is heard, however late: that two nodes have one id shows in
#: their uptimes, and where those and their transfer ids are the same in how often they come.
_NODE_STATUS = 341


class TransferKind(enum.Enum):
    """What a transfer is; the value is how data types name its direction."""

    MESSAGE = None
    REQUEST = "request"
    RESPONSE = "response"


@dataclass(frozen=True)
class Transfer:
    """A complete transfer. source 0: anonymous. destination 0: everybody (messages)."""

    kind: TransferKind
    type_id: int
    source: int
    destination: int
    transfer_id: int
    payload: bytes
    priority: int = 16


def frames_of(transfer: Transfer, base_crc: int, discriminator: int = 0) -> list[CanFrame]:
    """The frames of a transfer, in order. discriminator: 14 bits for an anonymous message.
    MessageError for a transfer that cannot be."""
    _check(transfer)
    payload = transfer.payload
    if len(payload) > _FRAME_PAYLOAD:
        if transfer.source == 0:
            raise MessageError(f"{len(payload)} bytes: an anonymous transfer has one frame")
        crc = crc_hqx(payload, base_crc)
        payload = bytes((crc & 0xFF, crc >> 8)) + payload
    identifier = _identifier(transfer, discriminator)
    frames, toggle = [], 0
    for start in range(0, max(len(payload), 1), _FRAME_PAYLOAD):
        chunk = payload[start : start + _FRAME_PAYLOAD]
        tail = transfer.transfer_id % TRANSFER_IDS | toggle
        tail |= START if start == 0 else 0
        tail |= END if start + _FRAME_PAYLOAD >= len(payload) else 0
        frames.append(CanFrame(identifier, chunk + bytes((tail,))))
        toggle ^= TOGGLE
    return frames


def _check(transfer: Transfer) -> None:
    service = transfer.kind is not TransferKind.MESSAGE
    anonymous = transfer.source == 0
    for name, value, low, high in (
        ("priority", transfer.priority, 0, _HIGHEST_PRIORITY),
        ("source", transfer.source, int(service), HIGHEST_NODE_ID),
        ("destination", transfer.destination, int(service), HIGHEST_NODE_ID if service else 0),
        ("type_id", transfer.type_id, 0, 0xFF if service else 0x3 if anonymous else 0xFFFF),
    ):
        if not low <= value <= high:
            what = "an anonymous message" if anonymous and not service else transfer.kind.name
            raise MessageError(f"{name} of {what} is {value}: need {low} to {high}")


def _identifier(transfer: Transfer, discriminator: int) -> int:
    common_part = transfer.priority << 24 | transfer.source
    if transfer.kind is not TransferKind.MESSAGE:
        request = transfer.kind is TransferKind.REQUEST
        service = transfer.type_id << 16 | request << 15 | transfer.destination << 8 | 0x80
        return common_part | service
    if transfer.source == 0:
        return common_part | (discriminator & 0x3FFF) << 10 | (transfer.type_id & 0x3) << 8
    return common_part | transfer.type_id << 8


def head_of(frame: CanFrame, payload: bytes = b"") -> Transfer:
    """All of a transfer that a frame of it says with its identifier and its tail byte, with this
    payload."""
    identifier = frame.identifier
    priority, source = identifier >> 24 & 0x1F, identifier & 0x7F
    transfer_id = frame.data[-1] % TRANSFER_IDS
    if identifier & 0x80:
        kind = TransferKind.REQUEST if identifier & 0x8000 else TransferKind.RESPONSE
        type_id, destination = identifier >> 16 & 0xFF, identifier >> 8 & 0x7F
        return Transfer(kind, type_id, source, destination, transfer_id, payload, priority)
    type_id = identifier >> 8 & (0x3 if source == 0 else 0xFFFF)
    return Transfer(TransferKind.MESSAGE, type_id, source, 0, transfer_id, payload, priority)


@dataclass
class _Session:
    """One sender's transfers of one type to one destination."""

    transfer_id: int = -1
    heard: float = 0.0
    toggle: int = 0
    crc: int = 0
    #: What came so far of a transfer of several frames; None: there is none under way.
    payload: bytearray | None = None
    #: What the newest complete transfer of one frame said.
    said: bytes = b""
    #: (transfer id, when) of the newest complete transfers.
    done: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))

    def came_before(self, transfer_id: int, within: float, now: float) -> bool:
        """It is one of the newest complete ones again; the very newest, within so many s."""
        if self.done and self.done[-1][0] == transfer_id:
            return now - self.done[-1][1] < within
        return any(one == transfer_id and now - at < _OVERTAKEN for one, at in self.done)

    def is_old_news(self, transfer_id: int, now: float) -> bool:
        """It left before the newest complete one, which has overtaken it."""
        if not self.done:
            return False
        newest, at = self.done[-1]
        behind = (newest - transfer_id) % TRANSFER_IDS
        return 0 < behind <= _REMEMBERED and now - at < _OVERTAKEN


_SessionKey = tuple[TransferKind, int, int, int]


class Assembler:
    """Puts frames together again. counts: why something was dropped."""

    def __init__(self, types: DataTypes, counts: Counter[str]) -> None:
        self._types = types
        self._counts = counts
        #: The one that was heard last is the last.
        self._sessions: OrderedDict[_SessionKey, _Session] = OrderedDict()

    def feed(self, data: bytes, node_id: int, now: float) -> Transfer | CanFrame | None:
        """The transfer that this frame (sixteen bytes, see can_frame) completes; the frame itself
        if it reports an error of the bus; None: nothing yet. node_id: ours."""
        frame = unpack(data)
        if frame is None:
            return self._drop("no CAN frame")
        if frame.error:
            return frame
        if frame.remote or not frame.extended:
            return self._drop("frames that are not of DroneCAN")
        if not frame.data:
            return self._drop("frames without a tail byte")
        head = head_of(frame)
        if head.destination not in (0, node_id):
            return None
        if head.kind is not TransferKind.MESSAGE and 0 in (head.source, head.destination):
            return self._drop("services from or to nobody")
        if self._types.by_id(head.type_id, head.kind.value) is None:
            return self._drop("transfers of unknown types")
        if head.source == 0:
            if frame.data[-1] & (START | END | TOGGLE) != START | END:
                return self._drop("anonymous transfers of more than one frame")
            return head_of(frame, frame.data[:-1])
        return self._next(head, frame, now)

    def _next(self, head: Transfer, frame: CanFrame, now: float) -> Transfer | None:
        key = (head.kind, head.type_id, head.source, head.destination)
        session = self._sessions.pop(key, None) or _Session()
        self._sessions[key] = session
        if len(self._sessions) > MOST_SESSIONS:
            self._sessions.popitem(last=False)
        tail, chunk = frame.data[-1], frame.data[:-1]
        same = session.transfer_id == head.transfer_id and now - session.heard < TRANSFER_TIMEOUT
        if tail & START:
            within = _OVERTAKEN if head.type_id == _NODE_STATUS else TRANSFER_TIMEOUT
            if session.came_before(head.transfer_id, within, now):
                # A device that has just started counts from 0 again; what it says then differs.
                newest = session.done[-1][0] == head.transfer_id
                anew = newest and tail & END and session.said not in (b"", chunk)
                if not anew:
                    return self._drop("duplicate transfers")
            tells_a_state = head.kind is TransferKind.MESSAGE and head.type_id != _NODE_STATUS
            if tells_a_state and session.is_old_news(head.transfer_id, now):
                return self._drop("messages that a newer one has overtaken")
            if tail & TOGGLE:
                return self._drop("toggle bit wrong")
            if not tail & END and len(chunk) < _FRAME_PAYLOAD:
                return self._drop("first frame too short")
            if session.payload is not None and not same:
                self._drop("transfers cut short")
            session.transfer_id, session.heard, session.toggle = head.transfer_id, now, TOGGLE
            if tail & END:
                session.payload = None
                session.done.append((head.transfer_id, now))
                session.said = chunk
                return head_of(frame, chunk)
            session.crc = chunk[0] | chunk[1] << 8
            session.payload = bytearray(chunk[2:])
            return None
        if session.payload is None or not same:
            return self._drop("frames without their beginning")
        if tail & TOGGLE != session.toggle:
            # A frame that came twice, or one was lost: the CRC decides in the end.
            return self._drop("toggle bit wrong")
        session.toggle ^= TOGGLE
        session.heard = now
        session.payload += chunk
        if len(session.payload) > MOST_PAYLOAD:
            session.payload = None
            return self._drop("transfers that are too long")
        if not tail & END:
            return None
        payload, session.payload = bytes(session.payload), None
        data_type = self._types.by_id(head.type_id, head.kind.value)
        assert data_type is not None  # feed has looked
        if crc_hqx(payload, data_type.base_crc) != session.crc:
            # It may be sent again under the same number.
            return self._drop("CRC of a transfer wrong (or another definition of its type)")
        session.done.append((head.transfer_id, now))
        session.said = b""
        return head_of(frame, payload)

    def _drop(self, reason: str) -> Transfer | None:
        self._counts[reason] += 1
        return None
