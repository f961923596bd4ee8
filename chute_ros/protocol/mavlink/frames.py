"""MAVLink 1 and 2 frames: bytes to messages and back.

Source: MAVLink developer guide, "Packet serialization". The payloads are read and written by the
generated dialect; the framing is ours so that a damaged frame costs only itself: after one the
search goes on at its second byte, and every dropped byte is counted under a reason.
"""

from __future__ import annotations

import math
import struct
from collections import Counter, deque
from dataclasses import dataclass
from typing import Any

from chute_ros.errors import MessageError
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.signing import Signer, Verifier

MAGIC_V1 = 0xFE
MAGIC_V2 = 0xFD
_HEADER_V1 = 6
_HEADER_V2 = 10
_CHECKSUM = 2
_SIGNATURE = 13
_FLAG_SIGNED = 0x01
#: A frame of 280 bytes takes 292 ms at 9,600 baud: one that is not complete after this is noise.
LONGEST_FRAME_TIME = 0.3  # s

#: Reasons under which received bytes are dropped.
NOISE = "bytes that are no MAVLink frame"
BAD_CHECKSUM = "frame with a wrong checksum"
UNKNOWN_MESSAGE = "frame of a message unknown to the dialect"
UNKNOWN_FLAGS = "frame with incompatible flags"
TRUNCATED = "datagram that ends inside a frame"


@dataclass(frozen=True)
class Frame:
    """One message that was received whole. message is of the generated dialect."""

    message: Any
    system_id: int
    component_id: int
    sequence: int
    version: int
    signed: bool

    @property
    def device(self) -> str:
        """Who sent it, as "system/component"."""
        return f"{self.system_id}/{self.component_id}"


class FrameDecoder:
    """Finds the frames in a stream of bytes, or in one datagram after the other.

    Never raises on what it is fed; never holds more than one frame's length of bytes.
    counts: reason -> how many frames (bytes for NOISE) were dropped; shared between the streams
    of one link if the same Counter is given to each.
    """

    def __init__(
        self, verifier: Verifier | None = None, counts: Counter[str] | None = None
    ) -> None:
        self.counts: Counter[str] = Counter() if counts is None else counts
        self._verifier = verifier
        self._buffer = bytearray()
        #: (time of receipt, how many) of the bytes in the buffer, oldest first.
        self._received: deque[tuple[float, int]] = deque()
        self._reader = dialect.MAVLink(None)

    def feed(self, data: bytes, now: float) -> list[Frame]:
        """Frames completed by data, the next bytes of a stream; the rest is kept for later."""
        frames = self.update(now)
        if data:
            self._buffer += data
            self._received.append((now, len(data)))
        return frames + self._take(now)

    def update(self, now: float) -> list[Frame]:
        """Look at the clock: a false start mark must not hold back the true frames behind it."""
        frames: list[Frame] = []
        while self.next_deadline() <= now:
            self.counts[NOISE] += 1
            self._drop(1)
            frames += self._take(now)
        return frames

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return self._received[0][0] + LONGEST_FRAME_TIME if self._received else math.inf

    def feed_datagram(self, data: bytes, now: float) -> list[Frame]:
        """Frames in data, a datagram: none continues in the next one."""
        frames: list[Frame] = []
        rest = data
        truncated = False
        while rest:
            found, used = self._scan(rest, now)
            frames += found
            rest = rest[used:]
            # What looks like the start of a longer frame may be noise before a true one.
            truncated = truncated or bool(rest)
            rest = rest[1:]
        if truncated:
            self.counts[TRUNCATED] += 1
        return frames

    def _take(self, now: float) -> list[Frame]:
        frames, used = self._scan(self._buffer, now)
        self._drop(used)
        return frames

    def _drop(self, used: int) -> None:
        del self._buffer[:used]
        while used:
            received, size = self._received.popleft()
            if size > used:
                self._received.appendleft((received, size - used))
            used -= min(size, used)

    def _scan(self, data: bytes | bytearray, now: float) -> tuple[list[Frame], int]:
        frames: list[Frame] = []
        position, size = 0, len(data)
        while position < size:
            length = self._frame_length(data, position)
            if length == 0 or position + length > size:
                break
            if length < 0:
                self.counts[NOISE] += 1
                position += 1
                continue
            frame, used = self._read(bytes(data[position : position + length]), now)
            position += used
            if frame is not None:
                frames.append(frame)
        return frames, position

    @staticmethod
    def _frame_length(data: bytes | bytearray, position: int) -> int:
        """Length of the frame that starts at position; 0: too few bytes to tell; -1: no frame."""
        have = len(data) - position
        if data[position] == MAGIC_V1:
            if have < _HEADER_V1:
                return 0
            payload = data[position + 1]
            kind = dialect.mavlink_map.get(data[position + 5])
            if kind is not None and payload > kind.unpacker.size:
                return -1
            return _HEADER_V1 + payload + _CHECKSUM
        if data[position] != MAGIC_V2:
            return -1
        if have < _HEADER_V2:
            return 0
        # A payload longer than ours may be: a newer dialect has more extension fields.
        signature = _SIGNATURE if data[position + 2] & _FLAG_SIGNED else 0
        return _HEADER_V2 + data[position + 1] + _CHECKSUM + signature

    def _read(self, raw: bytes, now: float) -> tuple[Frame | None, int]:
        """The frame in raw, if it is good, and after how many bytes the search goes on.

        A true frame that is not for us is passed over whole, so that nothing inside it is taken
        for a frame; in one that is damaged the length may be the damage.
        """
        version = 2 if raw[0] == MAGIC_V2 else 1
        signed = False
        if version == 2:
            if raw[2] & ~_FLAG_SIGNED:
                self.counts[UNKNOWN_FLAGS] += 1
                return None, 1
            signed = bool(raw[2] & _FLAG_SIGNED)
            sequence, system_id, component_id = raw[4], raw[5], raw[6]
            message_id = int.from_bytes(raw[7:10], "little")
        else:
            sequence, system_id, component_id, message_id = raw[2], raw[3], raw[4], raw[5]
        if message_id not in dialect.mavlink_map:
            whole = _checksum_may_fit(raw[: len(raw) - _SIGNATURE] if signed else raw)
            self.counts[UNKNOWN_MESSAGE if whole else NOISE] += 1
            return None, len(raw) if whole else 1
        try:
            message = self._reader.decode(bytearray(raw))
        except dialect.MAVError:
            # Length, id and flags are checked above: what is left to fail is the checksum.
            self.counts[BAD_CHECKSUM] += 1
            return None, 1
        if self._verifier is not None:
            refusal = self._verifier.refusal(raw, signed, message_id, now)
            if refusal:
                self.counts[refusal] += 1
                return None, len(raw)
        return Frame(message, system_id, component_id, sequence, version, signed), len(raw)


#: The last step of the checksum (CRC-16/MCRF4XX) takes CRC_EXTRA in: what it can add.
_LAST_STEPS = frozenset(mixed << 8 ^ mixed << 3 ^ mixed >> 4 for mixed in range(256))


def _checksum_may_fit(raw: bytes) -> bool:
    """Some CRC_EXTRA makes the checksum right: as for every true frame, and one false in 256."""
    checksum = int.from_bytes(raw[-_CHECKSUM:], "little")
    state: int = dialect.x25crc(raw[1:-_CHECKSUM]).crc
    return checksum ^ (state >> 8) in _LAST_STEPS


class FrameEncoder:
    """Packs messages into frames of one sender, signed if a signer is given."""

    def __init__(self, system_id: int, component_id: int, signer: Signer | None = None) -> None:
        self._writer = dialect.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._signer = signer
        if signer is not None:
            self._writer.signing.secret_key = signer.key
            self._writer.signing.link_id = signer.link_id
            self._writer.signing.sign_outgoing = True

    def encode(self, message: Any, now: float, version: int = 2) -> bytes:
        """The frame of message; MessageError if one of its fields cannot carry its value. version:
        of MAVLink."""
        if self._signer is not None:
            self._writer.signing.timestamp = self._signer.next_timestamp(now)
        try:
            frame: bytes = message.pack(self._writer, force_mavlink1=version == 1)
        except (struct.error, OverflowError, TypeError, IndexError) as error:
            raise MessageError(f"{message.get_type()} cannot be packed: {error}") from error
        self._writer.seq = (self._writer.seq + 1) % 256
        return frame
