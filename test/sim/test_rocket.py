"""The rocket's flight by itself: heights, speeds, air."""

import math

import pytest

from chute_ros.sim.air import air_at
from chute_ros.sim.rocket import GRAVITY, Rocket


def fly_until(rocket, condition, dt=0.02, longest=1000.0):
    """Step until condition; the time that it took, s."""
    for n in range(round(longest / dt)):
        if condition():
            return n * dt
        rocket.step(dt)
    raise AssertionError(f"not within {longest} s: {rocket}")


def flown_to_apogee():
    rocket = Rocket()
    rocket.ignite()
    rocket.step(0.02)
    fly_until(rocket, lambda: rocket.vertical_speed < 0.0)
    return rocket


@pytest.mark.parametrize(
    ("altitude", "temperature", "pressure", "density"),
    [
        (0.0, 288.15, 101325.0, 1.225),
        (1000.0, 281.65, 89874.6, 1.1116),
        (3000.0, 268.65, 70108.5, 0.9091),
        (5000.0, 255.65, 54019.9, 0.7361),
    ],
)
def test_the_air_is_that_of_the_standard_atmosphere(altitude, temperature, pressure, density):
    air = air_at(altitude)
    assert air.temperature == pytest.approx(temperature)
    assert air.pressure == pytest.approx(pressure, rel=1e-4)
    assert air.density == pytest.approx(density, rel=1e-3)


def test_unlit_it_stands():
    rocket = Rocket()
    rocket.step(10.0)
    assert (rocket.height, rocket.vertical_speed, rocket.specific_force) == (0.0, 0.0, GRAVITY)
    assert (rocket.north, rocket.east) == (0.0, 0.0)
    assert not rocket.burning


def test_it_burns_for_its_burn_time_and_is_lighter_then():
    rocket = Rocket()
    rocket.ignite()
    assert rocket.mass == 45.0
    rocket.step(5.9)
    assert rocket.burning
    assert rocket.specific_force > 3.0 * GRAVITY
    rocket.step(0.2)
    assert not rocket.burning
    assert rocket.mass == 36.0
    assert rocket.specific_force < 0.0, "only the drag is left, downwards"
    assert 200.0 < rocket.vertical_speed < 300.0


def test_its_apogee_is_about_3000_m_after_half_a_minute():
    rocket = Rocket()
    rocket.ignite()
    rocket.step(0.02)
    assert 20.0 < fly_until(rocket, lambda: rocket.vertical_speed < 0.0) < 30.0
    assert rocket.height == pytest.approx(3000.0, abs=50.0)
    assert rocket.apogee == pytest.approx(rocket.height, abs=1.0)


def test_it_sinks_under_the_drogue_and_slower_under_the_main():
    rocket = flown_to_apogee()
    rocket.release_drogue()
    rocket.step(10.0)
    while rocket.height > 610.0:
        assert 25.0 < -rocket.vertical_speed < 30.0
        rocket.step(1.0)
    rocket.release_main()
    rocket.step(6.0)
    while rocket.height > 10.0:
        assert 6.0 < -rocket.vertical_speed < 7.0
        assert rocket.specific_force == pytest.approx(GRAVITY, abs=0.2)
        rocket.step(1.0)
    fly_until(rocket, lambda: rocket.on_ground)
    assert (rocket.height, rocket.vertical_speed) == (0.0, 0.0)


def test_without_a_canopy_it_comes_down_fast():
    rocket = flown_to_apogee()
    fly_until(rocket, lambda: rocket.height < 100.0)
    assert rocket.vertical_speed < -150.0


@pytest.mark.parametrize("dt", [0.02, 0.1, 1.0])
def test_a_canopy_that_opens_at_a_high_speed_brakes_but_does_not_throw_it_back(dt):
    rocket = Rocket(height=2000.0, vertical_speed=-250.0, burned_for=math.inf)
    rocket.release_main()
    for _ in range(round(5.0 / dt)):
        rocket.step(dt)
        assert rocket.vertical_speed < 0.0
    assert rocket.vertical_speed > -10.0


def test_a_canopy_needs_its_time_to_open():
    rocket = Rocket(height=2000.0, vertical_speed=-100.0, burned_for=math.inf)
    rocket.release_drogue()
    rocket.step(0.1)
    assert rocket.vertical_speed < -80.0
    rocket.step(3.0)
    assert rocket.vertical_speed > -35.0


def test_the_wind_carries_it_only_while_it_flies():
    rocket = flown_to_apogee()
    assert rocket.north == pytest.approx(26.0, abs=2.0)
    assert rocket.east == pytest.approx(3.0 * rocket.north, rel=0.01)
    assert rocket.latitude == pytest.approx(42.4419 + rocket.north / 111_320.0)
    assert rocket.longitude > -76.4878
    rocket.land()
    place = (rocket.north, rocket.east)
    rocket.step(10.0)
    assert (rocket.north, rocket.east) == place
    assert (rocket.height, rocket.specific_force) == (0.0, GRAVITY)


def test_a_spent_motor_is_not_lit_again():
    rocket = flown_to_apogee()
    rocket.land()
    rocket.ignite()
    rocket.step(1.0)
    assert rocket.on_ground


def test_how_long_a_step_is_hardly_matters():
    heights = []
    for dt in (0.01, 0.05, 1.0):
        rocket = Rocket()
        rocket.ignite()
        for _ in range(round(10.0 / dt)):
            rocket.step(dt)
        heights.append(rocket.height)
    assert max(heights) - min(heights) < 20.0


def test_a_site_above_the_sea_has_thinner_air():
    rocket = Rocket(site_altitude=1400.0)
    assert rocket.altitude == 1400.0
    assert rocket.air == air_at(1400.0)
