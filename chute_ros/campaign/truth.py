"""What a perfect observer knows: from the flight model alone, not from any rule."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

from chute_ros.sim.flight import FlightModel

STEP = 0.02  # s
#: Softer than this nobody is hurt: canopy speed and a quarter, m/s.
SOFT = 6.5
#: How far the release may be put off in steps of this, s.
_GRAIN = 0.05
_LONGEST_FALL = 30.0  # s


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
    """Control is lost now."""
    latest = math.nan
    late = 0.0
    while late < _LONGEST_FALL and touchdown_speed(model, late) <= SOFT:
        latest = now + late
        late += _GRAIN
    return Truth(now, latest, model.height)


def touchdown_speed(model: FlightModel, released_after: float) -> float:
    """m/s, with a release so much later, s, and no wind."""
    # A plain model: the wind of the flight is not known beforehand.
    one = FlightModel(
        **{name: copy.copy(getattr(model, name)) for name in FlightModel.__dataclass_fields__}
    )
    one.armed = False
    passed, speed = 0.0, 0.0
    while not one.on_ground:
        if passed >= released_after:
            one.release()
        speed = -one.vertical_speed
        one.step(STEP)
        passed += STEP
        if passed > 10.0 * _LONGEST_FALL:
            break
    return speed
