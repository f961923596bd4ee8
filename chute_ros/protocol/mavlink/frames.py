"""MAVLink 1 and 2 frames: bytes to messages and back.

Source: MAVLink developer guide, "Packet serialization". The payloads are read and written by the
generated dialect; the framing is ours so that a damaged frame costs only itself: after one the
search goes on at its second byte, and every dropped byte is counted under a reason.
"""

from __future__ import annotations

import struct
from collections import Counter
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
#: A frame of 280 bytes takes 49 ms at 57,600 baud: one that is not complete after this is noise.
LONGEST_FRAME_TIME = 0.25  # s

#: Reasons under which received bytes are dropped.
NOISE = "bytes that are no MAVLink frame"
BAD_CHECKSUM = "frame with a wrong checksum"
UNKNOWN_MESSAGE = "frame of a message that the dialect does not know"
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

    def __init__(self, verifier: Verifier | None = None, counts: Counter[str] | None = None) -> None:
        self.counts: Counter[str] = Counter() if counts is None else counts
        self._verifier = verifier
        self._buffer = bytearray()
        self._buffer_since = 0.0
        self._reader = dialect.MAVLink(None)

    def feed(self, data: bytes, now: float) -> list[Frame]:
        """Frames completed by data, the next bytes of a stream; the rest is kept for the next call."""
        frames: list[Frame] = []
        if self._buffer and now - self._buffer_since > LONGEST_FRAME_TIME:
            # A false start mark must not hold back the true frames behind it.
            self.counts[NOISE] += 1
            del self._buffer[0]
            frames = self._take(now)
        self._buffer += data
        return frames + self._take(now)

    def _take(self, now: float) -> list[Frame]:
        frames, used = self._scan(self._buffer, now)
        del self._buffer[:used]
        if used or not self._buffer_since:
            self._buffer_since = now
        return frames

    def feed_datagram(self, data: bytes, now: float) -> list[Frame]:
        """Frames in data, a datagram: none continues in the next one."""
        frames, used = self._scan(data, now)
        if used < len(data):
            self.counts[TRUNCATED] += 1
        return frames

    def _scan(self, data: bytes | bytearray, now: float) -> tuple[list[Frame], int]:
        frames: list[Frame] = []
        position, size = 0, len(data)
        while position < size:
            magic = data[position]
            if magic not in (MAGIC_V1, MAGIC_V2):
                self.counts[NOISE] += 1
                position += 1
                continue
            length = self._frame_length(data, position)
            if length < 0:
                self.counts[NOISE] += 1
                position += 1
                continue
            if length == 0 or position + length > size:
                break
            frame = self._read(bytes(data[position : position + length]), now)
            if frame is None:
                position += self._skip(data, position, length)
            else:
                position += length
                if frame.message is not None:
                    frames.append(frame)
        return frames, position

    @staticmethod
    def _frame_length(data: bytes | bytearray, position: int) -> int:
        """Length of the frame that starts at position; 0: too few bytes to tell; -1: no frame."""
        have = len(data) - position
        version_1 = data[position] == MAGIC_V1
        header = _HEADER_V1 if version_1 else _HEADER_V2
        if have < header:
            return 0
        payload = data[position + 1]
        if version_1:
            message_id = data[position + 5]
            signature = 0
        else:
            message_id = int.from_bytes(data[position + 7 : position + 10], "little")
            signature = _SIGNATURE if data[position + 2] & _FLAG_SIGNED else 0
        kind = dialect.mavlink_map.get(message_id)
        if kind is not None and payload > kind.unpacker.size:
            return -1
        return header + payload + _CHECKSUM + signature

    def _read(self, raw: bytes, now: float) -> Frame | None:
        """The frame in raw. None: no valid frame; a frame without message: valid, but refused."""
        version = 2 if raw[0] == MAGIC_V2 else 1
        signed = False
        if version == 2:
            if raw[2] & ~_FLAG_SIGNED:
                self.counts[UNKNOWN_FLAGS] += 1
                return None
            signed = bool(raw[2] & _FLAG_SIGNED)
            sequence, system_id, component_id = raw[4], raw[5], raw[6]
            message_id = int.from_bytes(raw[7:10], "little")
        else:
            sequence, system_id, component_id, message_id = raw[2], raw[3], raw[4], raw[5]
        if message_id not in dialect.mavlink_map:
            self.counts[UNKNOWN_MESSAGE] += 1
            return None
        try:
            message = self._reader.decode(bytearray(raw))
        except dialect.MAVError:
            # Length, id and flags are checked above: what is left to fail is the checksum.
            self.counts[BAD_CHECKSUM] += 1
            return None
        if self._verifier is not None:
            refusal = self._verifier.refusal(raw, signed, message_id, now)
            if refusal:
                self.counts[refusal] += 1
                message = None
        return Frame(message, system_id, component_id, sequence, version, signed)

    @staticmethod
    def _skip(data: bytes | bytearray, position: int, length: int) -> int:
        """How far to go on after a frame that could not be read.

        Where another frame, or the end, follows directly, the length was right and the frame is
        skipped whole; otherwise the length may be the damage, and only the first byte is.
        """
        end = position + length
        if end == len(data) or data[end] in (MAGIC_V1, MAGIC_V2):
            return length
        return 1


class FrameEncoder:
    """Packs messages into MAVLink 2 frames of one sender, signed if a signer is given."""

    def __init__(self, system_id: int, component_id: int, signer: Signer | None = None) -> None:
        self._writer = dialect.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._signer = signer
        if signer is not None:
            self._writer.signing.secret_key = signer.key
            self._writer.signing.link_id = signer.link_id
            self._writer.signing.sign_outgoing = True

    def encode(self, message: Any, now: float) -> bytes:
        """The frame of message; MessageError if one of its fields cannot carry its value."""
        if self._signer is not None:
            self._writer.signing.timestamp = self._signer.next_timestamp(now)
        try:
            frame: bytes = message.pack(self._writer)
        except (struct.error, OverflowError, TypeError) as error:
            raise MessageError(f"{message.get_type()} cannot be packed: {error}") from error
        self._writer.seq = (self._writer.seq + 1) % 256
        return frame
