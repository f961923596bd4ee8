"""How a clause of the Umbilical Reference is written down."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from chute_ros.conformance.clause import Clause
from chute_ros.links.umbilical.conformance.bench import UmbilicalBench

DOCUMENT = "Umbilical Reference"
CONNECTION, TELEMETRY = "1. Connection & Heartbeat", "3. Telemetry Output"
COMMANDS, CORE, PAYLOAD = "2. Umbilical Commands", "Core Vehicle Commands", "Payload Commands"
STORAGE, BLIMS = "Diagnostics & Storage Commands", "BLiMS Commands"

UmbilicalClause = Clause[UmbilicalBench]


def of(section: str) -> Callable[..., UmbilicalClause]:
    """Clauses of one section."""
    return partial(Clause, DOCUMENT, section)
