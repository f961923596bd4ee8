"""Texts for people, longer than one message: STATUSTEXT in chunks.

Source: MAVLink common.xml, STATUSTEXT. A text in one message has id 0. One in chunks has another,
the same in each; chunk_seq counts from 0, and the chunk that does not fill its 50 bytes is the
last.
"""

from __future__ import annotations

from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect

#: Bytes in one message.
CHUNK = 50
#: A text that is sent is cut after so many chunks: each takes 66 bytes of a line that may be slow.
MOST_SENT = 6
_CUT = "..."


def chunked(text: str, severity: int, text_id: int) -> list[Any]:
    """The messages that carry text; text_id: 1 to 65535, another than that of the text before."""
    raw = text.encode("ascii", "replace")
    if len(raw) <= CHUNK:
        return [dialect.MAVLink_statustext_message(severity, raw)]
    most = MOST_SENT * CHUNK - 1
    if len(raw) > most:
        raw = raw[: most - len(_CUT)] + _CUT.encode()
    # One that fills its last chunk is ended by an empty one.
    parts = (raw[at : at + CHUNK] for at in range(0, len(raw) + 1, CHUNK))
    return [
        dialect.MAVLink_statustext_message(severity, part, text_id, number)
        for number, part in enumerate(parts)
    ]
