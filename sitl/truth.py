"""What the simulated vehicle really does, by the simulator's own state: no estimate, no home."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from chute_ros.protocol.rotation import tilt_of
from sitl.record import Seen

#: Below it the vehicle is on the ground, m.
GROUND = 0.7
#: A vehicle that reaches the ground faster has crashed, m/s: a parachute would have brought it
#: down slower (5 to 6 m/s).
CRASH = 6.0
#: A vehicle that sinks faster, and has lost some height by it, does not fly any more, m/s.
_SINKS = 4.0


@dataclass(frozen=True)
class Sample:
    """height: above where it stood first, m. climb: m/s, up positive. tilt: degrees."""

    at: float
    height: float
    climb: float
    tilt: float
    speed: float


class Truth:
    """All samples of a run, in their order."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._ground = math.nan

    def take(self, at: float, name: str, message: Any) -> None:
        """A message that holds truth, or another one."""
        if name == "SIM_STATE":
            self._add(at, message.alt, -message.vd, _tilt(message.roll, message.pitch),
                      math.hypot(message.vn, message.ve))  # fmt: skip
        elif name == "HIL_STATE_QUATERNION":
            _, x, y, _ = message.attitude_quaternion
            up = max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y)))
            self._add(at, message.alt / 1000.0, -message.vz / 100.0, math.degrees(math.acos(up)),
                      math.hypot(message.vx, message.vy) / 100.0)  # fmt: skip

    def _add(self, at: float, altitude: float, climb: float, tilt: float, speed: float) -> None:
        if math.isnan(self._ground):
            self._ground = altitude
        self.samples.append(Sample(at, altitude - self._ground, climb, tilt, speed))

    @property
    def now(self) -> Sample:
        """The newest one; heights of NaN as long as there is none."""
        return self.samples[-1] if self.samples else Sample(*[math.nan] * 5)

    def when(self, at: float) -> Sample:
        """The last one until then."""
        before = [one for one in self.samples if one.at <= at]
        return before[-1] if before else Sample(*[math.nan] * 5)

    def between(self, since: float, until: float) -> list[Sample]:
        """Those in this time."""
        return [one for one in self.samples if since <= one.at <= until]

    def highest(self, since: float, until: float = math.inf) -> float:
        """The greatest height in this time, m."""
        return max((one.height for one in self.between(since, until)), default=math.nan)

    def crashed(self, since: float) -> Sample | None:
        """The first sample after since at the ground that came there too fast to land."""
        flown: Sample | None = None
        for one in self.between(since, math.inf):
            if one.height > GROUND:
                flown = one
            elif flown is not None:
                if -flown.climb > CRASH:
                    return one
                flown = None
        return None

    def lost(self, since: float, until: float = math.inf) -> bool:
        """In this time it behaved as no flown vehicle does: fell, or lay on its side and sank."""
        every = self.between(since, until)
        falls = any(one.climb < -6.0 for one in every)
        on_its_side = any(one.tilt > 75.0 and one.climb < -2.0 for one in every)
        start = self.when(since)
        sank = any(start.height - one.height > 5.0 and one.climb < -_SINKS for one in every)
        return falls or on_its_side or sank


def truth_of(record: Iterable[Seen], ports: Sequence[int]) -> Truth:
    """From a record. ports: those that the simulator's own state comes to."""
    truth = Truth()
    for seen in record:
        if seen.port in ports:
            truth.take(seen.at, seen.name, seen.message)
    return truth


def _tilt(roll: float, pitch: float) -> float:
    return math.degrees(tilt_of(roll, pitch))
