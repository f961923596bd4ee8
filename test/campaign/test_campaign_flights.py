"""Single flights of a campaign: what fails, what is done about it, and what it is counted as."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from chute_ros.campaign import campaign
from chute_ros.campaign.channel import Spell
from chute_ros.campaign.flight import Flight, Flown, load_profiles
from chute_ros.campaign.judge import WRONG, Count, judge
from chute_ros.campaign.scenario import (
    MOST_FAULTS,
    PROFILES,
    Failure,
    Fault,
    Scenario,
    Stop,
    WayFault,
    draw,
)
from chute_ros.campaign.vehicle import SensorFault
from chute_ros.model import Action, Decision

FOLDER = Path(__file__).parents[2] / "config" / "profiles"
SHIPPED = load_profiles(FOLDER)


def flown(failure: Failure, *faults: Fault, profile: str = "multirotor", **more: float) -> Flown:
    """From 60 m, in still air, it fails 1 s after it is up."""
    drawn = {"height": 60.0, "gusts": 0.0, "fall_speed": 25.0, "failure_at": 1.0, **more}
    scenario = Scenario(1, profile, failure=failure, faults=faults, **drawn)
    return Flight(scenario, SHIPPED[profile]).run()


def fired(one: Flown) -> list[tuple[float, Decision]]:
    """The kills and deploys that the device node acted on."""
    return [(at, act) for at, act in one.acted if act.action in (Action.KILL, Action.DEPLOY)]


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("failure", [Failure.MOTOR, Failure.REBOOT])
def test_what_falls_is_killed_and_released_in_time(failure: Failure, profile: str) -> None:
    end = flown(failure, profile=profile)
    assert judge(end).count is Count.RIGHT
    assert end.truth.at < end.killed < end.released < end.truth.latest
    assert [one.action for _, one in fired(end)] == [Action.KILL, Action.DEPLOY]


@pytest.mark.parametrize("failure", [Failure.NOTHING, Failure.HANG])
def test_what_flies_on_is_left_alone(failure: Failure) -> None:
    end = flown(failure, gusts=1.0)
    assert judge(end).count is Count.RIGHT
    assert not fired(end)
    assert math.isnan(end.released)
    assert not end.truth.falls


def test_orders_to_release_are_recognised_on_the_wire() -> None:
    scenario = Scenario(1, "multirotor", 60.0, 0.0, 25.0, Failure.MOTOR, 1.0, ())
    flight = Flight(scenario, SHIPPED["multirotor"])
    flight.node._knows_release = True
    assert flight.run().ordered_again == 1


def test_from_too_low_there_is_no_time() -> None:
    assert judge(flown(Failure.MOTOR, height=6.0)).count is Count.NO_TIME


def test_a_power_failure_is_seen_by_nobody() -> None:
    judged = judge(flown(Failure.POWER))
    assert judged.count is Count.NOT_TOLD
    assert judged.why == "the autopilot had no power, and nothing else tells of the vehicle"


def test_a_cable_that_is_cut_for_the_whole_fall_is_named() -> None:
    cut = WayFault("autopilot", Spell(0.9, 20.0, loss=1.0))
    judged = judge(flown(Failure.MOTOR, cut))
    assert (judged.count, judged.why) == (Count.NOT_TOLD, "the way autopilot was cut")


def test_a_supervisor_that_dies_as_the_vehicle_fails_goes_on_in_time() -> None:
    dies = Stop("supervisor", 1.1, 1.0, dies=True)
    end = flown(Failure.MOTOR, dies, height=100.0)
    assert judge(end).count is Count.RIGHT
    assert len({one.epoch for _, one in end.acted}) == 2


def test_one_sensor_that_reads_nothing_deploys_nothing() -> None:
    assert judge(flown(Failure.NOTHING, SensorFault("force", 0.5, 6.0))).count is Count.RIGHT


def test_the_same_seed_is_the_same_flight() -> None:
    once, again = (campaign.fly_here(FOLDER, 136)[1] for _ in range(2))
    assert repr(once) == repr(again)


def test_every_scenario_is_drawn_within_its_bounds() -> None:
    every = [draw(seed) for seed in range(3000)]
    assert {one.profile for one in every} == set(PROFILES)
    assert {one.failure for one in every} == set(Failure)
    assert {len(one.faults) for one in every} == set(range(MOST_FAULTS + 1))
    assert all(12.0 <= one.height <= 120.0 for one in every)
    assert repr(every[7]) == repr(draw(7))


# -- what it is counted as ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def good() -> Flown:
    return flown(Failure.MOTOR)


def test_each_thing_that_must_not_be_is_counted_as_such(good: Flown) -> None:
    truth = good.truth
    hard = {"landed": truth.latest + 1.0, "landing_speed": 20.0}
    kill, deploy = fired(good)
    cases = {
        Count.MISSED: {"released": math.nan, **hard},
        Count.LATE: {"released": truth.latest + 0.3, **hard},
        Count.FALSE: {"released": truth.at - 0.1},
        Count.DOUBLED: {"ordered_again": 1},
        Count.OUT_OF_ORDER: {"acted": (deploy, kill)},
        Count.UNEXPLAINED: {"acted": (kill, (deploy[0], replace(deploy[1], reasons=())))},
        Count.GROUNDED: {"grounded": "a required link is not healthy"},
    }
    assert set(cases) == set(WRONG)
    for count, changed in cases.items():
        assert judge(replace(good, **changed)).count is count
    assert judge(good).count is Count.RIGHT


def test_a_campaign_counts_every_flight_once() -> None:
    tallies = []
    tally = campaign.run(FOLDER, 6, 100, 2, lambda one: tallies.append(one.flights))
    assert tallies == [1, 2, 3, 4, 5, 6]
    assert sum(tally.counts.values()) == tally.flights == 6
    assert tally.took > 0.0
