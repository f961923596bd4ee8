"""How a clause of the Parachute Protocol is written down."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from chute_ros.conformance.clause import Clause
from chute_ros.links.mavlink.conformance.bench import MavlinkBench

# All of the MAVLink developer guide; the first names the others.
PARACHUTE, HEARTBEAT = "Parachute Protocol", "Heartbeat/Connection Protocol"
COMMAND, FRAMES, SIGNING = "Command Protocol", "Packet Serialization", "Message Signing"

MavlinkClause = Clause[MavlinkBench]


def of(document: str, section: str) -> Callable[..., MavlinkClause]:
    """Clauses of one section."""
    return partial(Clause, document, section)
