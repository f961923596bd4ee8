"""The clauses of the Parachute Protocol, and how each is tried on a device.

What fires comes late: what is released cannot be tried again.
"""

from chute_ros.links.mavlink.conformance import arming, commands, connection, releasing, status

CLAUSES = (
    *connection.CLAUSES,
    *status.CLAUSES,
    *commands.CLAUSES,
    *arming.CLAUSES,
    *releasing.CLAUSES,
    *arming.AT_LAST,
)
