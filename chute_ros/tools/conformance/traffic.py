"""All that was sent and received, as MCAP."""

from __future__ import annotations

import io
import json
import re

from chute_ros.tools.conformance.report import ConformanceReport
from chute_ros.tools.page_file import FileKind

_NANOSECONDS = 1e9
#: Who wrote it, as it says itself: black boxes are MCAP as well. Magic, then the header's kind and
#: length, an empty profile, and the length of this.
_LIBRARY = "chute_ros conformance"
MCAP = FileKind(
    "MCAP recording of conformance",
    re.compile(rb"\x89MCAP0\r\n\x01.{8}\0{4}.{4}" + _LIBRARY.encode(), re.DOTALL),
)
#: The content of each message, for Foxglove and the like.
_SCHEMA = {
    "type": "object",
    "properties": {
        "sent": {"type": "boolean"},
        "sender": {"type": "string"},
        "name": {"type": "string"},
        "text": {"type": "string"},
        "hex": {"type": "string"},
    },
}


def recording(report: ConformanceReport) -> bytes:
    """All traffic, a message a packet, and the report's head as metadata."""
    from mcap.writer import Writer

    file = io.BytesIO()
    writer = Writer(file)
    writer.start(profile="", library=_LIBRARY)
    schema = writer.register_schema("chute_ros.Packet", "jsonschema", json.dumps(_SCHEMA).encode())
    channel = writer.register_channel("traffic", "json", schema)
    for number, one in enumerate(report.traffic):
        at = report.began + int(one.at * _NANOSECONDS)
        told = {
            "sent": one.sent,
            "sender": one.sender,
            "name": one.name,
            "text": one.text,
            "hex": one.raw.hex(),
        }
        writer.add_message(channel, at, json.dumps(told).encode(), at, number)
    writer.add_metadata("chute_ros.conformance", {**report.about, "device": report.device})
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()
