"""What carries messages from one part to another, and what can happen to them on the way."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Generic, TypeVar

from chute_ros.campaign.world import World

MessageT = TypeVar("MessageT")


@dataclass(frozen=True)
class Spell:
    """From begin to end (virtual s) this is so. Chances are 0 to 1 for each message; delay: at
    most so many s, each message its own; reorder: it comes after some of those that follow it."""

    begin: float
    end: float
    loss: float = 0.0
    double: float = 0.0
    corrupt: float = 0.0
    delay: float = 0.0
    reorder: float = 0.0
    #: A cable that flaps: this many s there, and as many s gone; 0: it does not.
    flaps: float = 0.0

    def is_on(self, now: float) -> bool:
        """It is so now."""
        if not self.begin <= now < self.end:
            return False
        return not self.flaps or int((now - self.begin) / self.flaps) % 2 == 0

    def later(self, by: float) -> Spell:
        """The same at another time."""
        return replace(self, begin=self.begin + by, end=self.end + by)


#: The spells that lie on a part of the way, now or at some time.
Way = list[Spell]


@dataclass(frozen=True)
class Delivery:
    """How messages arrive. delay: s; in_order: what comes later never overtakes what went
    before, as with one writer of ROS; overtaken: one that is comes at most so much later, s."""

    delay: float
    in_order: bool = False
    overtaken: float = 0.0


class Channel(Generic[MessageT]):
    """One direction over some ways. seed: of its chances; spoil: makes a damaged message of a
    whole one; None: nobody takes it for one."""

    def __init__(
        self,
        world: World,
        seed: str,
        delivery: Delivery,
        ways: tuple[Way, ...],
        spoil: Callable[[MessageT, random.Random], MessageT | None] | None = None,
    ) -> None:
        self._world, self._seed, self._delivery = world, seed, delivery
        self._ways, self._spoil = ways, spoil
        self._newest = 0.0

    @cached_property
    def _chance(self) -> random.Random:
        """Begun with the first thing that happens: on most ways nothing does, and a text is made
        a seed slowly."""
        return random.Random(self._seed)

    def send(
        self, messages: Sequence[MessageT], deliver: Callable[[Sequence[MessageT], float], None]
    ) -> None:
        """Deliver them, later, twice, damaged or never. What is sent in one go arrives in one go,
        as long as nothing happens to it on the way."""
        now = self._world.now
        spells = [spell for way in self._ways for spell in way if spell.is_on(now)]
        if not spells:
            self._post(now + self._delivery.delay, messages, deliver)
            return
        for message in messages:
            self._send_one(message, spells, deliver)

    def _send_one(
        self,
        message: MessageT,
        spells: list[Spell],
        deliver: Callable[[Sequence[MessageT], float], None],
    ) -> None:
        chance, delivery = self._chance.random, self._delivery
        copies, arrives = 1, self._world.now + delivery.delay
        for spell in spells:
            if spell.loss and chance() < spell.loss:
                return
            if spell.double and chance() < spell.double:
                copies += 1
            if spell.corrupt and self._spoil is not None and chance() < spell.corrupt:
                spoiled = self._spoil(message, self._chance)
                if spoiled is None:
                    return
                message = spoiled
            if spell.delay:
                arrives += chance() * spell.delay
            if spell.reorder and chance() < spell.reorder:
                arrives += chance() * delivery.overtaken
        for _ in range(copies):
            self._post(arrives, (message,), deliver)

    def _post(
        self,
        arrives: float,
        messages: Sequence[MessageT],
        deliver: Callable[[Sequence[MessageT], float], None],
    ) -> None:
        if self._delivery.in_order:
            arrives = self._newest = max(arrives, self._newest)
        self._world.post(arrives, partial(deliver, messages))
