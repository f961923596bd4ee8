"""All that was sent and received, as MCAP."""

from __future__ import annotations

import io
import json

from mcap.writer import Writer

from chute_ros.tools.conformance.report import Report
from chute_ros.tools.page_file import KIT_LIBRARY

_NANOSECONDS = 1e9
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


def recording(report: Report) -> bytes:
    """All traffic, a message a packet, and the report's head as metadata."""
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(profile="", library=KIT_LIBRARY)
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
