"""A MAVLink network: what one says, all others hear, each over its own ways."""

from __future__ import annotations

import random
from typing import TypeVar

from chute_ros.campaign.channel import Channel
from chute_ros.campaign.world import World
from chute_ros.sim.faults import flip_a_byte
from chute_ros.transport.loop import ProtocolLink

#: A datagram on a companion computer's network, s.
_WIRE_DELAY = 0.0005


class Plug:
    """A protocol or a simulator that is plugged in, with a way to the network and one back."""

    def __init__(self, bus: Bus, link: ProtocolLink) -> None:
        self._bus, self.link = bus, link
        self.outward = bus.channel()
        self.inward = bus.channel()
        #: It hangs, or has no power: nothing is read and nothing is sent until then, virtual s.
        self.dead_until = 0.0

    def update(self, now: float) -> None:
        """Look at the clock."""
        if now >= self.dead_until:
            self.link.update(now)
            self.flush()

    def next_deadline(self) -> float:
        """When update has something to do."""
        return max(self.link.next_deadline(), self.dead_until)

    def flush(self) -> None:
        """Send what it has to say."""
        for data in self.link.take_output():
            self.outward.send(data, self.arrived_at_the_bus)

    def hear(self, data: bytes, now: float) -> None:
        """A datagram came."""
        if now >= self.dead_until:
            self.link.receive(data, now)
            self.flush()

    def arrived_at_the_bus(self, data: bytes, now: float) -> None:
        """What it sent has got so far."""
        self._bus.carry(data, self)


PlugT = TypeVar("PlugT", bound=Plug)


class Bus:
    """Like a switch with a multicast address."""

    def __init__(self, world: World, chance: random.Random) -> None:
        self._world, self._chance = world, chance
        self._plugs: list[Plug] = []

    def plug(self, link: ProtocolLink) -> Plug:
        """Plug it in."""
        return self.add(Plug(self, link))

    def add(self, plug: PlugT) -> PlugT:
        """The same for a plug that was made already."""
        self._plugs.append(plug)
        return plug

    def channel(self) -> Channel[bytes]:
        """A new way."""
        return Channel(self._world, self._chance, _WIRE_DELAY / 2, False, flip_a_byte)

    def carry(self, data: bytes, source: Plug) -> None:
        """To everybody else."""
        for plug in self._plugs:
            if plug is not source:
                plug.inward.send(data, plug.hear)
