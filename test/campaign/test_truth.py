"""What a perfect observer knows of a fall."""

from __future__ import annotations

import pytest

from chute_ros.campaign.truth import (
    SOFT,
    SOFT_UNDER_DROGUE,
    landing_speed,
    observe,
    observe_rocket,
    touchdown_speed,
)
from chute_ros.sim.flight import Descent, FlightModel
from chute_ros.sim.rocket import Rocket


def falling_from(height: float, fall_speed: float = 25.0) -> FlightModel:
    return FlightModel(height=height, armed=True, motors_failed=True, fall_speed=fall_speed)


def test_the_last_moment_is_the_last() -> None:
    model = falling_from(60.0)
    truth = observe(model, 100.0)
    assert truth.falls
    assert truth.height == 60.0
    assert truth.leeway == pytest.approx(truth.latest - 100.0)
    assert touchdown_speed(model, truth.leeway - 0.01) <= SOFT
    assert touchdown_speed(model, truth.leeway + 0.06) > SOFT
    assert model.height == 60.0, "the vehicle itself has not moved"


def test_the_higher_the_more_time() -> None:
    leeways = [observe(falling_from(height), 0.0).leeway for height in (10, 20, 40, 80, 120)]
    assert leeways == sorted(leeways)
    assert leeways[0] < 1.0 < leeways[1] < 2.0 < leeways[2] < 4.0
    under_canopy = FlightModel(height=3.0, vertical_speed=-12.0, motors_failed=True)
    assert observe(under_canopy, 0.0).leeway == -1.0, "too low and too fast for any parachute"


def test_without_a_parachute_it_hits_the_ground_hard() -> None:
    assert touchdown_speed(falling_from(100.0), 1e9) > 20.0


def test_one_that_sinks_slowly_has_until_a_canopy_still_opens() -> None:
    """Given 8 m/s from 60 m: its motors are stopped with the release, and not before."""
    sinks = Descent("partial thrust", 8.0, settles=2.0)
    model = falling_from(60.0)
    model.descent = sinks
    truth = observe(model, 0.0)
    assert 7.0 < truth.leeway < 9.0
    assert observe(falling_from(60.0), 0.0).leeway < 4.0
    assert model.armed
    assert touchdown_speed(model, 1e9) == pytest.approx(8.0, abs=0.2)
    assert not truth.lands_softly
    model.height = 8.0
    assert observe(model, 0.0).lands_softly, "it is not so fast yet"


def test_over_a_valley_there_is_more_time_and_over_a_hill_less() -> None:
    leeways = []
    for ground in (-60.0, 0.0, 30.0):
        model = falling_from(60.0)
        model.ground = ground
        leeways.append(observe(model, 0.0).leeway)
    assert leeways == sorted(leeways, reverse=True)
    assert leeways[0] > leeways[1] + 2.0


@pytest.mark.parametrize("speed", [22.0, 5.0])
def test_beside_a_canopy_that_does_not_carry_another_one_is_meant(speed: float) -> None:
    """Given one that tangles, or one that never left its bag, whatever its status says."""
    model = falling_from(100.0)
    model.canopy_speed, model.released_for, model.vertical_speed = speed, 3.0, -22.0
    truth = observe(model, 0.0)
    assert 1.5 < truth.leeway < 4.0
    assert touchdown_speed(model, truth.leeway - 0.05) <= SOFT
    assert touchdown_speed(model, truth.leeway + 0.1) > SOFT


def test_a_rocket_has_until_its_drogue_just_brakes_it() -> None:
    rocket = Rocket(height=400.0, burned_for=60.0)
    truth = observe_rocket(rocket, 10.0)
    assert 5.0 < truth.leeway < 10.0
    assert landing_speed(rocket, truth.leeway - 0.05) <= SOFT_UNDER_DROGUE
    assert landing_speed(rocket, truth.leeway + 0.1) > SOFT_UNDER_DROGUE
    assert rocket.height == 400.0, "the rocket itself has not moved"
    assert observe_rocket(Rocket(height=3.0, vertical_speed=-90.0), 0.0).leeway == -1.0
