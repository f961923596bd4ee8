"""An estimator flies on its accelerometer; the barometer is of neither. Two that are independent
stand against an estimator that hovers on; an accelerometer speaks for no sink of its estimator."""

import math
from typing import Any

import pytest
from combinations import combinations
from hypothesis import given, settings
from hypothesis import strategies as st
from story import DOWN
from test_one_estimator import AIRCRAFT, EVERY, Teller, deployed, hovering, told_to

from chute_ros.supervisor.contradictions import (
    FREE_FALL,
    GRAVITY,
    felt_drop,
    felt_fall,
    height_denied,
)

HIGH = 150.0


def falling_flat(t: float, fastest: float) -> tuple[float, float, float]:
    """Height lost, m, vertical speed, m/s, and force, m/s^2, after t s; at last fastest, m/s."""
    speed = fastest * math.tanh(GRAVITY * t / fastest)
    lost = fastest**2 / GRAVITY * math.log(math.cosh(GRAVITY * t / fastest))
    return lost, -speed, GRAVITY * (speed / fastest) ** 2


def up(profile: str) -> Teller:
    """It hovers at HIGH."""
    return hovering(profile, HIGH, 4.0)


def fall(teller: Teller, fastest: float, **wrong: Any) -> float:
    """It falls flat, and tells what is wrong so; how long it took to the deploy, s, or NaN."""
    begun = teller.story.t
    for k in range(60):
        lost, speed, force = falling_flat(EVERY * k, fastest)
        parts = {"height": HIGH - lost, "vertical_speed": speed, "tilt": 3.0, "force": force}
        noisy = {"vertical_speed": wrong.get("vertical_speed", speed) + teller.noise(0.2)}
        teller.tell(**{**parts, "true_height": HIGH - lost, **wrong, **noisy})
        if deployed(teller):
            return teller.story.t - begun
    return math.nan


@AIRCRAFT
@pytest.mark.parametrize("fastest", [14.0, 20.0, 35.0, 60.0])
@pytest.mark.parametrize("target", [True, False])
def test_an_estimator_that_hovers_on_hides_no_fall_from_force_and_barometer(
    profile, fastest, target
):
    hovers: dict[str, Any] = {"height": HIGH, "vertical_speed": 0.0}
    if target:
        hovers |= {"target_vertical_speed": 0.0, "attitude_error": 1.0}
    took = fall(up(profile), fastest, **hovers)
    assert took <= (2.1 if profile == "multirotor" else 2.7)


@AIRCRAFT
@pytest.mark.parametrize("climbs", [0.0, 2.5])
def test_an_accelerometer_that_is_shaken_and_draws_its_estimator_along_ends_no_flight(
    profile, climbs
):
    """ArduCopter, three recorded flights (122_erle_althold_error.BIN at 29.4 s): 3 to 5 m/s^2 for
    seconds, by which the estimator sank faster and faster, as the vehicle climbed."""
    teller, speed = up(profile), 0.0
    for k in range(30):
        speed = max(speed - 0.55, -9.0)
        parts = {"height": HIGH + 0.5 * EVERY * speed * k, "tilt": 4.0, "vertical_speed": speed}
        force = 4.2 + teller.noise(2.5)
        teller.tell(**parts, force=force, true_height=HIGH + climbs * EVERY * k)
    assert teller.story.fired() == []


def turning(
    teller: Teller, sink: float, force: float, runs_away: float = 0.0, **told: Any
) -> float:
    """For 6 s it sinks so fast, m/s, carried by this force, m/s^2. The speed that is told starts
    from 0, and runs away by so much, m/s^2; how long it took to the deploy, s, or NaN."""
    begun = teller.story.t
    for k in range(60):
        lost, speed = sink * EVERY * k, runs_away * EVERY * k
        parts = {"height": HIGH, "vertical_speed": speed + teller.noise(0.2), "tilt": 3.0, **told}
        teller.tell(**parts, force=force + teller.noise(0.3), true_height=HIGH - lost)
        if deployed(teller):
            return teller.story.t - begun
    return math.nan


@pytest.mark.parametrize(
    ("feels", "sink", "estimates"),
    combinations(
        [(13.0, 3.0), (24.0, 3.0), (13.0, 65.0)],
        [9.0, 16.0],
        [(0.0, True), (0.0, False), (1.0, False), (-6.0, False)],
    ),
)
def test_a_spin_that_its_estimator_does_not_tell_is_told_by_force_and_barometer(
    feels, sink, estimates
):
    """Upright it would be carried by its weight, and at 65 degrees by more than twice that."""
    (force, tilt), (runs_away, target) = feels, estimates
    told = {"target_vertical_speed": 0.0, "attitude_error": 1.0} if target else {}
    took = turning(up("fixed_wing"), sink, force, runs_away, **told, tilt=tilt)
    # One that runs away downwards is right for a moment.
    assert took <= (3.0 if runs_away >= 0.0 else 4.5)


def test_nor_does_a_jump_of_its_speed_hide_a_spin():
    """It told the sink, and from one word to the next it hovers: what jumps is in doubt."""
    teller = up("fixed_wing")
    for k in range(20):
        speed = max(-9.5, -0.6 * k)
        sinks = {"vertical_speed": speed + teller.noise(0.2), "height": HIGH - 0.5 * k}
        teller.tell(**sinks, tilt=72.0, force=10.0, true_height=HIGH - 0.5 * k)
    assert not deployed(teller)
    assert turning(teller, 12.0, 13.0, tilt=72.0) <= 3.0


@pytest.mark.parametrize(
    ("sink", "force", "told"),
    [
        # A steep turn that is flown downwards, and told; and one that is level.
        (12.0, 16.0, {"vertical_speed": -12.0, "tilt": 55.0}),
        (0.0, 19.6, {"vertical_speed": 0.0, "tilt": 60.0}),
        # An estimator that hovers on in a descent, in which nothing turns.
        (5.0, 9.8, {}),
        # A barometer that is wrong in a level turn of 45 degrees.
        (9.0, 13.9, {"tilt": 45.0}),
        # A barometer that is wrong by gusts, and an accelerometer that is shaken.
        (4.0, 15.0, {}),
    ],
)
def test_what_turns_on_purpose_and_what_only_one_origin_tells_ends_no_flight(sink, force, told):
    assert math.isnan(turning(up("fixed_wing"), sink, force, **told))


def test_a_height_that_the_barometer_denies_is_told_in_flight():
    """Given a barometer that is clogged before the take-off."""
    teller = told_to("multirotor")
    teller.stand(1.0, true_height=0.0)
    for k in range(200):
        height, speed = min(HIGH, 0.8 * k), 8.0 if 0.8 * k < HIGH else teller.noise(0.2)
        teller.tell(height=height, vertical_speed=speed, tilt=3.0, force=9.8, true_height=0.0)
    told = [one for one in teller.story.alarms() if one.startswith("height is contradicted")]
    assert len(told) == 1
    assert "above the take-off where it reports" in told[0]


def test_heights_that_differ_as_weather_and_warmth_make_them_are_not():
    assert height_denied(120.0, 90.0) == ""
    assert height_denied(3.0, 20.0) == ""
    assert height_denied(math.nan, 90.0) == height_denied(90.0, math.nan) == ""
    assert height_denied(80.0, 0.3) == (
        "the barometer reports 0 m above the take-off where it reports 80"
    )


@settings(max_examples=25)
@given(st.lists(st.floats(-8.0, 8.0), min_size=3, max_size=6))
def test_whatever_an_estimator_tells_on_the_ground_nothing_is_released(pushes):
    teller, height, speed = told_to("multirotor"), 0.0, 0.0
    teller.stand(1.0, true_height=0.0)
    flies = {key: value for key, value in DOWN.items() if key not in ("landed_state", "armed")}
    for push in pushes:
        for _ in range(15):
            speed += EVERY * push
            height += EVERY * speed
            told = {"height": height, "vertical_speed": speed, "tilt": 3.0, "force": 9.8}
            teller.tell(**flies, **told, true_height=0.0)
    assert not deployed(teller)


#: A second of free fall, of which the estimator tells nothing.
MOMENTS = [(0.1 * k, 0.0, 0.05 * (k % 2), 1.0) for k in range(11)]


def test_a_fall_is_felt_as_long_as_its_force_is_less_than_half_of_the_weight():
    assert felt_fall(tuple(MOMENTS)) == pytest.approx(-GRAVITY, abs=0.1)
    assert felt_fall(tuple((t, v, FREE_FALL, c) for t, v, _, c in MOMENTS)) == 0.0


@pytest.mark.parametrize(
    ("told", "felt"), [(math.nan, -GRAVITY), (-0.4, -GRAVITY), (-0.6, 0.0), (-0.98, 0.0)]
)
def test_a_fall_that_the_estimator_tells_is_none_that_it_hides(told, felt):
    """Each 0.1 s it tells so much more, m/s. A drop that is flown, and caught, has been told."""
    fell = tuple((t, told * k, f, c) for k, (t, _, f, c) in enumerate(MOMENTS))
    assert felt_fall(fell) == pytest.approx(felt, abs=0.1)
    caught = tuple((1.1 + 0.1 * k, told * (10 - k), 2.0 * GRAVITY, 1.0) for k in range(10))
    assert felt_fall((*fell, *caught)) == pytest.approx(felt, abs=0.1)


def test_a_drop_is_felt_whether_it_was_told_as_well_or_not():
    for told in (0.0, -0.98):
        fell = tuple((t, told * k, f, c) for k, (t, _, f, c) in enumerate(MOMENTS))
        assert felt_drop(fell) == pytest.approx(-GRAVITY, abs=0.1)
    assert felt_drop(tuple((t, v, FREE_FALL, c) for t, v, _, c in MOMENTS)) == 0.0
    # What nobody felt in a gap its speed tells, if it is told.
    fell = tuple((t, -0.98 * k, f, c) for k, (t, _, f, c) in enumerate(MOMENTS))
    gap = (*fell[:5], *fell[9:])
    assert felt_drop(gap) == pytest.approx(-GRAVITY, abs=0.2)
    assert felt_drop((*MOMENTS[:5], *MOMENTS[9:])) > -7.0, "which hovers on"
    # What the force around a gap explains is no fall: a descent that is begun with 1.5 m/s^2.
    begun = tuple((0.4 * k, -0.6 * k, GRAVITY - 1.5, 1.0) for k in range(8))
    assert felt_drop(begun) == pytest.approx(0.0, abs=0.1)
    assert math.isnan(felt_drop(tuple((t, math.nan, f, c) for t, _, f, c in gap)))
    assert felt_drop(()) == 0.0


def test_what_is_stuck_or_was_not_told_feels_nothing():
    assert felt_fall(tuple((t, v, 0.0, c) for t, v, _, c in MOMENTS)) == 0.0
    assert felt_fall(tuple((t, v, math.nan, c) for t, v, _, c in MOMENTS)) == 0.0
    # One word in ten: nobody knows what was felt meanwhile.
    assert felt_fall(tuple((10.0 * t, v, f, c) for t, v, f, c in MOMENTS)) == 0.0
    assert felt_fall(()) == 0.0
