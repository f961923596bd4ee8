"""What is flown on purpose begins and ends at rest, and is where its speed takes it."""

from __future__ import annotations

import math

import pytest
from campaign_bench import flown

from chute_ros.campaign.manoeuvre import Manoeuvre, landing
from chute_ros.campaign.scenario import Failure
from chute_ros.campaign.vehicle import WindyModel
from chute_ros.sim.flight import GRAVITY

FLIP = Manoeuvre("flip", 400.0, 1.0)
THROW = Manoeuvre("throw", 1.0, 1.0)
DIVE = Manoeuvre("dive", 70.0, 1.0, 1.5, 6.0)
DESCENT = Manoeuvre("descent", 8.0, 1.0, 5.0)


def track(manoeuvre: Manoeuvre):
    """The model on its way, each 20 ms from the begin of it."""
    model = WindyModel(height=100.0, target_height=100.0, armed=True, manoeuvre=manoeuvre)
    states = []
    for _ in range(500):
        model.step(0.02)
        states.append((model.vertical_speed, model.roll, model.acceleration))
    assert model.manoeuvre is None, "it is over"
    return model, states


@pytest.mark.parametrize(
    ("manoeuvre", "sink", "tilt", "lightest"),
    [
        (FLIP, (3.0, 6.0), (170.0, 180.0), 0.25 * GRAVITY),
        (THROW, (9.5, 10.0), (5.0, 6.0), 0.5),
        (DIVE, (6.0, 6.0), (70.0, 70.0), 1.1 * GRAVITY - 4.5),
        (DESCENT, (8.0, 8.0), (11.0, 12.0), GRAVITY - 4.5),
    ],
)
def test_it_is_flown_and_then_the_vehicle_hovers(manoeuvre, sink, tilt, lightest) -> None:
    model, states = track(manoeuvre)
    assert sink[0] <= max(-speed for speed, _, _ in states) <= sink[1]
    assert tilt[0] <= max(math.degrees(abs(roll)) for _, roll, _ in states) <= tilt[1] + 1e-6
    assert min(force for _, _, force in states) == pytest.approx(lightest, rel=0.15)
    assert model.vertical_speed == pytest.approx(0.0, abs=0.2)
    assert model.roll == 0.0
    assert model.height < 100.0


def test_what_is_out_of_control_flies_no_manoeuvre() -> None:
    model = WindyModel(height=100.0, armed=True, manoeuvre=DESCENT)
    model.step(0.02)
    model.motors_failed = True
    for _ in range(100):
        model.step(0.02)
    assert model.vertical_speed < -12.0
    assert model.manoeuvre is None


def test_nothing_falls_in_a_manoeuvre() -> None:
    end = flown(Failure.NOTHING, manoeuvre=THROW, height=80.0)
    assert not end.truth.falls
    assert math.isnan(end.landed)


@pytest.mark.parametrize(
    "manoeuvre",
    [
        FLIP,
        THROW,
        DIVE,
        Manoeuvre("dive", 45.0, 1.0, 2.0, 9.0),
        DESCENT,
        Manoeuvre("descent", 13.0, 1.0, 8.0),
        Manoeuvre("transition", 40.0, 1.0, 3.0, 5.0),
        landing(30.0, 8.0, 1.0, 1.0),
    ],
)
def test_it_speeds_up_downwards_by_no_more_than_its_force_lets_it(manoeuvre) -> None:
    """A descent that begins with 12 m/s^2 and feels its whole weight is that of no vehicle."""
    step, before = 0.02, manoeuvre.at(0.0)
    for number in range(1, 1000):
        now = manoeuvre.at(number * step)
        if now is None:
            break
        speeds_up = (before.vertical_speed - now.vertical_speed) / step
        carried = min(one.force * math.cos(one.roll) for one in (before, now))
        assert speeds_up <= GRAVITY - carried + 0.3 * GRAVITY, number * step
        before = now
    assert number > 10
