"""Does a device answer what we send to it?

A line may be dead in one direction: a broken TX wire, a one-way router or radio, a device that
drops our frames by their version or signature. The device's heartbeats arrive all the same, and
only an order would show it. So each device is asked something harmless before flight
(MAV_CMD_REQUEST_MESSAGE: every command is acknowledged, if only with UNSUPPORTED), and silence is
a fault.

Source: MAVLink developer guide, "Command protocol".
"""

from __future__ import annotations

import math

#: Silence to what was asked over so long is a fault, s: of a device that has never answered, and
#: of one that has. On a line that loses three frames of ten in each direction half of the answers
#: still arrive.
NEVER, NO_MORE = 10.0, 20.0
#: To so few questions silence tells nothing.
FEWEST = 5
#: A device is asked when its newest answer is so old, s; first when it was received for so long,
#: as most have answered something else by then; and this often until it answers.
ANSWER_LASTS, FIRST, ASK_AGAIN = 10.0, 2.0, 0.5
#: What a person may look at.
_CURE = (
    "check our TX line to it, the routers and radios on the way, whether it takes MAVLink 2, and "
    "its signing key"
)


class Answers:
    """Of one device, since it was first heard, or heard again after it was lost. All times are
    monotonic s."""

    def __init__(self) -> None:
        self._limit = NEVER
        #: What was not answered: since when it was asked, when last, and how often.
        self._since = self._asked_at = self._answered_at = -math.inf
        self._count = 0
        #: When it was due last.
        self._due_at = -math.inf

    def asked(self, now: float) -> None:
        """Something that it answers was sent to it."""
        if not self._count:
            self._since = now
        self._count += 1
        self._asked_at = now

    def answered(self, now: float) -> None:
        """An answer to something that we sent came."""
        self._limit, self._count, self._answered_at = NO_MORE, 0, now

    def restarted(self) -> None:
        """It has to show again that it hears us."""
        self._limit, self._answered_at = NEVER, -math.inf

    def due(self, heard_since: float, now: float) -> bool:
        """It is to be asked something harmless now. heard_since: when it was first heard."""
        answered = now - self._answered_at < ANSWER_LASTS
        if answered or now < max(self._due_at + ASK_AGAIN, heard_since + FIRST):
            return False
        self._due_at = now
        return True

    def fault(self, what: str, now: float) -> str:
        """That it does not hear us, and what to look at; empty: nothing tells so. what: was asked,
        in words."""
        if self._count < FEWEST or self._asked_at - self._since < self._limit:
            return ""
        silent = f"no answer to any {what} for {now - self._since:.1f} s"
        return f"receives nothing from us: {silent}; {_CURE}"
