"""A network, bus or cable: what one says, all others hear, each over its own way."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from chute_ros.campaign.channel import Channel, Delivery, Way
from chute_ros.campaign.world import World
from chute_ros.sim.faults import flip_a_byte
from chute_ros.transport.loop import ProtocolLink

#: Of a CAN frame as bytes (protocol/dronecan/can_frame.py): where its length and its data stand.
_CAN_LENGTH, _CAN_DATA = 4, 8


def spoil_can(frame: bytes, chance: random.Random) -> bytes:
    """One byte of its data is another, between an adapter and its host: a frame with another
    identifier nobody has sent."""
    length = frame[_CAN_LENGTH]
    if not length:
        return frame
    end = _CAN_DATA + length
    return frame[:_CAN_DATA] + flip_a_byte(frame[_CAN_DATA:end], chance) + frame[end:]


def refuse_can(frame: bytes, chance: random.Random) -> None:
    """What is damaged on the bus itself every CAN controller refuses by its checksum."""


Spoil = Callable[[bytes, random.Random], bytes | None]


@dataclass(frozen=True)
class Medium:
    """What it is made of."""

    delivery: Delivery
    spoil: Spoil


#: Half of the way from one to another each: datagrams on a companion computer's network, frames on
#: a CAN bus, USB packets of a serial cable.
MAVLINK = Medium(Delivery(0.00025, overtaken=0.05), flip_a_byte)
CAN = Medium(Delivery(0.0001, overtaken=0.002), refuse_can)
SERIAL = Medium(Delivery(0.001, in_order=True), flip_a_byte)


class Plug:
    """A protocol or a simulator that is plugged in. hears: whether bytes are for it at all, which
    spares it to decode what it does nothing about; spoil: where damage is not that of the bus."""

    def __init__(
        self,
        bus: Bus,
        name: str,
        link: ProtocolLink,
        hears: Callable[[bytes], bool] = lambda data: True,
        spoil: Spoil | None = None,
    ) -> None:
        self._bus, self.name, self.link, self.hears = bus, name, link, hears
        self.way: Way = []
        #: It hangs, or has no power: nothing is read and nothing is sent until then, virtual s.
        self.dead_until = 0.0
        #: What came while it hung.
        self.waiting: list[bytes] = []
        self.outward, self.inward = bus.add(self, spoil)
        self._carry = partial(bus.carry, self)

    def asleep_until(self) -> float:
        """It does not run until then, virtual s."""
        return self.dead_until

    def update(self, now: float) -> None:
        """Look at the clock."""
        if now < self.asleep_until():
            return
        waiting, self.waiting = self.waiting, []
        for data in waiting:
            self.link.receive(data, now)
        self.link.update(now)
        self.flush()

    def next_deadline(self) -> float:
        """When update has something to do."""
        return max(self.link.next_deadline(), self.asleep_until())

    def flush(self) -> None:
        """Send what it has to say."""
        self.send(self.link.take_output())

    def send(self, frames: Sequence[bytes]) -> None:
        """To all others."""
        if frames:
            self.outward.send(frames, self._carry)

    def hear(self, frames: Sequence[bytes], now: float) -> None:
        """Bytes came; a loop reads all that is there before it looks at anything else."""
        if now >= self.asleep_until():
            for data in frames:
                self.link.receive(data, now)
            self.flush()
            self._bus.world.stir(self)
        elif self.keeps_waiting():
            self.waiting += frames

    def keeps_waiting(self) -> bool:
        """A system keeps for it what it does not read."""
        return False


class Bus:
    """Like a switch with a multicast address. seed: of its chances, with its plugs' names."""

    def __init__(self, world: World, medium: Medium, seed: str) -> None:
        self.world, self._medium, self._seed = world, medium, seed
        self._plugs: list[Plug] = []

    def add(self, plug: Plug, spoil: Spoil | None) -> tuple[Channel[bytes], Channel[bytes]]:
        """Its way to the bus, and the one back."""
        self._plugs.append(plug)
        return self._channel(plug, "out", spoil), self._channel(plug, "in", spoil)

    def _channel(self, plug: Plug, which: str, spoil: Spoil | None) -> Channel[bytes]:
        seed, medium = f"{self._seed} {plug.name} {which}", self._medium
        ways = (plug.way,)
        return Channel(self.world, seed, medium.delivery, ways, spoil or medium.spoil)

    def carry(self, source: Plug, frames: Sequence[bytes], now: float) -> None:
        """What source said has got to the bus: take it to everybody else."""
        for plug in self._plugs:
            if plug is not source:
                heard = [data for data in frames if plug.hears(data)]
                if heard:
                    plug.inward.send(heard, plug.hear)
