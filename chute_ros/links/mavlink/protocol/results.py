"""MAV_RESULT in words. Source: MAVLink common.xml, MAV_RESULT."""

from __future__ import annotations

from chute_ros.protocol.goal import NO_ANSWER
from chute_ros.protocol.mavlink.dialect import dialect

ACCEPTED: int = dialect.MAV_RESULT_ACCEPTED
TEMPORARILY_REJECTED: int = dialect.MAV_RESULT_TEMPORARILY_REJECTED
DENIED: int = dialect.MAV_RESULT_DENIED
UNSUPPORTED: int = dialect.MAV_RESULT_UNSUPPORTED
FAILED: int = dialect.MAV_RESULT_FAILED
IN_PROGRESS: int = dialect.MAV_RESULT_IN_PROGRESS
CANCELLED: int = dialect.MAV_RESULT_CANCELLED
NO_ACKNOWLEDGEMENT = NO_ANSWER

_WORDS: dict[int, str] = {
    ACCEPTED: "accepted",
    TEMPORARILY_REJECTED: "temporarily rejected: valid, but not possible now; try again later",
    DENIED: "denied: a parameter of the command is wrong or not allowed",
    UNSUPPORTED: "unsupported: the device does not know the command",
    FAILED: "failed: valid, but its execution failed",
    IN_PROGRESS: "in progress",
    CANCELLED: "cancelled",
    dialect.MAV_RESULT_COMMAND_LONG_ONLY: "refused: only accepted as COMMAND_LONG",
    dialect.MAV_RESULT_COMMAND_INT_ONLY: "refused: only accepted as COMMAND_INT",
    # Newer upstream than the dialect of the pinned pymavlink: 9 and 10 of MAVLink's common.xml.
    9: "refused: coordinate frame not supported",
    10: "refused: the sender is not in control of the device",
    NO_ACKNOWLEDGEMENT: "no acknowledgement came",
}


def result_text(result: int) -> str:
    """Meaning of a device's result, in words."""
    return _WORDS.get(result, f"result {result}, which MAVLink does not define")
