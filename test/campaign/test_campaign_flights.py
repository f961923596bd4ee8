"""Single flights of a campaign: what fails, and what is done about it."""

from __future__ import annotations

import math
from functools import partial

import pytest
from campaign_bench import FOLDER, SHIPPED, correct, fired, flown, left_alone, rocket, scenario
from combinations import combinations

from chute_ros.campaign import campaign
from chute_ros.campaign.channel import Spell
from chute_ros.campaign.draw import draw
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.flight import Flight, fly
from chute_ros.campaign.judge import Count, judge
from chute_ros.campaign.pool import flown_here
from chute_ros.campaign.scenario import (
    MOST_FAULTS,
    PROFILES,
    ClockJump,
    Failure,
    HomeMove,
    Person,
    Scenario,
    Stalls,
    Stop,
    WayFault,
)
from chute_ros.campaign.sensors import SensorFault
from chute_ros.campaign.truth import SOFT
from chute_ros.links.registered import vehicles
from chute_ros.model import Action
from chute_ros.sim.autopilot_kinds import KINDS
from chute_ros.sim.home import Homing

AIRCRAFT = ("mavlink", "upf", "both")
UNBRAKED = (Failure.NO_DROGUE, Failure.FAULT, Failure.COMPUTER_REBOOT)
BUNDLE = partial(campaign.fly_bundle, FOLDER)


@pytest.mark.parametrize(
    ("vehicle", "profile", "failure"),
    combinations(AIRCRAFT, PROFILES[:2], [Failure.MOTOR, Failure.REBOOT]),
)
def test_what_falls_is_killed_and_released_in_time(
    failure: Failure, profile: str, vehicle: str
) -> None:
    end = correct(flown(failure, profile=profile, vehicle=vehicle, height=90.0))
    assert end.truth.at < end.killed < end.released < end.truth.latest
    assert [one.decision.action for one in fired(end)] == [Action.KILL, Action.DEPLOY]


@pytest.mark.parametrize(
    ("vehicle", "failure"), combinations(AIRCRAFT, [Failure.NOTHING, Failure.HANG])
)
def test_what_flies_on_is_left_alone(failure: Failure, vehicle: str) -> None:
    end = left_alone(flown(failure, gusts=1.0, vehicle=vehicle))
    assert math.isnan(end.released)
    assert not end.truth.falls


@pytest.mark.parametrize("failure", UNBRAKED)
def test_a_rocket_without_its_drogue_gets_one(failure: Failure) -> None:
    end = correct(fly(rocket(failure, failure_at=4.0), SHIPPED))
    assert end.truth.at < end.killed < end.released < end.truth.latest
    assert [one.decision.action for one in fired(end)] == [Action.KILL, Action.DEPLOY]


def test_a_rocket_whose_drogue_comes_by_itself_is_left_alone() -> None:
    end = correct(fly(rocket(Failure.NOTHING), SHIPPED))
    assert not end.truth.falls
    assert Action.DEPLOY not in [one.decision.action for one in end.acted]
    # Nothing may burn any more under a canopy.
    assert [one.decision.rule for one in fired(end)] == ["parachute open"]
    assert end.released < end.killed


@pytest.mark.parametrize("vehicle", ["mavlink", "upf"])
def test_orders_to_release_are_recognised_on_the_wire(vehicle: str) -> None:
    flight = Flight(scenario(Failure.MOTOR, vehicle=vehicle), SHIPPED)
    node = flight.rig.nodes["upf_can" if vehicle == "upf" else "mavlink_parachute"]
    node.knows_release = True
    assert flight.run().ordered_again >= 1


def test_orders_to_fire_the_drogue_are_recognised_on_the_wire() -> None:
    flight = Flight(rocket(Failure.NO_DROGUE), SHIPPED)
    flight.rig.nodes["umbilical"].knows_release = True
    assert flight.run().ordered_again >= 1


def test_from_too_low_there_is_no_time() -> None:
    assert judge(flown(Failure.MOTOR, height=6.0)).count is Count.NO_TIME


def test_a_power_failure_is_seen_by_nobody() -> None:
    judged = judge(flown(Failure.POWER))
    assert judged.count is Count.NOT_TOLD
    assert judged.why == "the autopilot had no power, and nothing else tells of the vehicle"


def test_a_upf_that_may_releases_itself_when_the_power_fails() -> None:
    end = correct(flown(Failure.POWER, vehicle="upf", aps=True))
    assert end.truth.at < end.released < end.truth.latest


@pytest.mark.parametrize("failure", [Failure.MOTOR, Failure.REBOOT, Failure.SINK])
def test_beside_a_upf_that_releases_itself_no_other_parachute_comes_out(failure: Failure) -> None:
    one = correct(flown(failure, vehicle="both", aps=True))
    assert any(act.rule == "device asks for a kill" for _, act in one.decided)
    assert math.isnan(one.released_another)


def test_a_cable_that_is_cut_for_the_whole_fall_is_named() -> None:
    cut = WayFault("autopilot", Spell(0.9, 20.0, loss=1.0))
    judged = judge(flown(Failure.MOTOR, cut))
    assert (judged.count, judged.why) == (Count.NOT_TOLD, "the way autopilot was cut")


def test_a_supervisor_that_dies_as_the_vehicle_fails_goes_on_in_time() -> None:
    dies = Stop("supervisor", 1.1, 1.0, dies=True)
    end = correct(flown(Failure.MOTOR, dies, height=100.0))
    assert len({one.decision.epoch for one in end.acted}) == 2


@pytest.mark.parametrize("dies", [False, True])
def test_a_standby_takes_over_from_one_that_stops(dies: bool) -> None:
    stop = Stop("supervisor", 0.9, 8.0, dies=dies)
    end = correct(flown(Failure.MOTOR, stop, height=100.0, standby=True))
    takes_over = "became leader, epoch 17: no leader's heartbeat was received for the lease's time"
    assert takes_over in [text for _, text in end.said]
    # Before the one that stopped is back.
    assert end.released < end.up + 3.0


def test_a_node_that_dies_as_the_vehicle_fails_goes_on_in_time() -> None:
    dies = Stop("mavlink_parachute", 1.0, 0.5, dies=True)
    correct(flown(Failure.MOTOR, dies, height=100.0))


def test_a_controller_that_dies_does_not_keep_the_trigger_from_firing() -> None:
    dies = Stop("controller", 1.2, 6.0, dies=True)
    end = correct(flown(Failure.MOTOR, dies, vehicle="upf", height=110.0))
    assert end.released < end.truth.latest


@pytest.mark.parametrize(
    ("by", "who"),
    combinations([-3600.0, -1.0, 1.0, 3600.0], ["supervisor", "mavlink_parachute"]),
)
def test_a_wall_clock_that_is_set_makes_no_decision_too_old(who: str, by: float) -> None:
    end = correct(flown(Failure.MOTOR, ClockJump(who, 0.9, by)))
    assert end.killed < end.released < end.truth.latest


def test_a_supervisor_on_an_overloaded_host_is_in_time() -> None:
    stalls = Stalls("supervisor", 0.0, 6.0, 0.5)
    correct(flown(Failure.MOTOR, stalls, height=110.0))


@pytest.mark.parametrize("vehicle", AIRCRAFT)
def test_a_person_deploys_once(vehicle: str) -> None:
    end = correct(flown(Failure.NOTHING, vehicle=vehicle, arms=True, person=Person("deploy", 1.0)))
    assert end.released < end.up + 1.5
    assert [one.decision.action for one in fired(end)] == [Action.KILL, Action.DEPLOY]
    assert end.answer.startswith("True: ")


def test_what_a_person_kills_falls_and_is_released() -> None:
    """The deploy follows the kill at once, so that there is no time to fall."""
    end = correct(flown(Failure.NOTHING, person=Person("kill", 1.0)))
    assert end.up + 1.0 < end.released < end.up + 1.3


def test_what_a_person_wants_and_no_parachute_hears_is_missed() -> None:
    flight = Flight(scenario(Failure.NOTHING, person=Person("deploy", 1.0)), SHIPPED)
    flight.rig.plugs["parachute"].hears = lambda data: False
    assert judge(flight.run()).count is Count.MISSED


def test_one_sensor_that_reads_nothing_deploys_nothing() -> None:
    fault = SensorFault("force", "zero", 0.5, 6.0)
    correct(flown(Failure.NOTHING, fault))


def test_the_same_seed_is_the_same_flight() -> None:
    once, again = (campaign.fly_here(FOLDER, draw(107))[0] for _ in range(2))
    assert repr(once) == repr(again)


@pytest.fixture(scope="module")
def every() -> list[Scenario]:
    return [draw(seed) for seed in range(3000)]


def test_every_scenario_is_drawn_within_its_bounds(every: list[Scenario]) -> None:
    assert {one.vehicle for one in every} == set(vehicles())
    assert {one.profile for one in every} == set(PROFILES)
    assert {one.failure for one in every} == set(Failure) - {Failure.TAPE}
    alone = [one for one in every if not one.second_sources]
    assert {faults(one) for one in alone} == set(range(MOST_FAULTS + 1))
    assert {faults(one) for one in every} == set(range(MOST_FAULTS + 2))
    assert {type(fault) for one in every for fault in one.faults} == {
        *(WayFault, Stop, Stalls, ClockJump, SensorFault, EstimatorFault, HomeMove)
    }
    flying = [one for one in every if not one.stands]
    assert all(12.0 <= one.height - min(one.ground, 0.0) <= 430.0 for one in flying)
    assert 0 < len(every) - len(flying) < 100
    assert repr(every[7]) == repr(draw(7))


def faults(one: Scenario) -> int:
    """A home that is set anew is no fault; restarts of one autopilot are one."""
    again = [f for f in one.faults if isinstance(f, Stop) and f.who == "autopilot"][1:]
    return sum(not isinstance(f, HomeMove) and f not in again for f in one.faults)


def test_every_world_is_drawn(every: list[Scenario]) -> None:
    flown = [one.manoeuvre.kind for one in every if one.manoeuvre]
    assert set(flown) == {"flip", "throw", "dive", "descent", "transition", "landing"}
    assert {one.manoeuvre.slope == 0.0 for one in every if one.lands} == {False, True}
    assert {one.flights for one in every} == {1, 2}
    assert {one.stands for one in every if one.deck} == {False, True}
    wrong = [f for one in every for f in one.faults if isinstance(f, EstimatorFault)]
    assert {one.how for one in wrong} == {"diverges", "leans", "hovers"}
    assert {one.autopilot.homing for one in every} == set(Homing)
    assert {one.autopilot.kind for one in every} == set(KINDS)
    assert {one.person.does for one in every if one.person} == {"deploy", "kill", "kill_only"}
    assert {one.autopilot.imus for one in every} == {1, 2}
    grounds = [one.ground for one in every]
    assert min(grounds) < -60.0 < 0.0 < max(grounds)
    assert grounds.count(0.0) > len(every) / 2
    assert len({one.descent.name for one in every if one.failure is Failure.STALL}) == 6
    for one in every:
        glides = one.failure is Failure.GLIDE
        assert not glides or one.descent.sink < SOFT < one.unheld.sink
        sinks = one.failure in (Failure.SINK, Failure.STALL)
        assert not sinks or one.descent.sink > SOFT
        own = one.profile == "fixed_wing" and one.failure is not Failure.MOTOR and not one.stands
        assert (one.unheld is not None) is own, "an aeroplane does not tumble"
    assert {one.canopy.carries for one in every} == {False, True}


def test_a_campaign_counts_every_flight_once() -> None:
    tallies = []
    tally = campaign.run(
        flown_here(BUNDLE, SHIPPED, range(100, 106), 2),
        lambda one: tallies.append(one.flights),
        campaign.Tally(),
    )
    assert tallies == [1, 2, 3, 4, 5, 6]
    assert sum(tally.counts.values()) == tally.flights == 6
    assert sum(tally.by_vehicle.values()) == 6
    assert tally.took > 0.0


def test_an_exception_in_a_flight_is_counted_and_ends_nothing(monkeypatch) -> None:
    def broken(*_: object) -> None:
        raise ValueError("the rig fell apart")

    monkeypatch.setattr(campaign, "fly", broken)
    tally = campaign.run(
        flown_here(BUNDLE, SHIPPED, range(2), 1), lambda _: None, campaign.Tally()
    )
    assert tally.counts[Count.BROKEN] == 2
    assert tally.wrong[0].why == "ValueError: the rig fell apart"
