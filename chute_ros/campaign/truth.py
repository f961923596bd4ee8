"""What a perfect observer knows: from the flight models alone, not from any rule."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass

from chute_ros.sim.flight import FlightModel
from chute_ros.sim.rocket import Rocket

STEP = 0.02  # s
#: Softer than this nobody is hurt: canopy speed and a quarter, m/s.
SOFT = 6.5
#: The same of a rocket under its drogue, whose main may fail as well.
SOFT_UNDER_DROGUE = 31.0
#: The release may be put off by so much, s, and that is found to this.
_LONGEST_FALL, _GRAIN = 60.0, 0.02


@dataclass(frozen=True)
class Truth:
    """at: since when only a parachute helps, virtual s; NaN: it never was so. latest: the last
    release that still lands it softly; NaN: none did. height: at that time, m."""

    at: float = math.nan
    latest: float = math.nan
    height: float = math.nan

    @property
    def falls(self) -> bool:
        """Only a parachute helps."""
        return not math.isnan(self.at)

    @property
    def leeway(self) -> float:
        """How long one may take over it, s; below 0: there is no time at all."""
        return -1.0 if math.isnan(self.latest) else self.latest - self.at


def observe(model: FlightModel, now: float) -> Truth:
    """Nothing carries the aircraft from now on."""
    late = _latest(lambda after: touchdown_speed(model, after) <= SOFT)
    return Truth(now, now + late, model.height)


def observe_rocket(rocket: Rocket, now: float) -> Truth:
    """The rocket comes down from now on, and nothing on board will brake it by itself."""
    late = _latest(lambda after: landing_speed(rocket, after) <= SOFT_UNDER_DROGUE)
    return Truth(now, now + late, rocket.height)


def _latest(is_soft: Callable[[float], bool]) -> float:
    """The longest time (s) that a release may take; NaN: there is none."""
    if not is_soft(0.0):
        return math.nan
    low, high = 0.0, _LONGEST_FALL
    while high - low > _GRAIN:
        middle = (low + high) / 2.0
        low, high = (middle, high) if is_soft(middle) else (low, middle)
    return low


def touchdown_speed(model: FlightModel, released_after: float) -> float:
    """m/s, with a release so much later, s, and no wind."""
    # A plain model: the wind of the flight is not known beforehand.
    one = FlightModel(
        **{name: copy.copy(getattr(model, name)) for name in FlightModel.__dataclass_fields__}
    )
    one.armed = False
    passed, speed = 0.0, 0.0
    while not one.on_ground and passed < 5.0 * _LONGEST_FALL:
        if passed >= released_after:
            one.release()
            if one.canopy >= 1.0 and -one.vertical_speed <= SOFT:
                return -one.vertical_speed  # it will not become faster again
        speed = -one.vertical_speed
        one.step(STEP)
        passed += STEP
    return speed


def landing_speed(rocket: Rocket, released_after: float) -> float:
    """m/s, with a drogue that comes out so much later, s."""
    one, passed, speed = copy.copy(rocket), 0.0, 0.0
    while not one.on_ground and passed < 5.0 * _LONGEST_FALL:
        if passed >= released_after:
            one.release_drogue()
            if (
                one.drogue_out_for > one.drogue_opening_time
                and -one.vertical_speed <= one.drogue_speed
            ):
                return -one.vertical_speed
        speed = -one.vertical_speed
        one.step(STEP)
        passed += STEP
    return speed
