"""A vehicle that stands level, with a sensor that has noise as every real one has, claims nothing
that could be contradicted (PX4's simulator: no take-off was possible)."""

import math

import pytest

from chute_ros.supervisor.contradictions import NO_DROP, Rise, denials, noted
from chute_ros.supervisor.measurements import TILT

STILL = Rise(0.0, 1.9, 2.9)
NOISE = (0.07, -0.06, 0.02, -0.09, 0.05)


def standing(tilt: float) -> tuple[tuple[float, float, float, float], ...]:
    motion: tuple[tuple[float, float, float, float], ...] = ()
    for step in range(30):
        force = 9.81 + NOISE[step % len(NOISE)]
        moment = (0.1 * step, 0.0, force, math.cos(math.radians(tilt)))
        motion = noted(motion, moment)
    return motion


@pytest.mark.parametrize("tilt", [0.0, 10.0, 40.0])
def test_a_tilt_that_tells_of_no_fall_is_not_denied(tilt):
    assert denials(standing(tilt), STILL, NO_DROP, {}, False) == {}


@pytest.mark.parametrize("tilt", [50.0, 90.0, 170.0])
def test_a_tilt_of_a_vehicle_that_is_carried_in_full_is(tilt):
    assert set(denials(standing(tilt), STILL, NO_DROP, {}, False)) == {TILT}
