"""After a kill in flight: what has come down is lifted, plugged in again, flown again."""

import math
from dataclasses import replace

import pytest
from story import DOWN, START, Story, shipped

from chute_ros.model import Action, Armed, LandedState, LinkState, Outcome, VehicleState
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.wakes import next_deadline

K, D = Action.KILL, Action.DEPLOY
BOTH_AIRCRAFT = pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
STANDS = {"height": 0.0, "vertical_speed": 0.0, **DOWN}


def killed(profile: str = "multirotor", outcome: Outcome = Outcome.CONFIRMED) -> Story:
    """A person has stopped the motors 9 m above the ground."""
    story = Story(shipped(profile)).ready().fly(2.0, height=12.0).fly(3.0, height=9.0)
    story.at(
        3.05,
        story.heartbeat(),
        story.told(height=9.0),  # too low for a deploy to follow at once
        i.KillRequest(9, "operator", "stop"),
    )
    story.at(3.1, story.heartbeat(), story.report(K, outcome))
    return story


def lifted(story: Story) -> Story:
    """The autopilot is unplugged; its IMU, on a supply of its own, is tilted by who carries it."""
    unplugged = story.t
    for step in range(200):
        tilt = 3.0 if step < 100 else min(75.0, 3.0 * (step - 98))
        since = story.t - unplugged
        state = VehicleState(
            link_state=LinkState.LOST,
            armed=Armed.DISARMED,
            armed_age=since,
            landed_state=LandedState.ON_GROUND,
            landed_state_age=since,
            tilt=math.radians(tilt + step % 7 * 0.01),
            attitude_age=0.0,
            acceleration=9.8 + step % 7 * 0.02,
            acceleration_age=0.0,
        )
        story.at(story.t + 0.05, story.heartbeat(), i.VehicleReport(state))
    return story


@BOTH_AIRCRAFT
def test_who_lifts_it_a_minute_later_is_not_met_by_its_canopy(profile):
    story = killed(profile).fly(60.0, every=0.2, **STANDS)
    assert story.newest(Action.FLIGHT_BLOCK).id > story.newest(K).id
    assert lifted(story).fired() == ["KILL"]
    assert "the vehicle is KILLING, not in flight" in story.said()


@pytest.mark.parametrize(("stands", "in_flight"), [(9.9, True), (10.1, False)])
def test_it_has_come_down_for_good_once_it_has_stood_for_ten_seconds(stands, in_flight):
    story = killed().fly(4.0, **STANDS)
    story.fly(round(story.state.flight.down_since - START + stands, 2), **STANDS)
    assert story.state.killing.killed_in_flight is in_flight
    assert story.state.flight.airborne is in_flight
    if not in_flight:
        assert not math.isnan(story.state.flight.landed_at)


def test_the_core_wakes_by_itself_when_it_has_come_down_for_good():
    story = killed().fly(4.0, **STANDS)
    due = flight.down_after_kill_at(story.config, story.state)
    assert due == story.state.flight.down_since + 10.0
    story.fly(round(due - START - 0.06, 2), **STANDS)
    assert next_deadline(story.config, story.state, START + story.t) <= due


def test_one_that_falls_on_while_its_speed_is_not_told_for_a_moment_is_deployed():
    """Given a steady fall that its land detector takes for standing still."""
    story = killed()
    told = {**DOWN, "tilt": 5.0, "height": math.nan}
    story.fly(6.0, vertical_speed=math.nan, **told)
    story.fly(9.0, vertical_speed=-14.0, **told)
    assert story.fired() == ["KILL", "DEPLOY"]


def test_one_that_a_deploy_follows_has_not_come_down_for_it():
    story = killed().fly(5.0, **STANDS)
    story.state = replace(
        story.state,
        deploying=replace(story.state.deploying, deploy_rule="falling", deploy_due=START + 100.0),
    )
    story.fly(20.0, **{**STANDS, "height": math.nan})  # too low for one, as far as it is known
    assert story.state.killing.killed_in_flight


def test_a_battery_plugged_in_a_minute_after_the_crash_deploys_nothing():
    """Given one that lies on its side, without power since the impact: it never said it landed."""
    story = killed()
    crashed = story.t
    while story.t < 64.0:
        since = story.t - crashed
        state = VehicleState(
            link_state=LinkState.LOST if since > 2.5 else LinkState.OK,
            armed=Armed.DISARMED,
            armed_age=since,
            landed_state=LandedState.IN_AIR,
            landed_state_age=since,
            uptime=300.0,
        )
        story.at(story.t + 0.1, story.heartbeat(), i.VehicleReport(state))
    while story.t < 70.0:
        told = story.told(**{**STANDS, "tilt": 95.0}).state
        told = replace(told, reboot_count=1, rebooted_in_flight=True, uptime=story.t - 60.0)
        story.at(story.t + 0.05, story.heartbeat(), i.VehicleReport(told))
    assert story.fired() == ["KILL"]
    assert "denied, the vehicle says that it stands" in story.said()


def test_flown_again_it_is_in_flight_again():
    story = killed().fly(30.0, **STANDS).fly(31.0, height=0.0, vertical_speed=0.0)
    story.fly(35.0, height=30.0)
    assert story.state.stage is Stage.IN_FLIGHT
    story.fall(38.0, height=60.0)
    assert story.fired() == ["KILL", "KILL", "DEPLOY"]


@pytest.mark.parametrize("restarts", [False, True])
def test_a_kill_that_failed_is_not_sent_in_the_next_flight(restarts):
    story = killed(outcome=Outcome.FAILED).fly(20.0, every=0.1)
    story.fly(60.0, every=0.2, **STANDS)
    story.fly(61.0, height=0.0, vertical_speed=0.0).fly(80.0, every=0.2)
    story.at(81.5, story.told())  # its node is silent meanwhile
    if restarts:
        story.seq = 0
    story.fly(85.0, every=0.1)
    assert len(story.decisions(K)) == 1


@pytest.mark.parametrize(("later", "again"), [(7.0, True), (9.0, False)])
def test_a_node_that_is_back_is_told_of_a_kill_that_is_still_meant(later, again):
    story = Story(shipped("multirotor")).ready().fly(3.0)
    story.at(3.05, i.KillRequest(9, "operator", "stop", kill_only=True))
    story.at(3.1, story.told(), story.report(K, Outcome.FAILED))
    story.at(3.05 + later, story.told(), story.heartbeat())
    assert len(story.decisions(K)) == 1 + again
