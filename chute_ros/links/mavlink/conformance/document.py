"""How a clause of the Parachute Protocol is written down."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from chute_ros.conformance.clause import Clause, Risk, Trial
from chute_ros.links.mavlink.conformance.bench import MavlinkBench

# All of the MAVLink developer guide; the first names the others.
PARACHUTE, HEARTBEAT = "Parachute Protocol", "Heartbeat/Connection Protocol"
COMMAND, FRAMES, SIGNING = "Command Protocol", "Packet Serialization", "Message Signing"

#: What a device may do that is only read.
READS = "nothing: it is only listened to"
#: Or asked for what it knows.
ASKS = "nothing: it is only asked for what it knows"

MavlinkClause = Clause[MavlinkBench]
Try = Callable[[MavlinkBench], Trial]


def clause(
    document: str,
    section: str,
    name: str,
    text: str,
    trial: Try,
    does: str = ASKS,
    risk: Risk = Risk.NONE,
    needs: str = "",
) -> MavlinkClause:
    """In the order in which a document is read."""
    return Clause(name, document, section, text, does, trial, risk, needs)


def of(document: str, section: str) -> Callable[..., MavlinkClause]:
    """The same for clauses of one section."""
    return partial(clause, document, section)
