"""What a perfect observer knows: from the flight models alone, not from any rule."""

from __future__ import annotations

import bisect
import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chute_ros.sim.flight import FlightModel
from chute_ros.sim.rocket import Rocket

STEP = 0.02  # s
#: Softer than this nobody is hurt: canopy speed and a quarter, m/s.
SOFT = 6.5
#: The same of a rocket under its drogue, whose main may fail as well.
SOFT_UNDER_DROGUE = 31.0
#: Of a parachute that carries, m/s.
_CARRIES = FlightModel.canopy_speed
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
    def lands_softly(self) -> bool:
        """It does so without any release."""
        return self.leeway >= _LONGEST_FALL - 2.0 * _GRAIN

    @property
    def leeway(self) -> float:
        """How long one may take over it, s; below 0: there is no time at all."""
        return -1.0 if math.isnan(self.latest) else self.latest - self.at


@dataclass(eq=False)
class Course:
    """What became of a vehicle, virtual s; NaN: it did not happen."""

    truth: Truth = Truth()
    released: float = math.nan
    release_height: float = math.nan
    landed: float = math.nan
    landing_speed: float = math.nan
    #: When a second parachute came out, as the first one did not carry; when that was in time.
    released_another: float = math.nan
    another: Truth = Truth()
    #: When its autopilot released a parachute that nobody had ordered.
    opened_by_kill: float = math.nan
    #: When less than half of its weight last carried an aircraft in its fall.
    light_until: float = math.nan
    #: From when until when it fell past the height of its take-off, high above the ground.
    unclear: tuple[float, float] = (math.nan, math.nan)


def observe(model: FlightModel, now: float) -> Truth:
    """Nothing carries the aircraft from now on, nor does a canopy that is out already."""
    return Truth(now, now + _latest(_fall_of(model), SOFT), model.height)


def observe_rocket(rocket: Rocket, now: float) -> Truth:
    """The rocket comes down from now on, and nothing on board will brake it by itself."""
    return Truth(now, now + _latest(_fall_of_rocket(rocket), SOFT_UNDER_DROGUE), rocket.height)


def touchdown_speed(model: FlightModel, released_after: float) -> float:
    """m/s, with a release so much later, s, and no wind."""
    return _fall_of(model).touchdown_speed(released_after)


def landing_speed(rocket: Rocket, released_after: float) -> float:
    """m/s, with a drogue that comes out so much later, s."""
    return _fall_of_rocket(rocket).touchdown_speed(released_after)


def _latest(fall: _Fall, soft: float) -> float:
    """The longest time (s) that a release may take; NaN: there is none."""
    if not fall.touchdown_speed(0.0) <= soft:
        return math.nan
    low, high = 0.0, _LONGEST_FALL
    while high - low > _GRAIN:
        middle = (low + high) / 2.0
        is_soft = fall.touchdown_speed(middle) <= soft
        low, high = (middle, high) if is_soft else (low, middle)
    return low


def _fall_of(model: FlightModel) -> _Fall:
    # A plain model: the wind of the flight is not known beforehand.
    one = FlightModel(
        **{name: copy.copy(getattr(model, name)) for name in FlightModel.__dataclass_fields__}
    )
    if not math.isnan(one.released_for) and one.canopy_speed <= SOFT:
        one.canopy_speed = one.fall_speed

    def release() -> None:
        # Its motors are stopped first. A parachute that does not carry is not meant here.
        one.armed = False
        if one.canopy_speed > SOFT:
            one.release_another(_CARRIES)
        else:
            one.release()

    # Once it is as slow as that it will not become faster again.
    return _Fall(one, release, lambda: one.canopy >= 1.0 and -one.vertical_speed <= SOFT)


def _fall_of_rocket(rocket: Rocket) -> _Fall:
    one = copy.copy(rocket)

    def is_braked() -> bool:
        opened = one.drogue_out_for > one.drogue_opening_time
        return opened and -one.vertical_speed <= one.drogue_speed

    return _Fall(one, one.release_drogue, is_braked)


@dataclass(frozen=True)
class _Moment:
    """passed: since the beginning, s; speed: downwards, m/s, a step before; body: its fields."""

    passed: float
    speed: float
    body: dict[str, Any]
    is_last: bool


class _Fall:
    """A body that nothing brakes, and what would become of it if something did from some moment
    on. The fall until then is the same whenever that is: it is lived through once."""

    def __init__(
        self,
        body: FlightModel | Rocket,
        release: Callable[[], None],
        is_braked: Callable[[], bool],
    ) -> None:
        self._body, self._release, self._is_braked = body, release, is_braked
        self._moments = [self._moment(0.0, 0.0)]

    def touchdown_speed(self, released_after: float) -> float:
        """m/s, with a release so much later, s."""
        while self._moments[-1].passed < released_after and not self._moments[-1].is_last:
            self._fall_on()
        at = bisect.bisect_left(self._moments, released_after, key=lambda one: one.passed)
        moment = self._moments[min(at, len(self._moments) - 1)]
        self._be_at(moment)
        passed, speed = moment.passed, moment.speed
        while not self._is_over(passed):
            self._release()
            if self._is_braked():
                return -self._body.vertical_speed
            passed, speed = self._step(passed)
        return speed

    def _fall_on(self) -> None:
        self._be_at(self._moments[-1])
        self._moments.append(self._moment(*self._step(self._moments[-1].passed)))

    def _step(self, passed: float) -> tuple[float, float]:
        speed = -self._body.vertical_speed
        self._body.step(STEP)
        return passed + STEP, speed

    def _moment(self, passed: float, speed: float) -> _Moment:
        return _Moment(passed, speed, vars(self._body).copy(), self._is_over(passed))

    def _be_at(self, moment: _Moment) -> None:
        vars(self._body).update(moment.body)

    def _is_over(self, passed: float) -> bool:
        return self._body.on_ground or passed >= 5.0 * _LONGEST_FALL
