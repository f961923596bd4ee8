"""What pilots and missions fly on purpose, however alarming it looks: nothing has failed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from chute_ros.sim.flight import GRAVITY

#: A landing comes down so far with the speed of its touch-down, m.
_LAST = 3.0
#: What descends or dives on purpose speeds up with so much at most, m/s^2: half of the weight is
#: still felt; and what lands, as autopilots do by default (ArduPilot PILOT_ACC_Z; PX4
#: MPC_ACC_DOWN_MAX 3).
_SPEEDS_UP, _LANDS = 4.5, 2.5


class ManoeuvreMotion(NamedTuple):
    """m/s up, rad, specific force in m/s^2."""

    vertical_speed: float
    roll: float
    force: float


@dataclass(frozen=True)
class Manoeuvre:
    """kind: flip (amount: degrees a second), throw (s without thrust), dive (degrees from
    upright), descent (m/s), transition (degrees, from hovering to wings or back) or landing (m/s
    as it touches down); begin: s after it is up; lasts: s, and of a landing until it slows down to
    amount; sink: m/s, of a dive, a transition and a landing until then; slope: degrees, of the
    ground on which it lands; lean: degrees, of a descent."""

    kind: str
    amount: float
    begin: float
    lasts: float = 0.0
    sink: float = 0.0
    slope: float = 0.0
    lean: float = 11.5

    def __post_init__(self) -> None:
        if self.kind not in _FLOWN:
            raise ValueError(f"manoeuvre {self.kind!r}: need one of {', '.join(_FLOWN)}")
        length = "lasts" if self.kind == "transition" else "amount"
        if not getattr(self, length) > 0.0:
            raise ValueError(f"{length} of a {self.kind} is {getattr(self, length)}: need above 0")

    @property
    def lands(self) -> bool:
        """It ends on the ground."""
        return self.kind == "landing"

    @property
    def over_by(self) -> float:
        """s after it is up."""
        ends = 1.0 + (_LAST + 1.0) / self.amount if self.lands else 2.0
        return self.begin + self.lasts + ends

    def at(self, passed: float) -> ManoeuvreMotion | None:
        """What it does so long after its begin, s; None: it is over."""
        return _FLOWN[self.kind](self, passed)


def landing(
    clearance: float, sink: float, touches: float, begin: float, slope: float = 0.0
) -> Manoeuvre:
    """From so high above the ground, m, with these, m/s, until it slows down and as it touches."""
    slows = (sink + touches) / 2.0  # m, in a second
    lasts = max(1.0, (clearance - _LAST - slows) / sink + sink / (2.0 * _LANDS))
    return Manoeuvre("landing", touches, begin, round(lasts, 2), sink, slope)


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


def _sinking(
    sink: float, lean: float, force: float, passed: float, speeds_up: float = _SPEEDS_UP
) -> ManoeuvreMotion:
    """Down with ever more, until it is this sink, m/s, in which it feels this force, m/s^2."""
    missing = speeds_up if speeds_up * passed < sink else 0.0
    return ManoeuvreMotion(-min(sink, speeds_up * passed), lean, force - missing)


def _sunk(
    one: Manoeuvre, passed: float, sink: float, degrees: float, force: float
) -> ManoeuvreMotion | None:
    """As _sinking as long as it lasts, and then stopped."""
    if passed < one.lasts:
        return _sinking(sink, math.radians(degrees), force, passed)
    return _stopped(-min(sink, _SPEEDS_UP * one.lasts), passed - one.lasts, 1.0)


def _dive(one: Manoeuvre, passed: float) -> ManoeuvreMotion | None:
    return _sunk(one, passed, one.sink, one.amount, 1.1 * GRAVITY)


def _descent(one: Manoeuvre, passed: float) -> ManoeuvreMotion | None:
    return _sunk(one, passed, one.amount, one.lean, GRAVITY)


def _transition(one: Manoeuvre, passed: float) -> ManoeuvreMotion | None:
    """It leans forward and sinks until its wings carry it, or rises as it leans back."""
    if passed >= one.lasts:
        return None
    share = math.sin(math.pi * passed / one.lasts)
    push = one.sink * math.pi / one.lasts * math.cos(math.pi * passed / one.lasts)
    return ManoeuvreMotion(-one.sink * share, math.radians(one.amount) * share, GRAVITY - push)


def _landing(one: Manoeuvre, passed: float) -> ManoeuvreMotion | None:
    """Down, slower before the ground, and on until it is there."""
    if passed < one.lasts:
        return _sinking(one.sink, 0.1, GRAVITY, passed, _LANDS)
    slowed = min(1.0, passed - one.lasts)
    braked = one.sink - one.amount if slowed < 1.0 else 0.0
    return ManoeuvreMotion(-one.sink + slowed * (one.sink - one.amount), 0.05, GRAVITY + braked)


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
    "transition": _transition,
    "landing": _landing,
}
