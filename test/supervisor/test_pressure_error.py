"""Air that flows moves the pressure in a housing: by airspeed, and by propellers. Neither
ends a flight that goes well, nor hides a fall."""

import math

import pytest
from combinations import combinations
from test_one_estimator import EVERY, deployed
from test_two_origins import HIGH, fall, falling_flat, up

from chute_ros.supervisor.contradictions import GRAVITY

#: Error of the pressure as a part of the dynamic one: PX4's EKF2_PCOEF_* correct 0.5, ArduPilot's
#: BARO1_WCF_* 1.0.
ERRORS = (-0.5, -0.2, 0.0, 0.2, 0.5)


def too_low(error: float, airspeed: float) -> float:
    """By how much the barometer tells less than the height, m."""
    return error * airspeed**2 / (2.0 * GRAVITY)


@pytest.mark.parametrize(("error", "airspeed"), combinations(ERRORS, [16.0, 22.0, 25.0]))
def test_a_multirotor_that_leans_far_and_flies_level_is_not_ended(error, airspeed):
    """Given 63 degrees for a dash, and again to stop; as in ACRO nobody tells a target."""
    teller, fast = up("multirotor"), 0.0
    pushed = 0.6 * GRAVITY * math.tan(math.radians(63.0))  # the rest is for the drag
    for goal, tilt in ((airspeed, 63.0), (airspeed, 35.0), (0.0, 63.0), (0.0, 4.0)):
        for _ in range(20):
            step = max(-pushed * EVERY, min(pushed * EVERY, goal - fast))
            fast += step
            leans = tilt if step else min(tilt, 35.0)
            told = {"height": HIGH, "vertical_speed": teller.noise(0.2), "tilt": leans}
            force = GRAVITY / math.cos(math.radians(leans))
            teller.tell(**told, force=force, true_height=HIGH - too_low(error, fast))
    assert teller.story.fired() == []


@pytest.mark.parametrize("washed", [0.0, 3.0, 6.0, 9.0])
def test_a_barometer_that_leaves_the_wash_of_its_propellers_hides_no_tumble(washed):
    """Given a barometer that tells so much more, m, within 0.2 s of the failure of a motor."""
    teller, height, speed, begun = up("multirotor"), HIGH, 0.0, 0
    while not deployed(teller) and height > HIGH - 40.0:
        t = EVERY * begun
        tilt = abs(40.0 + 60.0 * math.sin(4.0 * t) + 30.0 * min(1.0, t))
        up_force = 0.6 * GRAVITY * math.cos(math.radians(tilt))
        drag = GRAVITY * (speed / 18.0) ** 2
        speed += EVERY * (up_force + drag - GRAVITY)
        height += EVERY * speed
        told = {"height": height, "vertical_speed": speed + teller.noise(0.2), "tilt": tilt}
        force = math.hypot(up_force + drag, 0.6 * GRAVITY * math.sin(math.radians(tilt)))
        truth = height + washed * min(1.0, t / 0.2)
        teller.tell(**told, force=force, true_height=truth)
        begun += 1
    assert deployed(teller)
    assert begun * EVERY <= 1.3


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize("fastest", [10.0, 12.0, 14.0])
def test_what_hovers_and_falls_flat_is_deployed_whichever_profile_it_flies_with(profile, fastest):
    """Given a quadplane whose lift stops; nobody tells what was commanded."""
    took = fall(up(profile), fastest, tilt=10.0)
    assert falling_flat(took, fastest)[0] < 2.2 * fastest


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("fastest", [12.0, 18.0, 25.0])
def test_what_lies_on_its_side_with_the_thrust_of_a_hover_is_deployed(error, fastest):
    """Given motors that push on with its weight, and an airspeed to the side as downwards."""
    teller, height, tilt = up("multirotor"), HIGH, 4.0
    aside = down = 0.0
    while not deployed(teller) and height > HIGH - 60.0:
        tilt = min(tilt + 15.0, 85.0)
        airspeed, leans = math.hypot(aside, down), math.radians(tilt)
        drag = GRAVITY * airspeed / fastest**2
        push = GRAVITY * math.sin(leans) - drag * aside
        lift = GRAVITY * math.cos(leans) - drag * down
        aside, down = aside + EVERY * push, down + EVERY * (lift - GRAVITY)
        height += EVERY * down
        told = {"height": height, "vertical_speed": down + teller.noise(0.2), "tilt": tilt}
        truth = height - too_low(error, airspeed)
        teller.tell(**told, force=math.hypot(push, lift), true_height=truth)
    assert deployed(teller)
    assert HIGH - height < (30.0 if error < -0.2 else 10.0)
