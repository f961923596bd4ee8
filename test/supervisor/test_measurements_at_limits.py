"""Measurements at their very limits, and what is said of them in full."""

import dataclasses
import math

import pytest

from chute_ros.errors import ParameterError
from chute_ros.model import NAN, VehicleState
from chute_ros.supervisor.measured import Measured, Sample
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits
from chute_ros.supervisor.samples import distance_between, on_earth, samples_of

#: A speed: it may change by 200 m/s each s and 5 m/s besides, is old after 1 s, stuck after 5 s.
LIMITS = STANDARD_LIMITS["vertical_speed"]


def after(*samples: tuple[float, float], limits: Limits = LIMITS) -> Measured:
    """What is known after these (value, time of measurement)."""
    known = Measured()
    for value, at in samples:
        known = known.with_sample(Sample(value, at), limits)
    return known


def test_limits_may_reach_their_ends() -> None:
    strict = Limits(0.0, 1.0, rate=0.0, jump=0.0, max_age=0.001, stuck_after=0.0)
    assert dataclasses.replace(strict, max_age=60.0).max_age == 60.0


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("minimum", 400.0, "range 400.0 to 400.0: need a larger second"),
        ("rate", math.inf, "rate is inf: need 0 or more"),
        ("jump", -0.5, "jump is -0.5: need 0 or more"),
        ("stuck_after", -0.5, "stuck_after is -0.5: need 0 or more"),
        ("max_age", 60.5, "max_age is 60.5: need above 0, up to 60 s"),
    ],
)
def test_limits_past_their_ends_are_told_in_full(name: str, wrong: float, words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        dataclasses.replace(LIMITS, **{name: wrong})
    assert str(caught.value) == words


@pytest.mark.parametrize("tilt", [0.0, 180.0])
def test_a_vehicle_may_stand_upright_and_lie_on_its_back(tilt: float) -> None:
    limits = STANDARD_LIMITS["tilt_deg"]
    assert after((tilt, 10.0), limits=limits).usable(limits, 10.0) == tilt


def test_what_is_measured_may_lie_ahead_by_the_jitter_and_no_more() -> None:
    known = after((1.0, 0.1))
    assert known.usable(LIMITS, 0.0) == 1.0
    assert known.unusable(LIMITS, -0.4) == "its time lies 0.50 s in the future"


def test_what_changes_as_much_as_it_may_is_used() -> None:
    assert after((0.0, 0.0), (105.0, 0.5)).usable(LIMITS, 0.5) == 105.0


def test_a_jump_is_told_by_its_height() -> None:
    known = after((2.0, 10.0), (32.0, 10.05))
    assert known.unusable(LIMITS, 10.05) == "jumped by +30 in 0.050 s"


def test_a_jump_after_as_long_as_a_sample_counts_is_still_a_jump() -> None:
    known = after((0.0, 10.0), (300.0, 11.0))
    assert known.unusable(LIMITS, 11.0) == "jumped by +300 in 1.000 s"


def test_one_that_comes_late_by_the_jitter_was_overtaken() -> None:
    known = after((1.0, 0.1))
    assert known.with_sample(Sample(1.5, 0.0), LIMITS) == known


def test_the_same_value_told_again_a_little_later_is_the_same_sample() -> None:
    known = after((1.0, 10.0))
    assert known.with_sample(Sample(1.0, 10.09), LIMITS) == known
    assert known.with_sample(Sample(1.0, 10.11), LIMITS).count == 2
    assert known.with_sample(Sample(1.1, 10.006), LIMITS).count == 2


def test_two_values_are_two_samples_from_5_ms_on() -> None:
    assert after((1.0, 0.0), (1.1, 0.005)).count == 2


def test_a_bad_sample_leaves_what_was_known_and_forgets_what_jumped() -> None:
    same = [(-3.0, 10.0 + n * 0.5) for n in range(11)]
    known = after(*same, (90.0, 15.05), (NAN, 15.07))
    assert known.unusable(LIMITS, 15.1) == "nan is not a number"
    assert (known.value, known.measured_at, known.count) == (-3.0, 15.0, 11)
    again = known.with_sample(Sample(90.0, 15.09), LIMITS)
    assert again.unusable(LIMITS, 15.1) == "jumped by +93 in 0.090 s"
    stuck = known.with_sample(Sample(-3.0, 15.5), LIMITS)
    assert stuck.unusable(LIMITS, 15.5) == "stuck at -3 for 5.5 s (limit 5 s)"


def test_of_two_jumps_that_contradict_each_other_the_second_is_a_first() -> None:
    wild = [(0.0, 10.0), (300.0, 10.05), (-300.0, 10.1), (-301.0, 10.15)]
    assert "jumped" in after(*wild).unusable(LIMITS, 10.15)
    assert after(*wild, (-302.0, 10.2)).usable(LIMITS, 10.2) == -302.0


@pytest.mark.parametrize("never", [math.inf, -math.inf, NAN])
def test_what_was_measured_at_no_time_is_no_sample(never: float) -> None:
    known = after((1.0, 10.0))
    for _ in range(3):
        assert known.with_sample(Sample(1.5, never), LIMITS) == known
    nothing = after((1.0, never), (1.1, never))
    assert (nothing.unusable(LIMITS, 10.0), nothing.count) == ("never received", 0)


def test_what_may_be_stuck_for_less_than_a_second_is_stuck_so_soon() -> None:
    limits = dataclasses.replace(LIMITS, stuck_after=0.5)
    known = after((2.0, 10.0), (2.0, 10.25), (2.0, 10.5), limits=limits)
    assert known.unusable(limits, 10.5) == "stuck at 2 for 0.5 s (limit 0.5 s)"


def test_a_vehicle_that_does_not_tell_its_place_has_no_distance_from_its_take_off() -> None:
    sample = samples_of(VehicleState(position_age=0.5), 100.0, (48.0, 11.0))["distance_from_home"]
    assert math.isnan(sample.value)
    assert sample.measured_at == 99.5


def test_far_from_the_equator_a_degree_of_longitude_is_shorter() -> None:
    assert distance_between((60.0, 0.0), (60.0, 1.0)) == pytest.approx(55_597.0, abs=1.0)
    assert distance_between((60.0, 0.0), (30.0, 90.0)) == pytest.approx(7_153_000.0, rel=1e-3)


def test_a_place_may_lie_at_a_pole_and_be_counted_once_around() -> None:
    for place in ((90.0, 0.0), (-90.0, 360.0), (0.0, -360.0)):
        assert on_earth(*place)
    for nowhere in ((90.5, 0.0), (-90.5, 0.0), (0.0, 360.5), (0.0, -360.5)):
        assert not on_earth(*nowhere)


# -- jumps ---------------------------------------------------------------------------------------

#: A height that may change by 60 m/s and by 10 m besides.
HEIGHT = Limits(-500.0, 500.0, rate=60.0, jump=10.0, max_age=1.0, stuck_after=5.0)


def heights(*samples: tuple[float, float]) -> Measured:
    return after(*samples, limits=HEIGHT)


def test_a_jump_that_is_confirmed_is_remembered_with_what_was_before() -> None:
    known = heights((100.0, 0.0), (60.0, 0.1), (60.1, 0.15), (60.2, 0.2))
    assert (known.jumped_at, known.before_jump, known.doubted_at) == (0.2, 100.0, 0.15)


def test_so_is_one_that_time_made_possible_meanwhile() -> None:
    known = heights((100.0, 0.0), (70.0, 0.1), (70.1, 0.2), (70.2, 0.4))
    assert known.rejected == ""
    assert (known.jumped_at, known.before_jump) == (0.4, 100.0)


@pytest.mark.parametrize("then", [99.9, 85.0])
def test_one_that_goes_back_or_half_way_has_not_jumped(then: float) -> None:
    known = heights((100.0, 0.0), (70.0, 0.1), (then, 0.2))
    assert known.value == then
    assert math.isnan(known.jumped_at)
    assert known.doubted_at == 0.1


@pytest.mark.parametrize(("back_to", "over"), [(90.0, True), (89.9, False)])
def test_a_jump_back_ends_the_doubt(back_to: float, over: bool) -> None:
    down = [(100.0, 0.0), (60.0, 0.1), (60.1, 0.15), (60.2, 0.2)]
    known = heights(*down, (back_to + 0.2, 0.3), (back_to + 0.1, 0.35), (back_to, 0.4))
    assert known.value == back_to
    assert math.isnan(known.jumped_at) is over
    assert math.isnan(known.before_jump) is over


def test_after_one_out_of_range_it_is_doubted_for_a_second_but_not_after_none() -> None:
    known = heights((100.0, 0.0), (9999.0, 0.1), (100.1, 0.2))
    assert known.doubted_at == 0.1
    assert "another was not taken" in known.doubt("height", 0.3)
    assert math.isnan(heights((100.0, 0.0), (math.nan, 0.1), (100.1, 0.2)).doubted_at)


def test_what_cannot_be_at_all_forgets_what_was_doubted() -> None:
    known = heights((100.0, 0.0), (60.0, 0.1), (9999.0, 0.15))
    assert known.candidates == 0
    again = known.with_sample(Sample(60.0, 0.16), HEIGHT)
    assert (again.candidates, again.candidate_at) == (1, 0.16)
