"""Between the nodes and the devices of the soak: what the relays of all wires have in common.

A relay can be spoilt, and sees every kill and every deploy that goes to a device.
"""

from __future__ import annotations

import random
from collections.abc import Callable

#: Frames of a flood for each one that passes.
TIMES = 10
KILL, DEPLOY = "KILL", "DEPLOY"
VALID, INVALID = "valid", "invalid"
#: To be told of what goes down: (wire, KILL or DEPLOY, text).
Seen = Callable[[str, str, str], None]


class Relay:
    """Passes on what comes, both ways."""

    def __init__(self, name: str, seen: Seen) -> None:
        self.name = name
        self.seen = seen
        self.loss = 0.0
        self.cut = False
        #: Empty, VALID or INVALID.
        self.flood = ""
        self.passed = self.dropped = 0
        self.chance = random.Random(name)

    def takes(self) -> bool:
        """What has just come passes."""
        passes = not self.cut and self.chance.random() >= self.loss
        self.passed += passes
        self.dropped += not passes
        return passes

    def files(self) -> dict[int, Callable[[], None]]:
        """Descriptors, and what reads them."""
        raise NotImplementedError

    def look(self, now: float) -> None:
        """What is to be done from time to time."""

    def close(self) -> None:
        """All ends."""
        raise NotImplementedError
