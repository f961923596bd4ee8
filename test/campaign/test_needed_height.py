"""How low a failure may happen: by stories of the search, and by flights."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import pytest
from campaign_bench import FOLDER

from chute_ros.campaign.cases import Case, cases, flight_of
from chute_ros.campaign.described import DescribedVehicle, OwnShipped, Range
from chute_ros.campaign.heights import Campaign, CaseFlights, find, fly
from chute_ros.campaign.needed_height import (
    CEILING,
    Fall,
    FallStage,
    Needed,
    ObservedFlight,
    needed_height,
)
from chute_ros.campaign.scenario import Failure

DRONE = DescribedVehicle(
    *("a drone", "multirotor", 6.0, Range(0.15, 0.15), 5.0, Range(1.2, 1.2), 6.25),
    *(Range(60.0, 60.0), "multirotor"),
)
PLANE = replace(DRONE, kind="fixed_wing", profile="fixed_wing", autopilot="arduplane")
SOFT = 6.0


# The search


def saved(height: float, lost: float) -> Fall:
    """Its canopy carried after so many m."""
    return Fall(height, FallStage(0.5, 1.0), FallStage(0.6, 1.5), FallStage(2.0, lost), math.nan)


def crashed(height: float) -> Fall:
    """Its canopy was still opening."""
    return Fall(height, FallStage(0.5, 1.0), FallStage(0.6, 1.5), FallStage(), 15.0)


class World:
    """Saves what fails at some height or higher; remembers the heights that were tried."""

    def __init__(self, saves_from: float, loses: float, usual: float = 80.0) -> None:
        self.saves_from, self.loses, self.usual = saves_from, loses, usual
        self.tried: list[float] = []

    def fly_from(self, height: float) -> Fall:
        """One flight."""
        self.tried.append(height)
        height = height or self.usual
        return saved(height, self.loses) if height >= self.saves_from else crashed(height)


def test_a_height_that_is_confirmed_at_once_takes_two_flights() -> None:
    world = World(saves_from=19.3, loses=19.3)
    assert needed_height(world.fly_from, SOFT, 1).height == 20.0
    assert world.tried == [0.0, 20.0]


@pytest.mark.parametrize("saves_from", [20.5, 24.0, 31.7, 79.0])
def test_where_the_rules_need_more_than_is_lost_it_is_found_to_a_metre(saves_from: float) -> None:
    """As below a minimum height, where nothing is released."""
    world = World(saves_from, loses=12.0)
    assert saves_from <= needed_height(world.fly_from, SOFT, 1).height <= saves_from + 1.0


def test_what_is_not_saved_from_its_usual_height_is_tried_from_higher() -> None:
    found = needed_height(World(90.0, loses=89.5, usual=40.0).fly_from, SOFT, 1)
    assert (found.height, found.usual_saved) == (90.0, False)
    assert found.usual.height == 40.0


def test_what_is_saved_from_nowhere_needs_more_than_any_height() -> None:
    world = World(math.inf, loses=0.0)
    assert needed_height(world.fly_from, SOFT, 1).height == math.inf
    assert world.tried == [0.0, CEILING]


def test_what_lands_softly_without_a_parachute_needs_no_height() -> None:
    glides = Fall(80.0, FallStage(), FallStage(), FallStage(), 2.5)
    assert needed_height(lambda height: glides, SOFT, 1).height == 0.0


def test_a_touchdown_under_a_canopy_that_is_still_opening_counts_if_it_is_soft() -> None:
    assert replace(crashed(20.0), touchdown=5.9).is_saved(SOFT)
    assert not replace(crashed(20.0), touchdown=6.1).is_saved(SOFT)


# What is counted


def found(*every: float) -> CaseFlights:
    """Of flights that need these heights."""
    case = Case("a failure", "it fails", Failure.MOTOR)
    return CaseFlights(
        case, tuple(Needed(n, h, saved(80.0, h), h < 80.0) for n, h in enumerate(every))
    )


def test_few_flights_bound_a_smaller_share_by_their_largest() -> None:
    assert found(*range(1, 101)).bound == 100
    assert found(*range(1, 101)).share == pytest.approx(0.9705, abs=1e-4)
    enough = found(*range(1, 474))
    assert (enough.share, enough.bound) == (0.99, 472)


def test_one_that_is_never_saved_is_the_largest() -> None:
    one = found(*range(1, 60), math.inf)
    assert one.bound == math.inf
    assert one.usual_saved[0] == 59


def test_one_that_was_released_before_its_failure_is_no_such_flight() -> None:
    before = Fall(math.nan, FallStage(), FallStage(), FallStage(), math.nan, ended_before=True)
    one = CaseFlights(found(5.0).case, (*found(5.0, 6.0).every, Needed(9, 0.0, before, True)))
    assert one.needed == [5.0, 6.0]


# Flights


@functools.cache
def shipped(vehicle: DescribedVehicle) -> OwnShipped:
    """The settings that it flies with."""
    return OwnShipped(FOLDER, vehicle.profile)


def case_of(vehicle: DescribedVehicle, name: str, **more: object) -> Case:
    """The failure with this name."""
    one = next(one for one in cases(vehicle) if one.name == name)
    return replace(one, **more)  # type: ignore[arg-type]


def fall(vehicle: DescribedVehicle, case: Case, height: float = 0.0) -> Fall:
    """The flight of seed 1."""
    flight = flight_of(vehicle, case, 1, height)
    return ObservedFlight(flight, shipped(vehicle), vehicle.soft_landing).fall()


@functools.cache
def needed(vehicle: DescribedVehicle, name: str) -> float:
    """The least height of seed 1."""
    case = case_of(vehicle, name)
    return needed_height(lambda h: fall(vehicle, case, h), vehicle.soft_landing, 1).height


def test_a_motor_failure_is_timed_from_the_failure_to_the_canopy() -> None:
    one = fall(DRONE, case_of(DRONE, "motor lost"))
    assert one.height == pytest.approx(60.0, abs=1.0)
    assert 0.3 < one.decided.after < one.released.after < one.carried.after
    assert one.carried.after - one.released.after >= 1.2, "no sooner than the canopy is open"
    assert 0.0 < one.decided.lost < one.released.lost < one.carried.lost


def test_a_canopy_that_takes_longer_needs_more_height() -> None:
    slow = replace(DRONE, opening_time=Range(2.4, 2.4))
    quick = needed(DRONE, "motor lost")
    assert needed(slow, "motor lost") > quick + 10.0


def test_a_canopy_that_opens_at_once_needs_the_minimum_height_of_the_rules() -> None:
    """Below 10 m nothing is released, however quick the canopy is."""
    at_once = replace(DRONE, opening_time=Range(0.05, 0.05))
    one = fall(at_once, case_of(at_once, "motor lost"))
    assert one.carried.lost < 10.0
    height = needed(at_once, "motor lost")
    assert 10.0 + one.decided.lost - 0.5 <= height < 10.0 + one.carried.lost + 1.0


def test_a_lighter_vehicle_needs_no_more() -> None:
    light = replace(DRONE, mass=3.0)
    assert needed(light, "motor lost") <= needed(DRONE, "motor lost")


def test_nothing_releases_for_a_vehicle_whose_autopilot_was_all_that_told_of_it() -> None:
    assert needed(DRONE, "power lost") == math.inf
    with_imu = replace(DRONE, vehicle_sources=("vehicle/state", "imu"))
    assert needed(with_imu, "power lost") < 80.0


def test_a_failure_in_a_descent_happens_at_the_same_height_and_faster() -> None:
    sinks = replace(DRONE, descent_speed=4.0)
    level, descent = (
        fall(sinks, case_of(sinks, "motor lost", descends=one), 40.0) for one in (False, True)
    )
    assert level.height == pytest.approx(40.0, abs=0.5)
    assert descent.height == pytest.approx(40.0, abs=0.5)
    assert descent.decided.lost / descent.decided.after > level.decided.lost / level.decided.after


def test_a_sink_of_the_description_is_flown() -> None:
    spins = replace(PLANE, sinks=(("flat spin", Range(14.0, 14.0)),))
    assert flight_of(spins, case_of(spins, "flat spin"), 1).descent.sink == 14.0
    assert flight_of(spins, case_of(spins, "deep stall"), 1).descent.sink < 10.0


@pytest.mark.parametrize(
    "change",
    [
        {"mass": 7.0},
        {"drag_area": Range(0.2, 0.2)},
        {"descent_rate": 4.0},
        {"opening_time": Range(1.3, 1.3)},
        {"heights": Range(70.0, 70.0)},
        {"wind": 3.0},
        {"parachute": "upf"},
        {"self_release": True},
        {"autopilot": "arducopter"},
        {"vehicle_sources": ("vehicle/state", "imu")},
        {"sinks": (("partial thrust", Range(20.0, 20.0)),)},
    ],
    ids=lambda change: next(iter(change)),
)
def test_each_field_of_the_description_changes_a_flight(change: dict[str, object]) -> None:
    """soft_landing, profile and descent_speed have stories of their own."""
    case = case_of(DRONE, "thrust partly lost")
    other = replace(DRONE, **change)  # type: ignore[arg-type]
    assert flight_of(other, case, 1) != flight_of(DRONE, case, 1)


def test_a_softer_landing_needs_more_height() -> None:
    soft = replace(DRONE, soft_landing=5.3)
    assert needed(soft, "motor lost") > needed(DRONE, "motor lost")


def test_an_aeroplane_has_failures_of_its_own() -> None:
    names = {one.name for one in cases(PLANE)}
    assert {"breaks", "flat spin", "spiral dive", "deep stall"} < names
    assert "motor lost" not in names
    assert needed(PLANE, "steep spin") < 60.0


def test_the_same_seed_is_the_same_flight_and_another_is_not() -> None:
    campaign = Campaign(DRONE, FOLDER, seed=3, flights=2)
    one, other = fly(campaign, [0, 1])
    assert fly(campaign, [0]) == [one]
    assert one.height != other.height or one.usual != other.usual
    later = replace(campaign, seed=4)
    assert fly(later, [0]) == [other]


def test_faults_come_around_the_same_failures() -> None:
    campaign = Campaign(DRONE, FOLDER, seed=3, flights=1, faults=2)
    plain, faulty = campaign.cases[:4], campaign.cases[4:]
    assert [one.name for one in plain] == [one.name for one in faulty]
    assert {one.faults for one in faulty} == {2}
    flights = [flight_of(DRONE, one, 3) for one in (plain[0], faulty[0])]
    assert not flights[0].faults
    assert 1 <= len(flights[1].faults) <= 2


def test_every_seed_of_every_case_is_flown_and_told() -> None:
    told: list[int] = []
    campaign = Campaign(replace(DRONE, heights=Range(30.0, 30.0)), FOLDER, seed=0, flights=1)
    every = find(campaign, 1, told.append)
    assert [one.case.name for one in every] == [one.name for one in cases(DRONE)]
    assert told == [1, 2, 3, 4]
