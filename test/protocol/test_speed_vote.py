"""Two origins stand against one: a barometer and another source outvote an estimate."""

import math
import random

from hypothesis import given
from hypothesis import strategies as st

from chute_ros.model import VehicleState
from chute_ros.protocol.speed_vote import SpeedVote
from chute_ros.protocol.vehicle_merge import ODOMETRY, VEHICLE_STATE, VehicleMerge

#: Pa at the ground, and less by so much each m up.
GROUND, EACH_M = 101_325.0, 12.0


def falling(t):
    """Vertical speed, m/s, and height, m, of what begins to fall at 2 s with 6 m/s^2 to 18 m/s."""
    passed = max(0.0, t - 2.0)
    speed = -min(18.0, 6.0 * passed)
    return speed, 80.0 - (3.0 * passed**2 if passed < 3.0 else 27.0 + 18.0 * (passed - 3.0))


def told(estimator, odometry, barometer=lambda t: falling(t)[1], until=6.0, seed=1):
    """The picture, and what is disputed, at the end: an autopilot at 10 Hz and an odometry at 30
    Hz beside it, with the noise of sensors. estimator, odometry: speed at t; barometer: height, m,
    or None where there is none."""
    noise = random.Random(seed)
    merge = VehicleMerge((VEHICLE_STATE, ODOMETRY), lost_after=2.5)
    for step in range(round(until * 30.0)):
        t = step / 30.0
        if step % 3 == 0:
            height = None if barometer is None else barometer(t)
            merge.hear_state(
                VehicleState(
                    vertical_speed=estimator(t) + noise.gauss(0.0, 0.1),
                    vertical_speed_age=0.0,
                    roll=0.0,
                    pitch=0.0,
                    yaw=0.0,
                    tilt=0.0,
                    attitude_age=0.0,
                    attitude_error=0.01,
                    attitude_error_age=0.0,
                    pressure=math.nan
                    if height is None
                    else GROUND - EACH_M * (height + noise.gauss(0.0, 0.15)),
                    pressure_age=math.nan if height is None else 0.0,
                ),
                t,
            )
        tilt = 1.2 if odometry(t) < -3.0 else 0.05
        parts = {"vertical_speed": (odometry(t) + noise.gauss(0.0, 0.1),)}
        merge.hear(ODOMETRY, {**parts, "attitude": (tilt, 0.0, 0.0, tilt)}, t)
    return merge.state(until), merge.disputed(until)


def falls(t):
    return falling(t)[0]


def hovers(_):
    return 0.0


def test_an_estimate_that_hovers_on_is_outvoted_by_barometer_and_odometry():
    state, disputed = told(estimator=hovers, odometry=falls)
    assert state.vertical_speed < -17.0
    assert state.tilt > 1.0, "the attitude is of the same estimate"
    assert math.isnan(state.attitude_error), "how far it is from its command, nobody else knows"
    assert "vertical_speed" not in disputed
    (why,) = (one for one in state.faults if "origins" in one)
    assert why.startswith("vehicle/state reports a vertical speed of ")
    assert "odometry -1" in why
    assert "the barometer -1" in why


def test_it_is_outvoted_within_two_seconds_of_the_fall():
    state, _ = told(estimator=hovers, odometry=falls, until=4.0)
    assert state.vertical_speed < -8.0


def test_an_odometry_that_falls_beside_a_barometer_that_does_not_is_outvoted():
    state, disputed = told(estimator=hovers, odometry=falls, barometer=lambda t: 80.0)
    assert abs(state.vertical_speed) < 0.5
    assert state.tilt < 0.1
    assert "vertical_speed" not in disputed, "the one that is right is in no doubt any more"
    assert any(one.startswith("odometry reports a vertical speed") for one in state.faults)


def test_without_a_barometer_nobody_knows_who_is_right():
    state, disputed = told(estimator=hovers, odometry=falls, barometer=None)
    assert abs(state.vertical_speed) < 0.5
    assert disputed == {"vertical_speed"}
    assert not any("origins" in one for one in state.faults)


def test_a_barometer_that_is_stuck_outvotes_nobody():
    merge = SpeedVote()
    for step in range(60):
        merge.hear_pressure(95_000.0, step / 10.0)
        merge.hear_speed("one", 0.0, step / 10.0)
        merge.hear_speed("other", -10.0, step / 10.0)
    assert merge.outvoted == {}


def test_one_that_is_right_again_counts_again_after_a_second():
    def errs(t):
        return 0.0 if t < 5.0 else falls(t)

    during, _ = told(estimator=errs, odometry=falls, until=5.5)
    assert any("origins" in one for one in during.faults)
    after, disputed = told(estimator=errs, odometry=falls, until=7.5)
    assert not any("origins" in one for one in after.faults)
    assert after.tilt == 0.0, "the first of the list counts"
    assert "vertical_speed" not in disputed, "both and the barometer tell the same"


def test_two_that_are_near_one_barometer_and_far_from_each_other_are_in_doubt():
    """Given -9 and -15 m/s beside a barometer that tells -12: none is outvoted."""
    _, disputed = told(estimator=lambda t: falls(t) + 3.0, odometry=lambda t: falls(t) - 3.0)
    assert "vertical_speed" in disputed


@given(st.integers(0, 10_000), st.floats(-2.0, 2.0))
def test_sources_that_are_right_outvote_nobody(seed, bias):
    """Whatever their noise, and one of them biased as receivers are."""
    state, _ = told(estimator=falls, odometry=lambda t: falls(t) + bias, seed=seed)
    assert not any("origins" in one for one in state.faults)
