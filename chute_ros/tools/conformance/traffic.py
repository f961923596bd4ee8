"""All that was sent and received, as MCAP."""

from __future__ import annotations

import json
from pathlib import Path

from mcap.writer import Writer

from chute_ros.tools.conformance.report import Report

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


def write_mcap(report: Report, path: Path) -> None:
    """All traffic, a message a packet, and the report's head as metadata. OSError as the disk
    does."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="chute_ros")
        schema = writer.register_schema(
            "chute_ros.Packet", "jsonschema", json.dumps(_SCHEMA).encode()
        )
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
