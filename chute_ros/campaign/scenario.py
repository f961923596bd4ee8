"""One flight of a campaign, drawn from a seed: vehicle, wind, what fails, what else goes wrong."""

from __future__ import annotations

import enum
import random
from dataclasses import dataclass

from chute_ros.campaign.channel import Spell
from chute_ros.campaign.vehicle import SensorFault

#: At most so many things go wrong besides the failure.
MOST_FAULTS = 3
#: How long a flight is followed after what fails, s.
FOLLOWED = 14.0
PROFILES = ("multirotor", "fixed_wing")


class Failure(enum.Enum):
    """What ends controlled flight, or does not."""

    NOTHING = "nothing fails"
    MOTOR = "a motor fails"
    REBOOT = "the autopilot starts anew, and does not hold the vehicle"
    POWER = "the vehicle's power fails, and with it the autopilot"
    HANG = "the autopilot hangs, and the vehicle flies on"

    @property
    def falls(self) -> bool:
        """Nothing but a parachute helps."""
        return self in (Failure.MOTOR, Failure.REBOOT, Failure.POWER)


_LIKELY = {
    Failure.NOTHING: 4,
    Failure.MOTOR: 6,
    Failure.REBOOT: 2,
    Failure.POWER: 1,
    Failure.HANG: 1,
}
#: The ways that a spell can lie on.
WAYS = ("autopilot", "parachute", "node", "to the supervisor", "from the supervisor")
_SENSORS = ("height", "speed", "tilt", "force", "landed", "disarmed")


@dataclass(frozen=True)
class WayFault:
    """A spell on one way."""

    way: str
    spell: Spell


@dataclass(frozen=True)
class Stop:
    """A process hangs for so long, or dies and is there again after it. Times: virtual s."""

    who: str
    at: float
    lasts: float
    dies: bool = False


Fault = WayFault | Stop | SensorFault


@dataclass(frozen=True)
class Scenario:
    """Times are s after the vehicle has reached its height; negative: before."""

    seed: int
    profile: str
    height: float
    gusts: float
    fall_speed: float
    failure: Failure
    failure_at: float
    faults: tuple[Fault, ...]


def draw(seed: int) -> Scenario:
    """The same for the same seed, on any machine."""
    chance = random.Random(seed)
    failure = chance.choices(list(_LIKELY), list(_LIKELY.values()))[0]
    failure_at = round(chance.uniform(0.5, 3.0), 3)
    count = chance.choices((0, 1, 2, 3), (3, 4, 2, 1))[0]
    return Scenario(
        seed,
        chance.choice(PROFILES),
        round(chance.choice((chance.uniform(12.0, 40.0), chance.uniform(40.0, 120.0))), 1),
        round(chance.choice((0.0, chance.uniform(0.0, 2.0))), 2),
        round(chance.uniform(18.0, 35.0), 1),
        failure,
        failure_at,
        tuple(_fault(chance, failure_at) for _ in range(count)),
    )


def _fault(chance: random.Random, failure_at: float) -> Fault:
    # Most of what goes wrong goes wrong around the failure; that is what hurts.
    begin = round(failure_at + chance.uniform(-2.0, 2.0), 3)
    lasts = round(chance.choice((chance.uniform(0.1, 1.0), chance.uniform(1.0, 8.0))), 3)
    kind = chance.choice(("way", "way", "way", "stop", "sensor"))
    if kind == "sensor":
        return SensorFault(chance.choice(_SENSORS), begin, begin + lasts)
    if kind == "stop":
        who = chance.choice(("node", "supervisor", "parachute"))
        return Stop(who, begin, min(lasts, 3.0), dies=who != "node" and chance.random() < 0.5)
    strength = round(chance.uniform(0.05, 0.5), 3)
    spell = chance.choice(
        (
            Spell(begin, begin + lasts, loss=strength),
            Spell(begin, begin + lasts, loss=1.0),
            Spell(begin, begin + lasts, double=strength),
            Spell(begin, begin + lasts, corrupt=strength),
            Spell(begin, begin + lasts, delay=strength),
            Spell(begin, begin + lasts, loss=1.0, flaps=round(chance.uniform(0.1, 1.2), 3)),
        )
    )
    return WayFault(chance.choice(WAYS), spell)
