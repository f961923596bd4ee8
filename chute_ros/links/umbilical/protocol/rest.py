"""Whether a rocket rests, by its barometer, its satellites and its accelerometer; and whether its
barometer lives.

Source: Umbilical Reference, section 1 (altitude, pressure, fix_type, vel_d, accel_x to accel_z).
"""

from __future__ import annotations

import math
from collections import deque
from statistics import fmean

from chute_ros.links.umbilical.protocol.layouts import Record
from chute_ros.model import NAN

FIX_3D = 3
#: It has landed when its altitude stays within so many metres for so many seconds after a
#: deployment: the slowest canopy falls several times as fast.
_REST_HEIGHT, _REST_TIME = 3.0, 5.0
#: Speeds of so long, s, are of one that moves if their mean is beyond this, m/s, unless they have
#: been the same to the last bit for half as long: satellites that are not heard any more.
_SPEEDS_OVER, _REST_SPEED = 3.0, 1.0
#: A barometer whose pressure has been the same to the last bit for so long, s, in so many records
#: at least, tells no height that changes by more than at rest: one that is lost may go on from its
#: last value, and sink by what is taken from it at each turn.
_PRESSURE_STANDS, _FEWEST = 0.6, 3
#: It stands, whatever its mode, if so long, s, it has stayed where it is and feels its weight to
#: this, m/s^2, and its barometer has lived within this, s.
_STANDS_AFTER, _ITS_WEIGHT, _LIVES_WITHIN = 10.0, 2.0, 2.0
_GRAVITY = 9.81  # m/s^2


class Rest:
    """By its records: silence is no rest. Times are monotonic s."""

    def __init__(self) -> None:
        self._record: Record | None = None
        self._altitude = self._since = NAN
        #: Its downward speeds of the last seconds, with their times; m/s.
        self._speeds: deque[tuple[float, float]] = deque()
        #: Since when its pressure is the same to the last bit, in so many records, and what its
        #: altitude was then, m.
        self._pressure_since = self._pressure_altitude = NAN
        self._pressure_told = 0

    def begin_anew(self) -> None:
        """Its altitude may count from elsewhere from the next record on."""
        self._altitude = NAN

    def watch(self, record: Record, moves: bool) -> None:
        """A record came. moves: something else shows that it does."""
        before, self._record = self._record, record
        altitude, now = record.number("altitude"), record.received
        if before is None or before["pressure"] != record["pressure"]:
            self._pressure_since, self._pressure_altitude = now, altitude
            self._pressure_told = 0
        self._pressure_told += 1
        # A barometer that is stuck is no rest where the satellites tell of a fall.
        moves |= self._moves_by_satellites(record)
        stays = abs(altitude - self._altitude) <= _REST_HEIGHT
        if moves or not stays:
            self._altitude, self._since = altitude, now

    @property
    def rests(self) -> bool:
        """Its altitude has not changed for a while."""
        return self._lasts(_REST_TIME)

    @property
    def stands(self) -> bool:
        """For longer, and it feels its weight: it does not fly, whatever its mode."""
        if self._record is None or not self._lasts(_STANDS_AFTER):
            return False
        feels_its_weight = abs(force(self._record) - _GRAVITY) <= _ITS_WEIGHT
        return self._pressure_lives and feels_its_weight

    @property
    def barometer_is_lost(self) -> bool:
        """Its altitude changes, and its pressure does not."""
        if self._record is None or self._pressure_told < _FEWEST:
            return False
        stands = self._record.received - self._pressure_since > _PRESSURE_STANDS
        moved = abs(self._record.number("altitude") - self._pressure_altitude)
        return stands and moved > _REST_HEIGHT

    @property
    def _pressure_lives(self) -> bool:
        record = self._record
        return record is not None and record.received - self._pressure_since <= _LIVES_WITHIN

    def _lasts(self, seconds: float) -> bool:
        return self._record is not None and self._record.received - self._since >= seconds

    def _moves_by_satellites(self, record: Record) -> bool:
        speed = record.number("vel_d") if record.number("fix_type") >= FIX_3D else NAN
        if math.isnan(speed):
            self._speeds.clear()
            return False
        now = record.received
        self._speeds.append((now, speed))
        while now - self._speeds[0][0] > _SPEEDS_OVER:
            self._speeds.popleft()
        speeds = [one for _, one in self._speeds]
        frozen = len(set(speeds)) == 1 and now - self._speeds[0][0] > _SPEEDS_OVER / 2.0
        ignored = frozen and self._pressure_lives
        return not ignored and abs(fmean(speeds)) > _REST_SPEED


def force(record: Record) -> float:
    """Length of the specific force, m/s^2."""
    return math.sqrt(sum(record.number(f"accel_{axis}") ** 2 for axis in "xyz"))
