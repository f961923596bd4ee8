"""A simulated PX4 that asks before it arms (COM_ARM_AUTH_REQ 1): the arming waits for the answer.

Source: PX4 ArmAuthorization.cpp, method 0 (COM_ARM_AUTH_TO: 1 s).
"""

from __future__ import annotations

import math
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame

_TIMEOUT = 1.0


class ArmAuthorization:
    """The order to arm that waits, if there is one."""

    def __init__(self) -> None:
        self._waiting: Frame | None = None
        self._until = math.inf

    def ask(self, order: Frame, authorizer: int, now: float) -> Any:
        """Keep order back; returns the question to send to the system that decides."""
        self._waiting, self._until = order, now + _TIMEOUT
        command = dialect.MAV_CMD_ARM_AUTHORIZATION_REQUEST
        return dialect.MAVLink_command_long_message(authorizer, 0, command, 0, *[0.0] * 7)

    def answered(self, message: Any, system_id: int) -> tuple[Frame | None, bool]:
        """A COMMAND_ACK came: (the order that waited, whether it may be carried out)."""
        ours = message.command == dialect.MAV_CMD_ARM_AUTHORIZATION_REQUEST
        if self._waiting is None or not ours or message.target_system != system_id:
            return None, False
        return self._take(), message.result == dialect.MAV_RESULT_ACCEPTED

    def overdue(self, now: float) -> Frame | None:
        """The order that waited too long; None: none."""
        return self._take() if now >= self._until else None

    def _take(self) -> Frame | None:
        waiting, self._waiting, self._until = self._waiting, None, math.inf
        return waiting
