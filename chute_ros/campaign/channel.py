"""What carries messages from one part to another, and what can happen to them on the way."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from chute_ros.campaign.world import World

MessageT = TypeVar("MessageT")


@dataclass(frozen=True)
class Spell:
    """From begin to end (virtual s) this is so. Chances are 0 to 1 for each message; delay: at
    most so many s, each message its own."""

    begin: float
    end: float
    loss: float = 0.0
    double: float = 0.0
    corrupt: float = 0.0
    delay: float = 0.0
    #: A cable that flaps: this many s there, and as many s gone; 0: it does not.
    flaps: float = 0.0

    def is_on(self, now: float) -> bool:
        """It is so now."""
        if not self.begin <= now < self.end:
            return False
        return not self.flaps or int((now - self.begin) / self.flaps) % 2 == 0


class Channel(Generic[MessageT]):
    """One direction. spoil: makes a damaged message of a whole one; in_order: what comes later
    never overtakes what went before, as with one writer of ROS."""

    def __init__(
        self,
        world: World,
        chance: random.Random,
        delay: float,
        in_order: bool,
        spoil: Callable[[MessageT, random.Random], MessageT] | None = None,
    ) -> None:
        self._world, self._chance, self._delay = world, chance, delay
        self._in_order, self._spoil = in_order, spoil
        self._newest = 0.0
        self.spells: list[Spell] = []

    def send(self, message: MessageT, deliver: Callable[[MessageT, float], None]) -> None:
        """Deliver it, later, twice, damaged or never."""
        now, chance = self._world.now, self._chance.random
        copies, arrives = 1, now + self._delay
        for spell in self.spells:
            if not spell.is_on(now):
                continue
            if spell.loss and chance() < spell.loss:
                return
            if spell.double and chance() < spell.double:
                copies += 1
            if spell.corrupt and self._spoil is not None and chance() < spell.corrupt:
                message = self._spoil(message, self._chance)
            if spell.delay:
                arrives += chance() * spell.delay
        if self._in_order:
            arrives = self._newest = max(arrives, self._newest)
        for _ in range(copies):
            self._world.post(arrives, lambda at, message=message: deliver(message, at))
