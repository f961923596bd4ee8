"""Each measurement is evidence: it has an age, and what cannot be is not used, with the reason."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import START, Story, vehicle

from chute_ros.errors import ParameterError
from chute_ros.model import NAN, VehicleState
from chute_ros.supervisor.measured import Measured, Sample
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits
from chute_ros.supervisor.samples import distance_between, on_earth, samples_of

#: A speed: it may change by 200 m/s each s and 5 m/s besides, is old after 1 s, stuck after 5 s.
LIMITS = STANDARD_LIMITS["vertical_speed"]
SAME = [(-3.0, 10.0 + n * 0.5) for n in range(11)]


def after(*samples: tuple[float, float], limits: Limits = LIMITS) -> Measured:
    """What is known after these (value, time of measurement)."""
    known = Measured()
    for value, at in samples:
        known = known.with_sample(Sample(value, at), limits)
    return known


# -- what is used --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("samples", "now", "used"),
    [
        # It is young enough up to its limit.
        ([(-3.0, 10.0)], 11.0, -3.0),
        # It changes as much as it may.
        ([(0.0, 10.0), (14.9, 10.05)], 10.05, 14.9),
        ([(0.0, 0.0), (105.0, 0.5)], 0.5, 105.0),
        # Back where it was: the jump was one bad sample.
        ([(0.0, 10.0), (30.0, 10.05), (0.1, 10.1)], 10.1, 0.1),
        # The next samples confirm a jump, the second of two that contradict each other as well.
        ([(0.0, 10.0), (40.0, 10.05), (40.1, 10.1), (40.2, 10.15)], 10.15, 40.2),
        (
            [(0.0, 10.0), (300.0, 10.05), (-300.0, 10.1), (-301.0, 10.15), (-302.0, 10.2)],
            10.2,
            -302.0,
        ),
        # After a silence nobody knows what lay between.
        ([(0.0, 10.0), (90.0, 11.01)], 11.01, 90.0),
        # A clock that was set back is believed once samples agree.
        ([(1.0, 10.0), (2.0, 9.0), (2.1, 9.1), (2.2, 9.2)], 9.2, 2.2),
        ([(1.0, 1e9), (2.0, 10.0), (2.1, 10.1), (2.2, 10.2)], 10.2, 2.2),
        # It may lie ahead by the jitter.
        ([(1.0, 0.1)], 0.0, 1.0),
        ([(1.0, 1e9)], 1e9 - 0.05, 1.0),
        # Not yet stuck, and no longer.
        (SAME[:10], 14.5, -3.0),
        ([*SAME, (-3.0000001, 15.5)], 15.5, -3.0000001),
    ],
)
def test_a_sample_that_can_be_is_used(samples, now, used):
    known = after(*samples)
    assert known.unusable(LIMITS, now) == ""
    assert known.usable(LIMITS, now) == used


@pytest.mark.parametrize(
    ("samples", "now", "words"),
    [
        ([], START, "never received"),
        ([(3.0, NAN)], START, "never received"),
        ([(-3.0, 10.0)], 11.01, "old: 1.01 s (limit 1 s)"),
        # The reason stays when what was known has grown old.
        ([(1.0, 9.0), (math.nan, 10.0)], 10.9, "reported without a value"),
        ([(2.0, 10.0), (32.0, 10.05)], 10.05, "jumped by +30 in 0.050 s"),
        ([(0.0, 10.0), (15.1, 10.05)], 10.05, "jumped by +15.1 in 0.050 s"),
        ([(0.0, 10.0), (40.0, 10.05), (40.1, 10.1)], 10.1, "jumped by +40.1 in 0.100 s"),
        # After as long as a sample counts it is still a jump.
        ([(0.0, 10.0), (300.0, 11.0)], 11.0, "jumped by +300 in 1.000 s"),
        (
            [(0.0, 10.0), (300.0, 10.05), (-300.0, 10.1), (-301.0, 10.15)],
            10.15,
            "jumped by -301 in 0.150 s",
        ),
        ([(1.0, 10.0), (2.0, 9.5)], 10.1, "time ran backwards by 0.50 s"),
        ([(1.0, 0.1)], -0.4, "its time lies 0.50 s in the future"),
        (SAME, 15.0, "stuck at -3 for 5.0 s (limit 5 s)"),
        ([*SAME, (-3.0, 15.5)], 15.5, "stuck at -3 for 5.5 s (limit 5 s)"),
    ],
)
def test_a_sample_that_cannot_be_is_not_used_and_says_why(samples, now, words):
    known = after(*samples)
    assert known.unusable(LIMITS, now) == words
    assert math.isnan(known.usable(LIMITS, now))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (math.nan, "reported without a value"),
        (math.inf, "inf is not a number"),
        (-math.inf, "-inf is not a number"),
        (400.1, "400.1 is out of -400 to 400"),
        (-401.0, "-401 is out of -400 to 400"),
    ],
)
def test_what_was_known_is_not_overwritten_by_what_cannot_be(value, words):
    assert after((value, 10.0)).unusable(LIMITS, 10.0) == words
    known = after((1.0, 9.9), (value, 10.0))
    assert known.unusable(LIMITS, 10.0) == words
    assert known.value == 1.0
    assert known.with_sample(Sample(1.1, 10.1), LIMITS).unusable(LIMITS, 10.1) == ""


def test_its_age_counts_from_the_measurement_not_from_its_receipt():
    story = Story()
    story.at(0.0, vehicle(age=0.9, vertical_speed=-3.0))
    measured = story.state.measured("vertical_speed")
    assert measured.unusable(LIMITS, START + 0.1) == ""
    assert measured.unusable(LIMITS, START + 0.2) == "old: 1.10 s (limit 1 s)"


def test_samples_that_jump_about_confirm_each_other_not():
    wild = [(-300.0 if n % 2 else 300.0, 10.05 + n * 0.05) for n in range(10)]
    known = after((0.0, 10.0), *wild)
    assert known.unusable(LIMITS, 10.5)
    assert known.value == 0.0


def test_a_bad_sample_leaves_what_was_known_and_forgets_what_jumped():
    known = after((0.0, 10.0), (300.0, 10.05), (301.0, 10.1), (NAN, 10.15), (302.0, 10.2))
    assert "jumped" in known.unusable(LIMITS, 10.2)
    assert known.candidates == 1, "the confirmation begins anew"
    known = after(*SAME, (90.0, 15.05), (NAN, 15.07))
    assert known.unusable(LIMITS, 15.1) == "reported without a value"
    assert (known.value, known.measured_at, known.count) == (-3.0, 15.0, 11)
    again = known.with_sample(Sample(90.0, 15.09), LIMITS)
    assert again.unusable(LIMITS, 15.1) == "jumped by +93 in 0.090 s"


def test_a_sample_that_was_overtaken_or_is_told_again_or_has_no_time_changes_nothing():
    for known, value, at in (
        (after((1.0, 10.0)), 1.1, 9.95),
        # Late by the jitter.
        (after((1.0, 0.1)), 1.5, 0.0),
        (after((1.0, 10.0)), 1.0, 10.001),
        (after((1.0, 10.0)), 1.0, 10.09),
        (after((1.0, 10.0), (40.0, 10.1)), 40.0, 10.101),
        (after((1.0, 10.0)), 1.5, NAN),
        (after((1.0, 10.0)), 1.5, math.inf),
        (after((1.0, 10.0)), 1.5, -math.inf),
        (Measured(), 3.0, NAN),
        (Measured(), 3.0, math.inf),
    ):
        for _ in range(3):
            assert known.with_sample(Sample(value, at), LIMITS) == known, (value, at)


@pytest.mark.parametrize(
    ("samples", "count"),
    [
        ([(1.0, 10.0), (1.1, 10.1), (1.2, 10.2)], 3),
        ([(1.0, 10.0), (1.0, 10.11)], 2),
        ([(1.0, 10.0), (1.1, 10.006)], 2),
        # Two values are two samples from 5 ms on.
        ([(1.0, 0.0), (1.1, 0.005)], 2),
        ([(1.0, NAN), (1.1, NAN)], 0),
    ],
)
def test_each_sample_counts_once(samples, count):
    assert after(*samples).count == count


def test_a_battery_may_stay_the_same_for_ever_and_another_be_stuck_in_less_than_a_second():
    limits = STANDARD_LIMITS["battery_remaining"]
    known = after(*((0.5, float(n)) for n in range(100)), limits=limits)
    assert known.unusable(limits, 99.0) == ""
    limits = dataclasses.replace(LIMITS, stuck_after=0.5)
    known = after((2.0, 10.0), (2.0, 10.25), (2.0, 10.5), limits=limits)
    assert known.unusable(limits, 10.5) == "stuck at 2 for 0.5 s (limit 0.5 s)"


@pytest.mark.parametrize("tilt", [0.0, 180.0])
def test_a_vehicle_may_stand_upright_and_lie_on_its_back(tilt):
    limits = STANDARD_LIMITS["tilt_deg"]
    assert after((tilt, 10.0), limits=limits).usable(limits, 10.0) == tilt


# -- jumps ---------------------------------------------------------------------------------------

#: A height that may change by 60 m/s and by 10 m besides.
HEIGHT = Limits(-500.0, 500.0, rate=60.0, jump=10.0, max_age=1.0, stuck_after=5.0)
DOWN = [(100.0, 0.0), (60.0, 0.1), (60.1, 0.15), (60.2, 0.2)]


def heights(*samples: tuple[float, float]) -> Measured:
    return after(*samples, limits=HEIGHT)


def test_a_jump_that_is_confirmed_is_remembered_with_what_was_before():
    known = heights(*DOWN)
    assert (known.jumped_at, known.before_jump, known.doubted_at) == (0.2, 100.0, 0.15)
    # So is one that time made possible meanwhile.
    known = heights((100.0, 0.0), (70.0, 0.1), (70.1, 0.2), (70.2, 0.4))
    assert known.rejected == ""
    assert (known.jumped_at, known.before_jump) == (0.4, 100.0)


@pytest.mark.parametrize("then", [99.9, 85.0])
def test_one_that_goes_back_or_half_way_has_not_jumped(then):
    known = heights((100.0, 0.0), (70.0, 0.1), (then, 0.2))
    assert known.value == then
    assert math.isnan(known.jumped_at)
    assert known.doubted_at == 0.1


@pytest.mark.parametrize(("back_to", "over"), [(90.0, True), (89.9, False)])
def test_a_jump_back_ends_the_doubt(back_to, over):
    known = heights(*DOWN, (back_to + 0.2, 0.3), (back_to + 0.1, 0.35), (back_to, 0.4))
    assert known.value == back_to
    assert math.isnan(known.jumped_at) is over
    assert math.isnan(known.before_jump) is over


def test_after_one_out_of_range_it_is_doubted_for_a_second_but_not_after_none():
    known = heights((100.0, 0.0), (9999.0, 0.1), (100.1, 0.2))
    assert known.doubted_at == 0.1
    assert "another was not taken" in known.doubt("height", 0.3)
    assert math.isnan(heights((100.0, 0.0), (math.nan, 0.1), (100.1, 0.2)).doubted_at)


def test_what_cannot_be_at_all_forgets_what_was_doubted():
    known = heights((100.0, 0.0), (60.0, 0.1), (9999.0, 0.15))
    assert known.candidates == 0
    again = known.with_sample(Sample(60.0, 0.16), HEIGHT)
    assert (again.candidates, again.candidate_at) == (1, 0.16)


# -- samples of a vehicle state ------------------------------------------------------------------


def test_every_part_of_a_vehicle_state_becomes_a_sample_with_its_own_time():
    state = VehicleState(
        height=12.0,
        height_age=0.1,
        vertical_speed=-2.0,
        vertical_speed_age=0.2,
        tilt=math.pi / 2,
        attitude_age=0.3,
        acceleration=9.8,
        acceleration_age=0.4,
        battery_voltage=22.0,
        battery_remaining=0.5,
        battery_age=0.5,
        latitude=48.0,
        longitude=11.0,
        position_age=0.6,
    )
    samples = samples_of(state, 100.0, (48.001, 11.0))
    assert set(samples) == set(STANDARD_LIMITS)
    distance = samples.pop("distance_from_home")
    assert distance.value == pytest.approx(111.2, abs=0.1)
    assert distance.measured_at == 99.4
    told = {name: one for name, one in samples.items() if not math.isnan(one.measured_at)}
    assert told == {
        "height": Sample(12.0, 99.9),
        "vertical_speed": Sample(-2.0, 99.8),
        "tilt_deg": Sample(90.0, 99.7),
        "acceleration": Sample(9.8, 99.6),
        "battery_voltage": Sample(22.0, 99.5),
        "battery_remaining": Sample(0.5, 99.5),
    }


def test_without_a_take_off_or_a_place_there_is_no_distance_between_them():
    assert "distance_from_home" not in samples_of(VehicleState(), 100.0, None)
    sample = samples_of(VehicleState(position_age=0.5), 100.0, (48.0, 11.0))["distance_from_home"]
    assert math.isnan(sample.value)
    assert sample.measured_at == 99.5


@pytest.mark.parametrize(
    ("one", "other", "metres"),
    [
        ((48.0, 11.0), (48.0, 11.0), 0.0),
        ((0.0, 0.0), (0.0, 1.0), 111_195.0),
        ((0.0, 179.5), (0.0, -179.5), 111_195.0),
        ((90.0, 0.0), (-90.0, 0.0), 20_015_087.0),
        ((0.0, 0.0), (0.0, 180.0), 20_015_087.0),
        # Far from the equator a degree of longitude is shorter.
        ((60.0, 0.0), (60.0, 1.0), 55_597.0),
        ((60.0, 0.0), (30.0, 90.0), 7_154_403.0),
    ],
)
def test_the_way_over_ground(one, other, metres):
    assert distance_between(one, other) == pytest.approx(metres, abs=1.0)


def test_a_place_that_is_not_on_earth_is_no_distance():
    for nowhere in (
        (NAN, 11.0),
        (48.0, NAN),
        (math.inf, 11.0),
        (48.0, -math.inf),
        (95.0, 11.0),
        (-1e300, 0.0),
    ):
        assert math.isnan(distance_between((48.0, 11.0), nowhere))
        assert math.isnan(distance_between(nowhere, (48.0, 11.0)))
    for place in ((90.0, 0.0), (-90.0, 360.0), (0.0, -360.0)):
        assert on_earth(*place)
    for nowhere in ((90.5, 0.0), (-90.5, 0.0), (0.0, 360.5), (0.0, -360.5)):
        assert not on_earth(*nowhere)


# -- limits --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("minimum", 400.0, "range 400.0 to 400.0: need a larger second"),
        ("minimum", 405.0, "range 405.0 to 400.0: need a larger second"),
        ("rate", math.inf, "rate is inf: need 0 or more"),
        ("rate", -1.0, "rate is -1.0: need 0 or more"),
        ("jump", -0.5, "jump is -0.5: need 0 or more"),
        ("jump", math.inf, "jump is inf: need 0 or more"),
        ("stuck_after", -0.5, "stuck_after is -0.5: need 0 or more"),
        ("stuck_after", NAN, "stuck_after is nan: need 0 or more"),
        ("max_age", 0.0, "max_age is 0.0: need above 0, up to 60 s"),
        ("max_age", 60.5, "max_age is 60.5: need above 0, up to 60 s"),
    ],
)
def test_limits_past_their_ends_are_told_in_full(name, wrong, words):
    with pytest.raises(ParameterError) as caught:
        dataclasses.replace(LIMITS, **{name: wrong})
    assert str(caught.value) == words


def test_limits_may_reach_their_ends():
    strict = Limits(0.0, 1.0, rate=0.0, jump=0.0, max_age=0.001, stuck_after=0.0)
    assert dataclasses.replace(strict, max_age=60.0).max_age == 60.0


VALUES = st.one_of(st.floats(), st.floats(-450.0, 450.0))
AGES = st.one_of(st.floats(), st.floats(0.0, 3.0))


@given(st.lists(st.tuples(st.floats(0.0, 2.0), VALUES, AGES), max_size=30))
def test_what_can_be_used_is_always_young_within_its_range_and_was_told(told):
    now, known, values = 100.0, Measured(), set()
    for wait, value, age in told:
        now += wait
        known = known.with_sample(Sample(value, now - age), LIMITS)
        values.add(value)
        usable = known.usable(LIMITS, now)
        if math.isnan(usable):
            assert known.unusable(LIMITS, now), "what cannot be used says why"
            continue
        assert usable in values
        assert -400.0 <= usable <= 400.0
        assert -0.2 <= now - known.measured_at <= LIMITS.max_age
