"""Texts for people, longer than one message: STATUSTEXT in chunks, cut up and put together.

Source: MAVLink common.xml, STATUSTEXT. A text in one message has id 0. One in chunks has another,
the same in each; chunk_seq counts from 0, and the chunk that does not fill its 50 bytes is the
last. A chunk that is lost shows as "...".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect

#: Bytes in one message.
CHUNK = 50
#: A text that is sent is cut after so many chunks: each takes 66 bytes of a line that may be slow.
MOST_SENT = 6
#: A text that is not whole so long after its newest chunk, s, is given out as it is.
CHUNK_SILENCE = 1.0
#: More texts at once, or longer ones, are given out as they are: nobody must make us grow.
MOST_OPEN, MOST_CHUNKS = 4, 20
_GAP = "..."


@dataclass(frozen=True)
class StatusText:
    """A whole text, and its MAV_SEVERITY (0 worst to 7)."""

    severity: int
    text: str


def chunked(text: str, severity: int, text_id: int) -> list[Any]:
    """The messages that carry text; text_id: 1 to 65535, another than that of the text before."""
    raw = text.encode("ascii", "replace")
    if len(raw) <= CHUNK:
        return [dialect.MAVLink_statustext_message(severity, raw)]
    most = MOST_SENT * CHUNK - 1
    if len(raw) > most:
        raw = raw[: most - len(_GAP)] + _GAP.encode()
    # One that fills its last chunk is ended by an empty one.
    parts = (raw[at : at + CHUNK] for at in range(0, len(raw) + 1, CHUNK))
    return [
        dialect.MAVLink_statustext_message(severity, part, text_id, number)
        for number, part in enumerate(parts)
    ]


@dataclass
class _Open:
    severity: int
    newest: float
    chunks: dict[int, str] = field(default_factory=dict)
    #: Number of the last chunk; None: it has not come.
    last: int | None = None

    @property
    def whole(self) -> bool:
        return self.last is not None and len(self.chunks) > self.last

    def text(self) -> StatusText:
        end = max(self.chunks, default=-1) if self.last is None else self.last
        parts = [self.chunks.get(number, _GAP) for number in range(end + 1)]
        if self.last is None:
            parts.append(_GAP)
        return StatusText(self.severity, "".join(parts))


class StatusTexts:
    """Puts together what one sender says."""

    def __init__(self) -> None:
        self._open: dict[int, _Open] = {}

    def feed(self, message: Any, now: float) -> list[StatusText]:
        """A STATUSTEXT came now (monotonic s): the texts that are whole, or given up, by it."""
        ended = self.update(now)
        if message.id == 0:
            return [*ended, StatusText(message.severity, message.text)]
        one = self._open.get(message.id)
        if one is None:
            if len(self._open) >= MOST_OPEN:
                ended.append(self._open.pop(next(iter(self._open))).text())
            one = self._open[message.id] = _Open(message.severity, now)
        one.newest = now
        if message.chunk_seq < MOST_CHUNKS:
            one.chunks[message.chunk_seq] = message.text
            if len(message.text) < CHUNK:
                one.last = message.chunk_seq
        if one.whole or message.chunk_seq >= MOST_CHUNKS:
            ended.append(self._open.pop(message.id).text())
        return ended

    def update(self, now: float) -> list[StatusText]:
        """Look at the clock: the texts that are given up."""
        late = [key for key, one in self._open.items() if now >= one.newest + CHUNK_SILENCE]
        return [self._open.pop(key).text() for key in late]

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        newest = (one.newest for one in self._open.values())
        return min(newest, default=math.inf) + CHUNK_SILENCE
