"""The clauses of the Umbilical Reference, and how each is tried on a flight computer.

First what is only listened to, then what must do nothing, what asks and what arms; what fires
comes late, and the launch is the last of it: it ends only by a restart.
"""

from chute_ros.links.umbilical.conformance import commands, connection, storage, telemetry

CLAUSES = (
    *telemetry.CLAUSES,
    *connection.CLAUSES,
    *storage.CLAUSES,
    *connection.AT_LAST,
    *commands.ARMING,
    *storage.WIPES,
    *commands.FIRING,
)
