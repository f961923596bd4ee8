"""MAVLink 2 message signing: who may speak.

Source: MAVLink developer guide, "Message signing": SHA-256 over key, frame and time stamp, cut to
48 bits; time stamps in units of 10 microseconds since 2015-01-01, rising in each stream (system,
component, link id), and never more than one minute behind our own.

A stream's time stamp is stored only after its signature was found right, so that a forged frame
with a high time stamp does not shut out the true sender. What was stored outlives the process
(Times): otherwise what was recorded before a restart would be believed after it.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Mapping
from dataclasses import dataclass, field

from chute_ros.errors import SigningKeyError

KEY_BYTES, SIGNATURE_BYTES = 32, 6
#: Unix time (s) of time stamp 0.
EPOCH_2015 = 1420070400
UNITS_PER_SECOND = 100_000
#: So far a time stamp may lag behind our own.
NEW_STREAM_LAG = 60 * UNITS_PER_SECOND
#: The last that is listened to, in 2103: ours follow the highest that was heard, and must be able
#: to rise for a year before their 48 bits end, and with them every order.
LAST_TIME = 2**48 - 1 - 365 * 86400 * UNITS_PER_SECOND

UNSIGNED = "frame without a signature"
WRONG_SIGNATURE = "frame with a wrong signature"
REPLAYED = "frame with an old signature time (replayed)"
END_OF_TIME = "frame with a signature time at the end of its 48 bits"
TOO_MANY_STREAMS = "frame of one signed stream too many"
#: A device has one, or a few; who holds the key could make up 2^24.
MOST_STREAMS = 256

#: RADIO_STATUS comes from the radios themselves, which hold no key.
UNSIGNED_ALLOWED = frozenset({109})

_TIMESTAMP = slice(-12, -6)
_LINK_ID = -13


#: (system id, component id, link id)
Stream = tuple[int, int, int]


@dataclass(frozen=True)
class Times:
    """What must outlive a restart: the highest time stamp that was given out or heard, and the
    newest of each stream that was heard."""

    newest: int = 0
    streams: Mapping[Stream, int] = field(default_factory=dict)


def key_from_text(text: bytes, name: str) -> bytes:
    """The 32 key bytes in text: raw, or 64 hexadecimal digits. name is for the error's text."""
    if len(text) == KEY_BYTES:
        return text
    stripped = text.strip()
    if len(stripped) == 2 * KEY_BYTES:
        try:
            key = bytes.fromhex(stripped.decode("ascii"))
        except ValueError:
            key = b""
        # fromhex passes over spaces, which would leave a shorter key.
        if len(key) == KEY_BYTES:
            return key
    raise SigningKeyError(
        f"{name} holds {len(text)} bytes that are no key: need 32 raw bytes or 64 hexadecimal "
        "digits (make one with: head -c 32 /dev/urandom > FILE; chmod 600 FILE)"
    )


def signature_of(key: bytes, unsigned: bytes) -> bytes:
    """The last bytes of a signed frame. unsigned: all that stands before them."""
    return hashlib.sha256(key + unsigned).digest()[:SIGNATURE_BYTES]


class SigningClock:
    """Signing time from monotonic time, so that a step of the wall clock does not stop the link.

    unix_minus_monotonic: Unix time less monotonic time, s, taken once at the start.
    """

    def __init__(self, unix_minus_monotonic: float) -> None:
        self._offset = unix_minus_monotonic - EPOCH_2015
        self._ahead = 0

    def at(self, now: float) -> int:
        """The time stamp at now; at least as high as any that was heard."""
        return max(int((now + self._offset) * UNITS_PER_SECOND), self._ahead)

    def heard(self, timestamp: int) -> None:
        """A valid signature bore this time stamp: the clock follows those that are ahead."""
        self._ahead = max(self._ahead, timestamp)


class Signer:
    """Gives out rising time stamps for the frames that we send with key on link_id."""

    def __init__(self, key: bytes, clock: SigningClock, link_id: int = 0) -> None:
        self.key, self.link_id, self._clock = key, link_id, clock
        #: The highest that was given out.
        self.newest = 0

    def next_timestamp(self, now: float) -> int:
        """A time stamp higher than any given out before."""
        self.newest = max(self._clock.at(now), self.newest + 1)
        return self.newest


class Verifier:
    """Checks the frames that we receive against key. streams: heard before a restart."""

    def __init__(
        self, key: bytes, clock: SigningClock, streams: Mapping[Stream, int] | None = None
    ) -> None:
        self._key = key
        self._clock = clock
        #: The newest time stamp of each.
        self.streams: dict[Stream, int] = dict(streams or {})

    def refusal(self, raw: bytes, signed: bool, message_id: int, now: float) -> str:
        """Why the frame in raw is refused; empty: it is good."""
        if not signed:
            return "" if message_id in UNSIGNED_ALLOWED else UNSIGNED
        right = signature_of(self._key, raw[:-SIGNATURE_BYTES])
        if not hmac.compare_digest(right, raw[-SIGNATURE_BYTES:]):
            return WRONG_SIGNATURE
        timestamp = int.from_bytes(raw[_TIMESTAMP], "little")
        stream = (raw[5], raw[6], raw[_LINK_ID])
        if timestamp <= max(self.streams.get(stream, 0), self._clock.at(now) - NEW_STREAM_LAG):
            return REPLAYED
        if timestamp > LAST_TIME:
            return END_OF_TIME
        if stream not in self.streams and len(self.streams) >= MOST_STREAMS:
            return TOO_MANY_STREAMS
        self.streams[stream] = timestamp
        self._clock.heard(timestamp)
        return ""


def times_of(signer: Signer, verifier: Verifier) -> Times:
    """What must outlive a restart, now."""
    return Times(max([signer.newest, *verifier.streams.values()]), dict(verifier.streams))
