"""The flight model: heights, speeds and times that mean something."""

import math
import random
from statistics import fmean

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chute_ros.sim.flight import GRAVITY, Descent, FlightModel
from chute_ros.sim.gusts import GustyModel

STEP = 0.02


def fly(model, seconds):
    """The heights and the vertical speeds on the way."""
    way = []
    for _ in range(round(seconds / STEP)):
        model.step(STEP)
        way.append((model.height, model.vertical_speed))
    return zip(*way, strict=True)


def hovering(height):
    model = FlightModel(armed=True, target_height=height)
    fly(model, 20.0 + height / 5.0)
    return model


def test_it_stands_until_it_is_armed_and_told_to_climb():
    model = FlightModel(target_height=60.0)
    fly(model, 5.0)
    assert model.on_ground
    assert model.acceleration == pytest.approx(GRAVITY)
    model = FlightModel(armed=True)
    fly(model, 5.0)
    assert model.on_ground


def test_it_climbs_to_its_target_hovers_there_and_lands_softly_when_told_to():
    model = FlightModel(armed=True, target_height=60.0)
    heights, speeds = fly(model, 40.0)
    assert max(heights) < 60.5, "it does not swing"
    assert model.climb_speed * 0.8 < max(speeds) < model.climb_speed * 1.05
    assert model.height == pytest.approx(60.0, abs=0.5)
    assert model.vertical_speed == pytest.approx(0.0, abs=0.1)
    assert model.roll == 0.0
    assert model.acceleration == pytest.approx(GRAVITY, rel=0.02)
    model.target_height = 0.0
    _, speeds = fly(model, 60.0)
    assert model.on_ground
    assert min(speeds) > -2.5


def test_after_a_motor_failure_it_falls_and_tumbles_to_its_terminal_speed():
    model = hovering(500.0)
    model.motors_failed = True
    model.step(STEP)
    assert model.acceleration < 1.0, "a falling accelerometer feels next to nothing"
    fly(model, 1.0)
    assert model.vertical_speed < -8.0
    assert model.roll > 1.0
    fly(model, 10.0)
    assert model.vertical_speed == pytest.approx(-model.fall_speed, rel=0.02)
    assert model.height > 0.0


def test_the_canopy_opens_in_its_time_and_carries_at_its_speed():
    model = hovering(200.0)
    model.armed = False
    fly(model, 1.0)
    assert model.vertical_speed < -7.0
    model.release()
    assert model.canopy == 0.0
    fly(model, model.canopy_opening_time / 2)
    assert model.canopy == pytest.approx(0.5, abs=0.03)
    fly(model, 6.0)
    assert model.canopy == 1.0
    assert model.vertical_speed == pytest.approx(-model.canopy_speed, rel=0.02)
    assert model.roll == 0.0, "it hangs upright"
    model.release()
    assert model.canopy == 1.0, "a second release does not fold it again"


def test_it_touches_down_under_its_canopy_and_stays_there():
    model = hovering(60.0)
    model.armed = False
    model.release()
    fly(model, 30.0)
    assert model.on_ground
    heights, _ = fly(model, 5.0)
    assert {*heights} == {0.0}
    assert model.vertical_speed == 0.0
    assert model.acceleration == pytest.approx(GRAVITY)


def test_a_second_parachute_carries_where_the_first_one_has_not():
    model = hovering(400.0)
    model.armed, model.canopy_speed = False, 22.0
    model.release()
    fly(model, 6.0)
    assert model.vertical_speed == pytest.approx(-22.0, rel=0.02)
    model.release_another(5.0)
    fly(model, 6.0)
    assert model.vertical_speed == pytest.approx(-5.0, rel=0.02)


def test_with_part_of_its_thrust_it_sinks_upright_until_its_motors_are_stopped():
    model = hovering(200.0)
    model.descent = Descent("partial thrust", 8.0, settles=2.0, tilt=0.2)
    model.motors_failed = True
    model.step(STEP)
    assert 0.3 * GRAVITY < model.acceleration < 0.8 * GRAVITY, "most of it is still carried"
    fly(model, 10.0)
    assert model.vertical_speed == pytest.approx(-8.0, rel=0.02)
    assert model.roll == pytest.approx(0.2)
    assert model.acceleration == pytest.approx(GRAVITY, rel=0.05)
    model.armed = False
    fly(model, 2.0)
    assert model.vertical_speed < -12.0
    assert model.roll > 1.0


def test_an_aeroplane_that_nobody_holds_comes_down_in_its_own_way_until_a_canopy_opens():
    model = hovering(200.0)
    model.unheld = Descent("spiral dive", 16.0, settles=1.5, tilt=1.2, force=20.0)
    model.armed = False
    fly(model, 6.0)
    assert model.vertical_speed == pytest.approx(-16.0, rel=0.05)
    assert (model.roll, model.acceleration) == pytest.approx((1.2, 20.0), rel=0.05)
    model.release()
    fly(model, 6.0)
    assert model.vertical_speed == pytest.approx(-5.0, rel=0.02)
    assert model.roll == 0.0


@pytest.mark.parametrize("ground", [-30.0, 20.0])
def test_it_lands_where_the_ground_is(ground):
    model = hovering(40.0)
    model.ground, model.armed = ground, False
    assert model.clearance == pytest.approx(40.0 - ground, abs=0.5)
    model.release()
    fly(model, 30.0)
    assert model.on_ground
    assert model.height == ground


EVENTS = st.one_of(
    st.tuples(st.just("armed"), st.booleans()),
    st.tuples(st.just("motors_failed"), st.booleans()),
    st.tuples(st.just("target_height"), st.floats(-10.0, 500.0)),
    st.tuples(st.just("release"), st.none()),
)


@settings(max_examples=60, deadline=None)
@given(
    flight=st.lists(st.tuples(EVENTS, st.integers(0, 60)), max_size=12),
    dt=st.floats(0.0, 0.1),
)
def test_whatever_happens_it_is_never_below_the_ground_and_never_nowhere(flight, dt):
    model = FlightModel()
    for (name, value), steps in flight:
        if name == "release":
            model.release()
        else:
            setattr(model, name, value)
        for _ in range(steps):
            model.step(dt)
            numbers = (model.height, model.vertical_speed, model.roll, model.acceleration)
            assert all(map(math.isfinite, numbers))
            assert model.height >= 0.0
            assert abs(model.vertical_speed) < 60.0
            assert 0.0 <= model.canopy <= 1.0
            assert abs(model.roll) <= math.pi


@pytest.mark.parametrize("failed", [False, True])
def test_in_gusts_it_feels_what_moves_it(failed):
    """As a body does: the specific force is what it speeds up with, and its weight."""
    way = Descent("glide", 4.0)
    model = GustyModel(gusts=2.0, chance=random.Random(3), armed=True, descent=way)
    model.height = model.target_height = 300.0
    model.motors_failed, moved = failed, 0.0
    for _ in range(500):
        before = model.vertical_speed
        model.step(STEP)
        speeds_up = (model.vertical_speed - before) / STEP
        assert model.acceleration == pytest.approx(abs(GRAVITY + speeds_up))
        moved = max(moved, abs(speeds_up))
    assert moved > 1.0, "the gusts are felt"


@pytest.mark.parametrize("settles", [0.5, 1.5, 3.0])
def test_gusts_carry_along_what_comes_down_no_faster_than_they_are_strong(settles):
    """However slowly it settles: 2 m/s^2 are gusts of some 2 m/s."""
    way = Descent("glide", 4.0, settles=settles)
    model = GustyModel(gusts=2.0, chance=random.Random(7), armed=True, descent=way)
    model.height, model.motors_failed, off = 1000.0, True, []
    for _ in range(6000):
        model.step(STEP)
        off.append(model.vertical_speed + 4.0)
    assert math.sqrt(fmean(one**2 for one in off[300:])) < 2.0
