"""Each measurement is evidence: it has an age, and what cannot be is not used, with the reason."""

import dataclasses
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import START, Story, vehicle

from chute_ros.errors import ParameterError
from chute_ros.model import NAN, VehicleState
from chute_ros.supervisor.measured import Measured, Sample
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits
from chute_ros.supervisor.samples import distance_between, samples_of

#: A speed: it may change by 200 m/s each s and 5 m/s besides, is old after 1 s, stuck after 5 s.
LIMITS = STANDARD_LIMITS["vertical_speed"]


def after(*samples: tuple[float, float], limits: Limits = LIMITS) -> Measured:
    """What is known after these (value, time of measurement)."""
    known = Measured()
    for value, at in samples:
        known = known.with_sample(Sample(value, at), limits)
    return known


def test_what_was_never_received_is_absent_and_not_zero() -> None:
    known = Measured()
    assert known.unusable(LIMITS, START) == "never received"
    assert math.isnan(known.usable(LIMITS, START))
    assert known.with_sample(Sample(3.0, NAN), LIMITS) == known


def test_it_is_young_enough_up_to_its_limit_and_absent_after() -> None:
    known = after((-3.0, 10.0))
    assert known.usable(LIMITS, 11.0) == -3.0
    assert known.unusable(LIMITS, 11.01) == "old: 1.01 s (limit 1 s)"
    assert math.isnan(known.usable(LIMITS, 11.01))


def test_its_age_counts_from_the_measurement_not_from_its_receipt() -> None:
    story = Story()
    story.at(0.0, vehicle(age=0.9, vertical_speed=-3.0))
    measured = story.state.measured("vertical_speed")
    assert measured.unusable(LIMITS, START + 0.1) == ""
    assert measured.unusable(LIMITS, START + 0.2) == "old: 1.10 s (limit 1 s)"


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (math.nan, "nan is not a number"),
        (math.inf, "inf is not a number"),
        (-math.inf, "-inf is not a number"),
        (400.1, "400.1 is out of -400 to 400"),
        (-401.0, "-401 is out of -400 to 400"),
    ],
)
def test_what_cannot_be_is_not_used_and_says_why(value: float, words: str) -> None:
    assert after((value, 10.0)).unusable(LIMITS, 10.0) == words
    known = after((1.0, 9.9), (value, 10.0))
    assert known.unusable(LIMITS, 10.0) == words
    assert known.value == 1.0, "what was known is not overwritten"
    assert known.with_sample(Sample(1.1, 10.1), LIMITS).unusable(LIMITS, 10.1) == ""


def test_the_reason_stays_when_what_was_known_has_grown_old() -> None:
    known = after((1.0, 9.0), (math.nan, 10.0))
    assert known.unusable(LIMITS, 10.9) == "nan is not a number"


def test_a_jump_beyond_physics_is_not_used() -> None:
    known = after((0.0, 10.0), (30.0, 10.05))
    assert known.unusable(LIMITS, 10.05) == "jumped by +30 in 0.050 s"
    # Back where it was: the jump was one bad sample.
    assert known.with_sample(Sample(0.1, 10.1), LIMITS).usable(LIMITS, 10.1) == 0.1


def test_a_change_just_within_physics_is_used() -> None:
    assert after((0.0, 10.0), (14.9, 10.05)).usable(LIMITS, 10.05) == 14.9
    assert "jumped" in after((0.0, 10.0), (15.1, 10.05)).unusable(LIMITS, 10.05)


def test_a_jump_that_the_next_samples_confirm_is_believed() -> None:
    first, second, third = (40.0, 10.05), (40.1, 10.1), (40.2, 10.15)
    assert after((0.0, 10.0), first, second).unusable(LIMITS, 10.1)
    assert after((0.0, 10.0), first, second, third).usable(LIMITS, 10.15) == 40.2


def test_samples_that_jump_about_confirm_each_other_not() -> None:
    wild = [(-300.0 if n % 2 else 300.0, 10.05 + n * 0.05) for n in range(10)]
    known = after((0.0, 10.0), *wild)
    assert known.unusable(LIMITS, 10.5)
    assert known.value == 0.0


def test_a_bad_sample_between_begins_the_confirmation_anew() -> None:
    known = after((0.0, 10.0), (300.0, 10.05), (301.0, 10.1), (NAN, 10.15), (302.0, 10.2))
    assert "jumped" in known.unusable(LIMITS, 10.2)
    assert known.candidates == 1


def test_after_a_silence_nobody_knows_what_lay_between() -> None:
    assert after((0.0, 10.0), (90.0, 11.01)).usable(LIMITS, 11.01) == 90.0


def test_time_that_runs_backwards_is_not_used_and_says_so() -> None:
    known = after((1.0, 10.0), (2.0, 9.5))
    assert known.unusable(LIMITS, 10.1) == "time ran backwards by 0.50 s"
    assert known.value == 1.0


def test_a_clock_that_was_set_back_is_believed_once_samples_agree() -> None:
    known = after((1.0, 10.0), (2.0, 9.0), (2.1, 9.1), (2.2, 9.2))
    assert known.usable(LIMITS, 9.2) == 2.2


def test_one_that_was_overtaken_on_its_way_changes_nothing() -> None:
    known = after((1.0, 10.0))
    assert known.with_sample(Sample(1.1, 9.95), LIMITS) == known


def test_what_claims_to_come_from_the_future_is_not_used() -> None:
    known = after((1.0, 1e9))
    assert "future" in known.unusable(LIMITS, 10.0)
    assert known.unusable(LIMITS, 1e9 - 0.05) == "", "clocks and ways may differ a little"
    recovered = after((1.0, 1e9), (2.0, 10.0), (2.1, 10.1), (2.2, 10.2))
    assert recovered.usable(LIMITS, 10.2) == 2.2


def test_the_same_sample_told_again_is_one() -> None:
    known = after((1.0, 10.0))
    assert known.with_sample(Sample(1.0, 10.001), LIMITS) == known
    doubtful = after((1.0, 10.0), (40.0, 10.1))
    assert doubtful.with_sample(Sample(40.0, 10.101), LIMITS) == doubtful
    assert after((1.0, 10.0), (1.1, 10.1), (1.2, 10.2)).count == 3


def test_a_value_that_does_not_change_any_more_is_stuck() -> None:
    same = [(-3.0, 10.0 + n * 0.5) for n in range(11)]
    assert after(*same[:10]).unusable(LIMITS, 14.5) == ""
    assert after(*same).unusable(LIMITS, 15.0) == "stuck at -3 for 5.0 s (limit 5 s)"
    moved = after(*same, (-3.0000001, 15.5))
    assert moved.unusable(LIMITS, 15.5) == ""


def test_a_battery_may_stay_the_same_for_ever() -> None:
    limits = STANDARD_LIMITS["battery_remaining"]
    known = after(*((0.5, float(n)) for n in range(100)), limits=limits)
    assert known.unusable(limits, 99.0) == ""


def test_every_part_of_a_vehicle_state_becomes_a_sample_with_its_own_time() -> None:
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
    assert samples["height"] == Sample(12.0, 99.9)
    assert samples["vertical_speed"] == Sample(-2.0, 99.8)
    assert samples["tilt_deg"] == Sample(90.0, 99.7)
    assert samples["acceleration"] == Sample(9.8, 99.6)
    assert samples["battery_voltage"] == Sample(22.0, 99.5)
    assert samples["battery_remaining"] == Sample(0.5, 99.5)
    assert samples["distance_from_home"].value == pytest.approx(111.2, abs=0.1)
    assert samples["distance_from_home"].measured_at == 99.4


def test_without_a_take_off_there_is_no_distance_from_it() -> None:
    assert "distance_from_home" not in samples_of(VehicleState(), 100.0, None)


@pytest.mark.parametrize(
    ("one", "other", "metres"),
    [
        ((48.0, 11.0), (48.0, 11.0), 0.0),
        ((0.0, 0.0), (0.0, 1.0), 111_195.0),
        ((0.0, 179.5), (0.0, -179.5), 111_195.0),
        ((90.0, 0.0), (-90.0, 0.0), 20_015_087.0),
        ((0.0, 0.0), (0.0, 180.0), 20_015_087.0),
    ],
)
def test_the_way_over_ground(
    one: tuple[float, float], other: tuple[float, float], metres: float
) -> None:
    assert distance_between(one, other) == pytest.approx(metres, abs=1.0)


@pytest.mark.parametrize(
    "nowhere",
    [(NAN, 11.0), (48.0, NAN), (math.inf, 11.0), (48.0, -math.inf), (95.0, 11.0), (-1e300, 0.0)],
)
def test_a_place_that_is_not_on_earth_is_no_distance(nowhere: tuple[float, float]) -> None:
    assert math.isnan(distance_between((48.0, 11.0), nowhere))
    assert math.isnan(distance_between(nowhere, (48.0, 11.0)))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"minimum": 5.0, "maximum": 5.0}, "range 5.0 to 5.0: need a larger second"),
        ({"rate": -1.0}, "rate is -1.0: need 0 or more"),
        ({"jump": math.inf}, "jump is inf: need 0 or more"),
        ({"stuck_after": NAN}, "stuck_after is nan: need 0 or more"),
        ({"max_age": 0.0}, "max_age is 0.0: need above 0, up to 60 s"),
        ({"max_age": 61.0}, "max_age is 61.0"),
    ],
)
def test_limits_that_contradict_themselves_say_so(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        dataclasses.replace(LIMITS, **wrong)


VALUES = st.one_of(st.floats(), st.floats(-450.0, 450.0))
AGES = st.one_of(st.floats(), st.floats(0.0, 3.0))


@given(st.lists(st.tuples(st.floats(0.0, 2.0), VALUES, AGES), max_size=30))
def test_what_can_be_used_is_always_young_within_its_range_and_was_told(
    told: list[tuple[float, float, float]],
) -> None:
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
