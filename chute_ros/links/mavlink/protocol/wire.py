"""The two ends of a link that touch bytes: what came in, and what goes out."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Hashable
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame, FrameDecoder, FrameEncoder
from chute_ros.protocol.mavlink.signing import Signer, Verifier

#: Most streams (serial port, TCP connections) that are read at once.
_MOST_STREAMS = 16


class FrameReceiver:
    """Bytes from datagrams and streams to frames."""

    def __init__(self, verifier: Verifier | None, counts: Counter[str]) -> None:
        self._verifier = verifier
        self._counts = counts
        self._datagrams = FrameDecoder(verifier, counts)
        self._streams: dict[Hashable, FrameDecoder] = {}

    def feed(self, data: bytes, now: float, stream: Hashable) -> list[Frame]:
        """Frames in data: a datagram (stream None), or the next bytes of that stream."""
        if stream is None:
            return self._datagrams.feed_datagram(data, now)
        if stream not in self._streams:
            if len(self._streams) >= _MOST_STREAMS:
                self._streams.clear()
            self._streams[stream] = FrameDecoder(self._verifier, self._counts)
        return self._streams[stream].feed(data, now)

    def update(self, now: float) -> list[Frame]:
        """Look at the clock: frames that a false start mark held back."""
        return [frame for decoder in self._streams.values() for frame in decoder.update(now)]

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        deadlines = (decoder.next_deadline() for decoder in self._streams.values())
        return min(deadlines, default=math.inf)

    def stream_ended(self, stream: Hashable) -> None:
        """A stream (None: every stream) was closed."""
        if stream is None:
            self._streams.clear()
        else:
            self._streams.pop(stream, None)


class Senders:
    """Who counts its frames up, and how many came of each."""

    def __init__(self) -> None:
        self._first_sequence: dict[tuple[int, int], int] = {}
        self._counting: set[tuple[int, int]] = set()
        self._heard: Counter[tuple[int, int]] = Counter()

    def heard(self, frame: Frame) -> None:
        """A frame came."""
        sender = (frame.system_id, frame.component_id)
        first = self._first_sequence.get(sender)
        if first is not None:
            self._heard[sender] += 1
            if frame.sequence != first:
                self._counting.add(sender)
        elif len(self._first_sequence) < 256:
            self._first_sequence[sender] = frame.sequence

    def number_of(self, frame: Frame) -> int | None:
        """How many frames came of its sender; None: it is not known to count them."""
        sender = (frame.system_id, frame.component_id)
        return self._heard[sender] if sender in self._counting else None


class Duplicates:
    """Knows a frame that the network delivers twice (two paths, a router that echoes).

    A copy has the same bytes, sequence number included. Where a sender never counts its frames
    up, nothing is known to be a copy. within: nor after so many frames of its sender, whose eight
    bits of numbers have gone round by then: its next heartbeat may be the same to the last bit.
    """

    def __init__(self, senders: Senders, window: float, within: float = math.inf) -> None:
        self._senders, self._window, self._within = senders, window, within
        #: When it came, its bytes, and how many of its sender had come by then.
        self._seen: deque[tuple[float, bytes, int]] = deque(maxlen=64)

    def is_copy(self, frame: Frame, now: float) -> bool:
        """This very frame came within the window."""
        while self._seen and now - self._seen[0][0] > self._window:
            self._seen.popleft()
        raw, number = bytes(frame.message.get_msgbuf()), self._senders.number_of(frame)
        if number is not None and any(
            raw == seen and number - at < self._within for _, seen, at in self._seen
        ):
            return True
        self._seen.append((now, raw, number or 0))
        return False


class Outbox:
    """Messages of ours to frames, oldest first."""

    def __init__(self, system_id: int, component_id: int, signer: Signer | None) -> None:
        self.sent_count = 0
        self._encoder = FrameEncoder(system_id, component_id, signer)
        self._output: list[bytes] = []

    def send(self, message: Any, now: float) -> None:
        """Put message on the wire."""
        self._output.append(self._encoder.encode(message, now))
        self.sent_count += 1

    def heartbeat(self, now: float) -> None:
        """We are alive."""
        kind, autopilot = dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID
        state = dialect.MAV_STATE_ACTIVE
        self.send(dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, state, 3), now)

    def take(self) -> list[bytes]:
        """Frames to send; each is handed out once."""
        output, self._output = self._output, []
        return output
