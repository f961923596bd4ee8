"""Where an autopilot's home is, and what becomes of it: heights above home are told from there.

Sources: PX4 and ArduPlane as flown in their own simulators. PX4, disarmed in the air, says that it
has landed and sets home to where it is again and again; ArduPlane sets its height to zero once.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from chute_ros.sim.flight import FlightModel

#: From the disarming to the first new home, and from one to the next, s.
_FIRST, _AGAIN = 0.35, 1.0


class Homing(enum.Enum):
    """What becomes of home when the vehicle is disarmed in the air."""

    STAYS = "home stays where it was"
    FOLLOWS = "home moves to the vehicle again and again"
    ZEROED = "home moves to the vehicle once"


@dataclass
class Home:
    """altitude: of the place of take-off above mean sea level, m; offset: of home above that
    place, m; drift: of home, m/s."""

    altitude: float = 488.0
    offset: float = 0.0
    drift: float = 0.0
    homing: Homing = Homing.STAYS
    _at: float = math.nan
    _due: float = math.nan

    def move(self, by: float) -> None:
        """It is set anew, so much higher, m."""
        self.offset += by

    def follow(self, model: FlightModel, now: float) -> None:
        """Look at the vehicle and the clock."""
        if self._at < now:
            self.offset += self.drift * (now - self._at)
        self._at = now
        if model.armed or model.on_ground or self.homing is Homing.STAYS:
            self._due = math.nan
        elif math.isnan(self._due):
            self._due = now + _FIRST
        elif now >= self._due:
            self.offset = model.height
            self._due = now + (_AGAIN if self.homing is Homing.FOLLOWS else math.inf)
