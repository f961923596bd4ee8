"""Single flights of the world as it is: whose autopilot, over what ground, out of which
manoeuvre, with which body and canopy."""

from __future__ import annotations

import math

import pytest
from campaign_bench import correct, flown, left_alone
from combinations import combinations

from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.judge import Count, judge
from chute_ros.campaign.manoeuvre import Manoeuvre
from chute_ros.campaign.scenario import Autopilot, Canopy, Failure, HomeMove, Person
from chute_ros.campaign.sensors import SensorFault
from chute_ros.sim.autopilot_kinds import KINDS
from chute_ros.sim.flight import Descent
from chute_ros.sim.home import Homing

SINKS = Descent("partial thrust", 8.0, settles=2.0, tilt=0.2)
FLAT_SPIN = Descent("flat spin", 10.0, settles=1.5, tilt=0.35, force=10.5)
DIVE = Descent("spiral dive", 16.0, settles=2.5, tilt=1.2, force=20.0)
GLIDE = Descent("glide", 3.0, settles=1.5, tilt=0.1)


def test_what_sinks_upright_and_was_not_told_to_is_released() -> None:
    end = correct(flown(Failure.SINK, descent=SINKS))
    assert end.truth.at + 1.0 < end.released < end.truth.latest


def test_a_spin_is_released_and_a_glide_is_not() -> None:
    spins = correct(
        flown(Failure.STALL, profile="fixed_wing", descent=FLAT_SPIN, unheld=FLAT_SPIN)
    )
    assert spins.released < spins.truth.latest
    left_alone(flown(Failure.GLIDE, profile="fixed_wing", descent=GLIDE, unheld=DIVE))


@pytest.mark.parametrize("vehicle", ["mavlink", "upf"])
def test_from_a_roof_it_is_released_once_it_is_below_it(vehicle: str) -> None:
    end = correct(flown(Failure.MOTOR, vehicle=vehicle, height=8.0, ground=-80.0))
    assert end.release_height < -9.0
    assert end.landing_speed <= 6.5 or math.isnan(end.landed)


@pytest.mark.parametrize(
    ("kind", "profile"), combinations(list(KINDS), ["multirotor", "fixed_wing"])
)
def test_what_a_person_alone_kills_is_not_released_by_any_autopilot(
    kind: str, profile: str
) -> None:
    person, autopilot = Person("kill_only", 1.0), Autopilot(kind=kind)
    end = correct(flown(Failure.NOTHING, person=person, autopilot=autopilot, profile=profile))
    assert end.killed < end.up + 1.3
    assert math.isnan(end.released)
    assert not math.isnan(end.landed)


@pytest.mark.parametrize("kind", list(KINDS))
def test_on_every_autopilot_the_kill_is_before_the_release_and_soon(kind: str) -> None:
    end = correct(flown(Failure.MOTOR, autopilot=Autopilot(kind=kind)))
    assert end.killed < end.released < end.truth.at + 1.0


@pytest.mark.parametrize("homing", list(Homing))
def test_what_a_person_kills_is_released_whatever_becomes_of_home(homing: Homing) -> None:
    autopilot = Autopilot(homing)
    end = correct(flown(Failure.NOTHING, person=Person("kill", 1.0), autopilot=autopilot))
    assert end.released < end.up + 2.0


@pytest.mark.parametrize("by", [-40.0, 55.0])
def test_a_home_that_is_set_anew_hides_no_fall_and_is_none(by: float) -> None:
    falls = correct(flown(Failure.MOTOR, HomeMove(0.9, by)))
    assert falls.released < falls.truth.latest
    left_alone(flown(Failure.NOTHING, HomeMove(0.9, by)))


@pytest.mark.parametrize(
    "manoeuvre",
    [
        Manoeuvre("flip", 500.0, 1.0),
        Manoeuvre("throw", 0.9, 1.0),
        Manoeuvre("dive", 70.0, 1.0, 1.0, 4.0),
        Manoeuvre("descent", 7.0, 1.0, 5.0),
    ],
    ids=lambda one: one.kind,
)
@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
def test_what_is_flown_on_purpose_is_left_alone(manoeuvre: Manoeuvre, profile: str) -> None:
    left_alone(flown(Failure.NOTHING, manoeuvre=manoeuvre, profile=profile, height=80.0))


@pytest.mark.parametrize(
    ("sensor", "how"), [("tilt", "jumps"), ("force", "zero"), ("speed", "jumps")]
)
def test_a_descent_with_one_sensor_wrong_is_left_alone(sensor: str, how: str) -> None:
    wrong = SensorFault(sensor, how, 2.0, 5.0)
    left_alone(flown(Failure.NOTHING, wrong, manoeuvre=Manoeuvre("descent", 4.0, 1.0, 6.0)))


@pytest.mark.parametrize(
    "fault",
    [EstimatorFault("diverges", 1.0, 6.0, 3.0), EstimatorFault("leans", 1.0, 6.0, 0.4)],
    ids=lambda one: one.how,
)
def test_an_estimator_that_is_wrong_with_itself_ends_no_flight(fault: EstimatorFault) -> None:
    left_alone(flown(Failure.NOTHING, fault))


def test_nor_does_it_hide_a_tumble() -> None:
    end = correct(flown(Failure.MOTOR, EstimatorFault("hovers", 0.8, 12.0), height=80.0))
    assert end.released < end.truth.latest


def test_a_canopy_that_does_not_carry_is_followed_by_the_next_parachute() -> None:
    end = flown(Failure.MOTOR, vehicle="both", height=120.0, canopy=Canopy(22.0))
    assert end.another.at < end.released_another < end.another.latest
    assert judge(end).count is Count.CORRECT


def test_it_is_followed_as_well_where_a_person_deployed_before_anything_failed() -> None:
    deploys = Person("deploy", 1.0)
    both = {"vehicle": "both", "height": 120.0, "canopy": Canopy(22.0)}
    end = correct(flown(Failure.NOTHING, person=deploys, **both))
    assert not end.truth.falls, "it flew well"
    assert end.another.at < end.released_another < end.another.latest


def test_above_a_canopy_that_carries_no_other_parachute_is_released() -> None:
    """For as long as anybody would release the next of two."""
    end = correct(flown(Failure.MOTOR, vehicle="both", height=120.0))
    assert end.landed > end.released + 12.0 or math.isnan(end.landed)
    assert math.isnan(end.released_another)


def test_a_canopy_that_does_not_carry_and_is_the_only_one_is_told_of() -> None:
    end = correct(flown(Failure.MOTOR, height=120.0, canopy=Canopy(22.0)))
    assert end.landing_speed > 15.0
    assert [text for at, text in end.alarmed if at > end.another.at]


@pytest.mark.parametrize(
    ("runs_away", "vehicle"),
    combinations(
        [EstimatorFault("leans", 1.0, 9.0, 0.33), EstimatorFault("diverges", 1.0, 9.0, 4.0)],
        ["mavlink", "upf"],
    ),
)
def test_an_estimator_that_runs_away_on_the_ground_releases_nothing(
    runs_away: EstimatorFault, vehicle: str
) -> None:
    end = flown(Failure.NOTHING, runs_away, height=0.0, vehicle=vehicle)
    assert not end.truth.falls
    assert math.isnan(end.released)
    assert judge(end).count is Count.CORRECT
