"""What pilots and missions fly on purpose, however alarming it looks: nothing has failed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from chute_ros.sim.flight import GRAVITY


class ManoeuvreMotion(NamedTuple):
    """m/s up, rad, specific force in m/s^2."""

    vertical_speed: float
    roll: float
    force: float


@dataclass(frozen=True)
class Manoeuvre:
    """kind: flip (amount: degrees a second), throw (s without thrust), dive (degrees from upright)
    or descent (m/s); begin: s after it is up; lasts: s, of a dive or descent; sink: m/s, of a
    dive."""

    kind: str
    amount: float
    begin: float
    lasts: float = 0.0
    sink: float = 0.0

    def at(self, passed: float) -> ManoeuvreMotion | None:
        """What it does so long after its begin, s; None: it is over."""
        return _FLOWN[self.kind](self, passed)


def _flip(one: Manoeuvre, passed: float) -> ManoeuvreMotion | None:
    """A hop, a turn about its axis with little thrust, and the thrust to stop the sink."""
    climb, hop, stop, turn = 3.0, 0.3, 0.8, 360.0 / one.amount
    if passed < hop:
        return ManoeuvreMotion(climb * passed / hop, 0.0, GRAVITY + climb / hop)
    passed -= hop
    if passed < turn:
        angle = math.remainder(math.radians(one.amount * passed), 2.0 * math.pi)
        return ManoeuvreMotion(climb - 0.9 * GRAVITY * passed, angle, 0.25 * GRAVITY)
    passed -= turn
    return _stopped(climb - 0.9 * GRAVITY * turn, passed, stop)


def _throw(one: Manoeuvre, passed: float) -> ManoeuvreMotion | None:
    """Dropped by a carrier, thrown by hand, or its throttle cut; then it catches itself."""
    if passed < one.amount:
        return ManoeuvreMotion(-GRAVITY * passed, 0.1, 0.5)
    return _stopped(-GRAVITY * one.amount, passed - one.amount, 1.0)


def _dive(one: Manoeuvre, passed: float) -> ManoeuvreMotion | None:
    if passed < one.lasts:
        sink = one.sink * min(1.0, passed / 0.5)
        return ManoeuvreMotion(-sink, math.radians(one.amount), 1.1 * GRAVITY)
    return _stopped(-one.sink, passed - one.lasts, 1.0)


def _descent(one: Manoeuvre, passed: float) -> ManoeuvreMotion | None:
    if passed < one.lasts:
        return ManoeuvreMotion(-one.amount * min(1.0, passed), 0.2, GRAVITY)
    return _stopped(-one.amount, passed - one.lasts, 1.0)


def _stopped(speed: float, passed: float, within: float) -> ManoeuvreMotion | None:
    """From a speed to none."""
    if passed >= within:
        return None
    return ManoeuvreMotion(speed * (1.0 - passed / within), 0.0, GRAVITY - speed / within)


_FLOWN: dict[str, Callable[[Manoeuvre, float], ManoeuvreMotion | None]] = {
    "flip": _flip,
    "throw": _throw,
    "dive": _dive,
    "descent": _descent,
}
