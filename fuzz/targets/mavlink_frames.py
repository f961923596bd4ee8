"""MAVLink bytes to frames: as they come, with their checksums mended, and signed."""

from __future__ import annotations

import hashlib
from typing import Any

from chute_ros.protocol.mavlink import frames as f
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.signing import SigningClock, Verifier
from fuzz.program import Program
from fuzz.target import Target, WrongError

KEY = bytes(range(32))
_KINDS: dict[int, Any] = dialect.mavlink_map
#: Those that something is done with.
INTERESTING = [
    kind.id
    for kind in _KINDS.values()
    if kind.msgname
    in (
        *("HEARTBEAT", "PARACHUTE_STATUS", "COMMAND_ACK", "COMPONENT_INFORMATION_BASIC"),
        *("EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ALTITUDE"),
        *("ATTITUDE", "ATTITUDE_QUATERNION", "SCALED_IMU", "HIGHRES_IMU", "SYS_STATUS"),
        *("SYSTEM_TIME", "MESSAGE_INTERVAL", "COMMAND_LONG", "COMMAND_INT", "STATUSTEXT"),
    )
]
_ALL = sorted(_KINDS)
SYSTEMS, COMPONENTS = (1, 2, 0, 255), (161, 1, 162, 191)
#: Dropped under these, a frame costs one byte; under all others it is passed over whole.
_ONE_BYTE = (f.NOISE, f.BAD_CHECKSUM, f.UNKNOWN_FLAGS)
_SHORTEST, _LONGEST = 8, 280


def good_frame(program: Program, clock: SigningClock | None, now: float) -> tuple[bytes, bool]:
    """A frame with the right checksum and, with clock, signature; whether it must be heard."""
    how = program.byte()
    message_id = program.choice(INTERESTING)
    if how & 1:
        message_id = program.choice(_ALL)
    if how & 2:
        message_id = program.whole(3) & 0xFFFFFF
    kind = _KINDS.get(message_id)
    payload = program.piece()
    if kind is not None and not how & 4:
        payload = payload.ljust(kind.unpacker.size, b"\0")[: kind.unpacker.size]
    system, component = program.choice(SYSTEMS), program.choice(COMPONENTS)
    if how & 8:
        system, component = program.byte(), program.byte()
    sequence = program.byte()
    flags = 1 if clock is not None else 0
    if how & 16:
        flags = program.byte()
    extra = bytes((kind.crc_extra if kind is not None else 0,))
    if how & 32 and message_id < 256:
        body = bytes((len(payload), sequence, system, component, message_id)) + payload
        return b"\xfe" + body + _crc(body + extra), False
    head = bytes((len(payload), flags, 0, sequence, system, component))
    body = head + message_id.to_bytes(3, "little") + payload
    raw = b"\xfd" + body + _crc(body + extra)
    if clock is not None:
        stamp = clock.at(now) + program.whole(2)
        stamp = program.whole(6) if how & 64 else max(stamp, 0)
        stamp &= (1 << 48) - 1
        raw += bytes((program.byte(),)) + stamp.to_bytes(6, "little")
        raw += hashlib.sha256(KEY + raw).digest()[:6]
    return raw, kind is not None and flags == 0 and clock is None


def _crc(data: bytes) -> bytes:
    return int(dialect.x25crc(data).crc).to_bytes(2, "little")


class Account:
    """A decoder, and what became of each byte that it was fed."""

    def __init__(self, verifier: Verifier | None) -> None:
        self.decoder = f.FrameDecoder(verifier)
        self.now = 1000.0

    def held(self) -> object:
        return self.decoder

    def stream(self, data: bytes, piece: int) -> list[f.Frame]:
        """Feed a stream in pieces of this size, to its end."""
        before = self.decoder.counts.copy()
        found: list[f.Frame] = []
        for start in range(0, len(data), piece):
            found += self.decoder.feed(data[start : start + piece], self.now)
            self.now += 0.001
        for _ in range(len(data) + 1):
            if not self.decoder.next_deadline() < float("inf"):
                break
            self.now = max(self.now, self.decoder.next_deadline())
            found += self.decoder.update(self.now)
        else:
            raise WrongError("bytes stay in the decoder for ever")
        self._check(len(data), found, before)
        return found

    def datagram(self, data: bytes) -> list[f.Frame]:
        """Feed one datagram."""
        before = self.decoder.counts.copy()
        self.now += 0.001
        found = self.decoder.feed_datagram(data, self.now)
        if self.decoder.counts[f.TRUNCATED] == before[f.TRUNCATED]:
            self._check(len(data), found, before)
        return found

    def _check(self, fed: int, found: list[f.Frame], before: Any) -> None:
        """Every byte is one of a frame, or counted under a reason."""
        new = self.decoder.counts - before
        rest = fed - sum(len(one.message.get_msgbuf()) for one in found)
        rest -= sum(new[reason] for reason in _ONE_BYTE)
        whole = sum(count for reason, count in new.items() if reason not in _ONE_BYTE)
        if not _SHORTEST * whole <= rest <= (_LONGEST + 13) * whole:
            raise WrongError(f"{rest} bytes are neither decoded nor counted: {dict(new)}")


class Raw(Account):
    """Any bytes. The first says in which pieces they come; 0: as one datagram."""

    def __init__(self) -> None:
        super().__init__(None)

    def feed(self, data: bytes) -> None:
        piece, rest = data[:1], data[1:]
        if piece in (b"", b"\0"):
            self.datagram(rest)
        else:
            self.stream(rest, piece[0])


class Mended(Account):
    """Frames whose checksums are right, with noise between them."""

    def __init__(self, signed: bool = False) -> None:
        self._clock = SigningClock(1.7e9) if signed else None
        super().__init__(Verifier(KEY, self._clock) if self._clock else None)

    def feed(self, data: bytes) -> None:
        program = Program(data)
        how, stream, due, spoilt = program.byte(), b"", 0, False
        while not program.over:
            raw, heard = good_frame(program, self._clock, self.now)
            found = self.datagram(raw) if how & 1 else []
            if how & 1 and heard and len(found) != 1:
                raise WrongError(f"a good frame was not heard: {raw.hex()}: {self.decoder.counts}")
            spoilt, due = spoilt or not heard, due + heard
            stream += raw
            if how & 2 and program.flag():
                stream, spoilt = stream + program.piece(), True
        found = self.stream(stream, 1 + how // 4)
        if not spoilt and len(found) != due:
            raise WrongError(f"{due} good frames were fed, {len(found)} came out")


TARGETS = (
    Target("mavlink.raw", "any bytes, as a stream in pieces or a datagram", Raw),
    Target("mavlink.mended", "frames with the right checksum, noise between them", Mended),
    Target("mavlink.signed", "frames with the right signature", lambda: Mended(signed=True)),
)
