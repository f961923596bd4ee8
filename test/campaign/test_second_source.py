"""A second source of the vehicle's picture, which outlives the autopilot."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from campaign_bench import SHIPPED, correct, fired, flown, left_alone, scenario
from combinations import combinations

from chute_ros.campaign import draw as drawing
from chute_ros.campaign.blind import Need, blinded
from chute_ros.campaign.channel import Spell
from chute_ros.campaign.draw import draw
from chute_ros.campaign.flight import Flight
from chute_ros.campaign.judge import Count, judge
from chute_ros.campaign.scenario import Failure, Scenario, Stop, WayFault
from chute_ros.campaign.sensors import SensorFault
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY, VEHICLE_STATE

WITH_IMU, WITH_ODOMETRY = (VEHICLE_STATE, IMU), (VEHICLE_STATE, ODOMETRY)
WITH_BOTH = (VEHICLE_STATE, IMU, ODOMETRY)
IMU_FIRST = (IMU, VEHICLE_STATE)


@pytest.mark.parametrize(
    ("sources", "profile", "vehicle"),
    combinations(
        [WITH_ODOMETRY, WITH_BOTH, (ODOMETRY, VEHICLE_STATE)],
        ["multirotor", "fixed_wing"],
        ["mavlink", "upf", "both"],
    ),
)
def test_what_outlives_the_autopilot_shows_the_fall(
    sources: tuple[str, ...], profile: str, vehicle: str
) -> None:
    how = {"profile": profile, "vehicle": vehicle, "height": 110.0}
    end = correct(flown(Failure.POWER, vehicle_sources=sources, **how))
    assert end.truth.at < end.killed < end.released < end.truth.latest


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
def test_an_attitude_beside_an_autopilot_that_is_lost_is_enough(profile: str) -> None:
    """From 300 m; at t+0 the autopilot loses its power; the force is wrong from then on; the
    attitude alone tells how it falls, and only beside the silence of the autopilot."""
    wrong = SensorFault("force", "sticks", 0.9, 30.0, IMU)
    how = {"profile": profile, "height": 300.0}
    end = flown(Failure.POWER, wrong, vehicle_sources=WITH_IMU, **how)
    rules = [one.decision.rule for one in fired(end)]
    assert rules[0] == "autopilot lost and falling"
    assert judge(end).count is Count.CORRECT


@pytest.mark.parametrize(
    ("sources", "failure"),
    combinations([WITH_IMU, WITH_ODOMETRY, IMU_FIRST, WITH_BOTH], [Failure.NOTHING, Failure.HANG]),
)
def test_what_flies_on_is_left_alone(failure: Failure, sources: tuple[str, ...]) -> None:
    left_alone(flown(failure, gusts=1.0, vehicle_sources=sources))


def test_a_motor_that_fails_is_seen_with_a_second_source_that_is_silent() -> None:
    """The autopilot tells all that is needed, also where the other one is preferred."""
    for silent in (Stop(IMU, 0.0, 9.0, dies=True), WayFault(IMU, Spell(0.0, 9.0, loss=1.0))):
        end = flown(Failure.MOTOR, silent, vehicle_sources=IMU_FIRST, height=100.0)
        assert judge(end).count is Count.CORRECT
        assert end.released < end.truth.latest


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        (WayFault(ODOMETRY, Spell(0.0, 30.0, loss=1.0)), "the way odometry was cut"),
        (Stop(ODOMETRY, 0.0, 30.0), "odometry stopped"),
    ],
)
def test_what_kept_the_last_one_that_tells_from_it_is_named(
    fault: WayFault | Stop, cause: str
) -> None:
    judged = judge(flown(Failure.POWER, fault, vehicle_sources=WITH_ODOMETRY))
    assert (judged.count, judged.why) == (Count.NOT_TOLD, cause)
    correct(flown(Failure.POWER, fault, vehicle_sources=WITH_BOTH))


@pytest.mark.parametrize(
    "faults",
    [
        (WayFault("autopilot", Spell(0.0, 30.0, loss=1.0)),),
        (SensorFault("force", "zero", 0.0, 30.0), SensorFault("tilt", "noise", 0.0, 30.0)),
    ],
)
def test_what_is_wrong_with_an_autopilot_without_power_is_no_excuse(faults: tuple) -> None:
    need, how = Need(1.0, 6.0), {"vehicle_sources": WITH_ODOMETRY}
    assert blinded(scenario(Failure.MOTOR, *faults, **how), 0.0, need)
    assert not blinded(scenario(Failure.POWER, *faults, **how), 0.0, need)


def test_a_second_source_that_was_killed_tells_again() -> None:
    """At t+0 the autopilot loses its power; from t-0.5 to t+0.5 there is no odometry."""
    dies = Stop(ODOMETRY, 0.5, 1.0, dies=True)
    end = correct(flown(Failure.POWER, dies, vehicle_sources=WITH_ODOMETRY, height=110.0))
    assert end.released < end.truth.latest


@pytest.mark.parametrize("sources", [(ODOMETRY, VEHICLE_STATE), WITH_ODOMETRY], ids=str)
def test_beside_a_roof_the_height_of_another_source_outlives_a_restart(sources) -> None:
    """Given an autopilot that restarts 6 m above a roof, and again and again as it falls past it,
    when odometry tells how far, then the parachute is released."""
    again = (Stop("autopilot", 2.0 + 1.5 * k, 0.9, dies=True) for k in range(3))
    how = {"vehicle_sources": sources, "height": 6.0, "ground": -90.0}
    end = correct(flown(Failure.REBOOT, *again, **how))
    assert end.release_height < -9.0


def test_a_power_failure_that_a_second_source_told_of_is_no_excuse() -> None:
    good = flown(Failure.POWER, vehicle_sources=WITH_ODOMETRY, height=110.0)
    late = {"landed": good.truth.latest + 1.0, "landing_speed": 20.0}
    missed = replace(good, released=math.nan, **late)
    assert judge(missed).count is Count.MISSED
    alone = replace(good.scenario, vehicle_sources=(VEHICLE_STATE,))
    assert judge(replace(missed, scenario=alone)).count is Count.NOT_TOLD


@pytest.mark.parametrize(
    ("sources", "left"), [(WITH_ODOMETRY, 2.8), (IMU_FIRST, 2.8), ((ODOMETRY, *WITH_IMU), 2.0)]
)
def test_the_last_word_of_an_autopilot_without_power_is_waited_out(
    sources: tuple[str, ...], left: float
) -> None:
    good = flown(Failure.POWER, vehicle_sources=sources, height=110.0)
    at = good.truth.at
    lost = {"released": math.nan, "landed": at + 9.0, "landing_speed": 20.0}
    for leeway, count in ((left - 0.1, Count.NO_TIME), (left + 0.1, Count.MISSED)):
        truth = replace(good.truth, latest=at + leeway)
        assert judge(replace(good, truth=truth, **lost)).count is count


def test_a_supervisor_that_starts_anew_hears_both_anew() -> None:
    """At t+0 the autopilot loses its power; from t+0.1 on for 0.5 s there is no supervisor."""
    dies = Stop("supervisor", 1.1, 0.5, dies=True)
    how = {"vehicle_sources": WITH_BOTH, "height": 250.0}
    flight = Flight(scenario(Failure.POWER, dies, **how), SHIPPED)
    end = flight.run()
    assert judge(end).count is Count.CORRECT
    assert end.up + 1.6 < end.killed < end.released < end.truth.latest


def test_it_changes_no_other_flight(monkeypatch) -> None:
    """Three of ten aircraft have one; all else of them is what it was without."""
    drawn = [draw(seed) for seed in range(700)]
    monkeypatch.setattr(drawing, "_WITH_SECOND", 0.0)
    before = [draw(seed) for seed in range(700)]
    aircraft = [one for one in drawn if one.vehicle != "umbilical"]
    having = [one for one in aircraft if one.second_sources]
    assert 0.25 < len(having) / len(aircraft) < 0.35
    assert {one.vehicle_sources for one in having} == {
        *(WITH_IMU, WITH_ODOMETRY, WITH_BOTH),
        *(IMU_FIRST, (ODOMETRY, VEHICLE_STATE), (IMU, ODOMETRY, VEHICLE_STATE)),
    }
    for one, other in zip(drawn, before, strict=True):
        assert without_second(one, other) == other


def without_second(one: Scenario, other: Scenario) -> Scenario:
    """one without what a second source adds to it."""
    if not one.second_sources:
        return one
    faults = one.faults[: len(other.faults)]
    assert len(one.faults) <= len(faults) + 1
    alone = other.vehicle_sources
    return replace(one, vehicle_sources=alone, faults=faults, height=other.height)
