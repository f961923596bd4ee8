"""Decisions and reports that are lost, late, doubled, overtaken or refused; orders that cross."""

import math
from dataclasses import replace
from typing import Any

import pytest
from story import (
    FLYING,
    LINK,
    SINKS,
    STANDING,
    START,
    TILTS,
    Story,
    changed,
    parachute,
    rule,
    with_rules,
)

from chute_ros.model import Action, Armed, LandedState, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import BelowMinimum
from chute_ros.supervisor.wakes import next_deadline

K, D = Action.KILL, Action.DEPLOY
UPF = "upf_can"
TWO = SupervisorConfig(deploy_links=(LINK, UPF))
STOP = i.KillRequest(1, "operator", "stop")
DEVICE_ASKS = i.KillRequest(0, "upf_can 33", "about to launch")
OUT, OTHER_OUT = parachute(deployed=True), parachute(UPF, "33", deployed=True)


def killing(asked: i.KillRequest, *outcomes: Outcome, t: float = 1.1) -> Story:
    """In flight, a kill asked for at 1.0, what became of it reported at t."""
    story = Story().flying()
    story.at(1.0, asked)
    if outcomes:
        story.at(t, *[story.report(K, one) for one in outcomes])
    return story


# -- a kill that is asked for again --------------------------------------------------------------


def test_a_kill_that_was_given_up_is_sent_anew_when_asked_for_again():
    story = killing(STOP)
    story.at(30.0)
    assert "the motors may still turn" in story.alarms()[0]
    story.at(30.0, i.KillRequest(2, "operator", "stop!"))
    assert len(story.decisions(K)) == 2
    assert story.answers(2) == []
    story.at(30.1, story.report(K, Outcome.CONFIRMED))
    assert story.answer(2).success


def test_a_person_who_sees_motors_turn_after_a_confirmed_kill_is_obeyed_again():
    story = killing(STOP, Outcome.CONFIRMED)
    story.at(2.0, i.KillRequest(2, "operator", "they turn"))
    assert len(story.decisions(K)) == 2
    assert story.answers(2) == []


def test_a_device_that_repeats_its_request_makes_no_new_decision_each_time():
    story = Story().flying()
    for tick in range(30):
        story.at(1.0 + tick * 0.1, DEVICE_ASKS)
        story.at(1.05 + tick * 0.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(K)) == 1
    story.at(8.0, DEVICE_ASKS)
    assert len(story.decisions(K)) == 2


@pytest.mark.parametrize(
    ("outcome", "at", "too_early", "again"),
    [
        # The kill's time is over.
        (Outcome.CONFIRMED, 1.5, 6.9375, 7.0),
        # Soon after a failure, but not for each of its messages.
        (Outcome.FAILED, 1.05, 1.06, 1.5),
    ],
)
def test_a_device_that_asks_again_is_obeyed_again_at_the_limit(outcome, at, too_early, again):
    story = killing(DEVICE_ASKS, outcome, t=at)
    for t, kills in ((too_early, 1), (again, 2)):
        story.at(t, DEVICE_ASKS)
        assert len(story.decisions(K)) == kills


def test_a_device_that_asks_while_the_motors_turn_again_is_obeyed_again():
    """A kill was confirmed, and undone since: the vehicle says that it is armed."""
    story = killing(DEVICE_ASKS, Outcome.CONFIRMED)
    story.at(3.0, i.VehicleReport(replace(FLYING, armed=Armed.DISARMED)))
    story.at(3.5, DEVICE_ASKS)
    assert len(story.decisions(K)) == 1, "it is still off"
    story.at(4.0, i.VehicleReport(FLYING))
    story.at(4.5, DEVICE_ASKS)
    assert len(story.decisions(K)) == 2


@pytest.mark.parametrize(
    ("after", "age", "kills"), [(0.2, 0.0, 1), (0.25, 0.0, 2), (1.0, 0.75, 2), (1.0, 0.9, 1)]
)
def test_only_what_the_vehicle_says_well_after_the_kill_undoes_it(after, age, kills):
    story = killing(DEVICE_ASKS, Outcome.CONFIRMED)
    said = (START + 1.0 + after) - START
    story.at(said, i.VehicleReport(replace(FLYING, armed_age=age)), DEVICE_ASKS)
    assert len(story.decisions(K)) == kills


def test_a_device_that_repeats_its_request_cannot_put_off_the_answer_to_a_person():
    story = Story().flying()
    story.at(1.0, OUT)
    story.at(1.0, STOP)
    for tick in range(80):
        story.at(1.1 + tick * 0.1, DEVICE_ASKS)
    assert not story.answer(1).success


def test_a_kill_that_fails_and_is_asked_for_again_and_again_does_not_put_off_the_deploy():
    story = Story().ordered()
    for tick in range(1, 12):
        story.at(1.0 + tick * 0.05, story.report(K, Outcome.FAILED, detail="no autopilot"))
        story.at(1.0 + tick * 0.05, DEVICE_ASKS)
    assert story.when(D) == pytest.approx(1.5)


def test_a_kill_that_a_device_asks_for_and_nobody_confirms_is_an_alarm():
    story = killing(DEVICE_ASKS)
    story.at(1.1, story.report(K, Outcome.FAILED, detail="no autopilot"))
    story.at(30.0)
    assert [text for text in story.alarms() if "motors may still turn" in text] == [
        "the motors may still turn, no kill confirmed: mavlink_parachute: no autopilot"
    ]


def test_a_confirmation_after_a_failure_counts_and_a_failure_after_it_undoes_nothing():
    story = Story().ordered()
    story.at(1.1, story.report(K, Outcome.FAILED))
    story.at(1.2, story.report(K, Outcome.CONFIRMED))
    assert story.when(D) == 1.2
    story = killing(STOP, Outcome.CONFIRMED, Outcome.FAILED)
    story.at(9.0)
    assert story.answer(1).success
    assert story.alarms() == []


def test_a_kill_after_a_failed_test_on_the_ground_is_none_in_flight():
    story = Story().ready()
    story.at(0.1, i.DeployRequest(5, True, "test"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    story.at(0.3, story.report(D, Outcome.FAILED))
    story.at(0.4, i.KillRequest(6, "operator", "stop"))
    story.at(0.5, story.report(K, Outcome.CONFIRMED))
    assert story.answer(6).success
    assert story.state.stage is Stage.FAULT
    assert not story.state.killing.killed_in_flight


# -- a deploy after a kill -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("outcomes", "asked", "deployed", "kills"),
    [
        ((Outcome.CONFIRMED,), 60.0, 60.0, 1),
        # The kill came to nothing: it failed, or was given up.
        ((Outcome.FAILED,), 20.0, 20.5, 2),
        ((), 20.0, 20.5, 2),
        # It joins one that is on its way, and leaves when that is due.
        ((), 1.3, 1.5, 1),
    ],
)
def test_a_deploy_after_a_kill_leaves_at_once_if_that_was_confirmed_or_kills_once_more(
    outcomes, asked, deployed, kills
):
    story = killing(STOP, *outcomes)
    story.at(asked, i.DeployRequest(2, False, "and now"))
    assert len(story.decisions(K)) == kills
    story.at(asked + 2.0)
    assert story.when(D) == pytest.approx(deployed)


def test_a_second_deploy_request_while_the_kill_runs_does_not_put_the_first_off():
    story = Story().ordered()
    story.at(1.1, story.report(K, Outcome.FAILED))
    story.at(1.4, i.DeployRequest(6, False, "now!"))
    story.at(3.0)
    assert story.when(D) == pytest.approx(1.5)
    assert len(story.decisions(K)) == 1


def test_a_person_who_joins_a_rules_deploy_is_held_back_by_no_height():
    minimum: dict[str, Any] = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}
    story = Story(with_rules(rule(SINKS), profile=minimum)).flying().fly(0.95, height=11.0)
    story.at(1.0, story.told(height=11.0, vertical_speed=-13.0))
    saw = story.newest(K).reasons
    for token in (5, 6):
        story.at(1.1, i.DeployRequest(token, False, f"it falls {token}"))
    story.at(1.2, story.heartbeat(), story.told(height=9.0, vertical_speed=-13.0))
    story.at(1.6, story.heartbeat())
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == "operator"
    assert story.newest(D).reasons == (
        *saw,
        "operator: it falls 5",
        "kill not confirmed after 0.50 s (limit 0.5 s)",
    )
    story.at(1.7, story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).success
    assert story.answer(6).success


def test_a_rule_that_joins_a_persons_deploy_leaves_it_theirs():
    story = Story(with_rules(rule(SINKS))).ordered()
    story.at(1.1, story.told(vertical_speed=-13.0))
    story.at(1.6)
    assert story.newest(D).rule == "operator"
    assert story.newest(D).reasons[0] == "operator: it falls"


@pytest.mark.parametrize(
    "said", [{"landed_state": LandedState.ON_GROUND}, {"armed": Armed.DISARMED}]
)
def test_what_it_said_before_a_kill_is_not_its_effect(said):
    for before, fired in ((said, ["KILL"]), ({}, ["KILL", "DEPLOY"])):
        story = Story(with_rules(rule(TILTS), profile={"landed_hold": 5.0})).flying()
        story.fly(0.95).fly(1.95, **before)
        story.at(2.0, story.heartbeat(), i.KillRequest(5, "operator", "it flies away"))
        story.at(2.1, story.report(K, Outcome.CONFIRMED))
        story.fly(4.0, **{**said, "armed": Armed.DISARMED, "tilt": 90.0})
        assert story.fired()[:2] == fired


# -- refused as older ----------------------------------------------------------------------------


def test_a_kill_that_a_node_missed_and_then_refuses_as_older_gets_a_new_number():
    for outcome in (None, Outcome.SENT):
        story = Story().ordered()
        first = story.newest(K)
        story.at(1.65)
        # Sent again under its number, which a node that has it takes for a repetition ...
        assert story.newest(K) == first
        if outcome is not None:
            story.at(1.65, story.report(D, outcome))
        # ... until one that saw the deploy first refuses it.
        story.at(1.66, story.report(K, Outcome.FAILED, detail="older"))
        assert story.newest(K).id > story.newest(D).id > first.id
        assert "saw a newer decision first" in story.newest(K).reasons[-1]
        # Refused as well although nothing is newer: that is a real failure.
        story.at(1.7, story.report(K, Outcome.FAILED))
        assert len(story.decisions(K)) == 2
        story.at(1.8, story.report(K, Outcome.CONFIRMED), story.report(D, Outcome.CONFIRMED))
        assert story.state.stage is Stage.DEPLOYED


def test_a_report_that_says_nothing_is_no_report():
    story = Story().deploying()
    story.at(1.15, story.report(D, Outcome.NONE))
    story.at(1.25)
    assert True in [again for _, _, again in story.sent(D)]


# -- epochs and restarts in between --------------------------------------------------------------


@pytest.mark.parametrize(
    ("outcome", "stage", "deploys"),
    [
        (Outcome.CONFIRMED, Stage.DEPLOYED, 1),
        (Outcome.ACCEPTED, Stage.DEPLOYING, 1),
        (Outcome.FAILED, Stage.DEPLOYING, 2),
    ],
)
def test_a_device_that_has_begun_under_the_old_epoch_is_not_told_to_begin_again(
    outcome, stage, deploys
):
    story = Story().deploying()
    number = story.newest(D).id
    story.at(1.2, i.ActionReport(7, number, LINK, outcome, "told", newest_epoch=900))
    assert story.state.epoch == 904
    assert (story.state.stage, len(story.decisions(D))) == (stage, deploys)
    assert story.newest(D).epoch == (904 if deploys == 2 else 7)
    if outcome is Outcome.ACCEPTED:
        story.at(1.3, i.ActionReport(7, number, LINK, Outcome.CONFIRMED, "deployed", 904))
    story.at(1.2 + 8.0)
    refused = outcome is Outcome.FAILED
    assert story.state.stage is (Stage.FAULT if refused else Stage.DEPLOYED)
    assert story.answer(5).success is not refused


def test_a_restart_of_a_node_that_deploys_nothing_fires_nothing_again():
    story = Story(SupervisorConfig(required_links=(LINK, "umbilical")))
    beat = i.LinkHeartbeat("umbilical", LinkState.OK, True, 50)
    story.at(0.0, story.heartbeat(), beat, i.VehicleReport(FLYING))
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.SENT))
    story.at(1.6)
    story.at(1.6, story.report(D, Outcome.SENT))
    story.at(1.7, i.LinkHeartbeat("umbilical", LinkState.OK, True, 0))
    assert story.fired() == ["KILL", "DEPLOY"]


def test_a_flight_block_does_not_overtake_a_deploy_on_its_way():
    story = Story(TWO).deploying()
    story.seq = -1
    before = len(story.decisions())
    story.at(1.2, story.heartbeat())
    assert [d.action for d in story.decisions()[before:]] == [D]


# -- when it ends --------------------------------------------------------------------------------


def test_nothing_more_is_sent_of_a_deploy_that_was_given_up_or_once_a_parachute_is_out():
    story = Story(SupervisorConfig(deploy_timeout=2.0, kill_timeout=6.0)).deploying()
    story.at(3.2)
    assert story.state.stage is Stage.FAULT
    out = Story(TWO).deploying()
    out.at(1.15, out.report(D, Outcome.CONFIRMED, link=UPF))
    for one, until in ((story, 7.0), (out, 12.0)):
        count = len(one.outputs)
        one.at(until)
        assert not [o for _, o in one.outputs[count:] if isinstance(o, i.Decide)]


def test_at_rest_nothing_wakes_it():
    story = Story().deploying()
    story.at(1.2, story.report(D, Outcome.CONFIRMED))
    story.at(30.0)
    assert math.isinf(next_deadline(story.config, story.state, START + story.t))


def test_the_same_alarm_is_kept_once_and_said_each_time():
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(11.0)
    for t in (11.0, 12.0):
        story.at(t, story.heartbeat(healthy=False), i.VehicleReport(STANDING))
        story.at(t + 0.1, i.VehicleReport(FLYING))
    assert len(story.alarms()) == 2
    assert len(story.state.alarming.alarms) == 1


# -- parachutes that were out before -------------------------------------------------------------


def out_before() -> Story:
    """In flight since 0.2; the second of two parachutes was out on the ground."""
    story = Story(TWO).ready()
    story.at(0.1, OTHER_OUT, i.VehicleReport(STANDING))
    story.at(0.2, i.VehicleReport(FLYING), story.heartbeat())
    assert story.state.stage is Stage.IN_FLIGHT
    return story


def test_one_that_was_out_before_the_flight_stops_no_motors_also_if_it_was_lost_a_while():
    story = out_before()
    assert story.decisions(K) == []
    story.at(0.3, parachute(UPF, "33", True, alive=False))
    story.at(0.4, OTHER_OUT)
    assert story.decisions(K) == []


def test_one_that_was_out_before_the_flight_does_not_stand_for_the_one_that_is_needed():
    story = out_before()
    story.at(1.0, i.DeployRequest(5, False, "it falls"), story.heartbeat())
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 1
    assert story.answers(5) == []
    story.at(1.2, OUT)
    story.at(1.8)
    assert story.answer(5).success


def test_one_that_is_packed_again_counts_again():
    story = Story(TWO).ready()
    story.at(0.1, OTHER_OUT, i.VehicleReport(STANDING))
    story.at(0.2, parachute(UPF, "33"))
    story.at(0.3, i.VehicleReport(FLYING))
    story.at(0.4, OTHER_OUT)
    assert story.state.stage is Stage.DEPLOYED
    assert len(story.decisions(K)) == 1


def test_under_an_open_canopy_the_motors_stop_whatever_starts_or_is_wrong_meanwhile():
    starts = Story()
    starts.at(0.0, starts.heartbeat(healthy=False), OUT, i.VehicleReport(FLYING))
    wrong = Story().flying()
    wrong.at(1.0, OUT, i.VehicleReport(STANDING))
    wrong.at(1.5, wrong.heartbeat(), i.VehicleReport(FLYING))
    for story in (starts, wrong):
        assert story.state.stage is Stage.DEPLOYED
        assert len(story.decisions(K)) == 1


def test_motors_that_are_armed_again_under_a_canopy_are_stopped_again():
    story = Story().deploying()
    story.at(1.2, OUT, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYED
    off = replace(FLYING, armed=Armed.DISARMED)
    for t in (1.3, 1.8, 2.3):
        story.at(t, OUT, i.VehicleReport(off))
    assert len(story.decisions(K)) == 1
    for t in (2.5, 2.6, 2.7):
        story.at(t, OUT, i.VehicleReport(FLYING))
    assert len(story.decisions(K)) == 2, "once for each time that they are armed"
    assert story.state.stage is Stage.DEPLOYED
    assert len(story.decisions(D)) == 1
    assert "armed again under a canopy that is out" in story.alarms()[-1]
    story.at(2.8, OUT, i.VehicleReport(off), story.report(K, Outcome.CONFIRMED))
    story.at(3.3, OUT, i.VehicleReport(FLYING))
    assert len(story.decisions(K)) == 3


def test_an_armed_state_of_before_the_kill_stops_no_motors_twice():
    story = Story().deploying()
    story.at(1.2, OUT, story.report(K, Outcome.CONFIRMED), i.VehicleReport(FLYING))
    story.at(1.4, OUT, i.VehicleReport(replace(FLYING, armed_age=0.35)))
    assert len(story.decisions(K)) == 1


def test_a_forced_test_on_the_ground_is_not_answered_by_what_was_out_before():
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False), OUT)
    story.at(0.1, i.DeployRequest(1, True, "test"))
    assert story.answers(1) == []
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 1


def test_after_a_reset_what_is_out_is_known_to_be_out():
    story = Story().deploying()
    story.at(1.2, OUT)
    story.at(20.0, i.VehicleReport(STANDING))
    story.at(20.1, i.ResetRequest(8))
    assert story.answer(8).success
    story.at(20.2, story.heartbeat(), i.VehicleReport(FLYING))
    assert story.state.stage is Stage.IN_FLIGHT
    assert len(story.decisions(K)) == 1


# -- what is refused, and what not ---------------------------------------------------------------


def test_a_reset_without_a_vehicle_state_does_not_stop_a_deploy_on_its_way():
    story = Story().ordered()
    story.state = changed(story.state, vehicle_received=math.nan)
    story.at(1.1, i.ResetRequest(2))
    assert "a deploy is under way" in story.answer(2).message
    story.at(2.0)
    assert len(story.decisions(D)) == 1


def test_a_parachute_is_disarmed_on_the_ground_after_a_kill_but_not_while_a_deploy_goes_on():
    story = killing(STOP)
    story.at(1.1, i.ArmRequest(2, False, 0))
    assert "not disarmed in flight" in story.answer(2).message
    outputs = story.at(5.0, i.VehicleReport(STANDING), i.ArmRequest(3, False, 0))
    assert i.ArmDevices(3, False, 0, (LINK,)) in outputs
    story = Story().ordered()
    story.at(1.1, i.VehicleReport(STANDING), i.ArmRequest(3, False, 0))
    assert "not disarmed in flight" in story.answer(3).message


def test_in_shadow_all_that_would_have_been_done_is_said_with_its_rule_and_reasons():
    story = Story(with_rules(rule(SINKS)), mode=i.Mode.SHADOW).flying()
    story.at(0.1, STOP)
    story.at(0.2, i.DeployRequest(6, False, "it falls"))
    said = [(d.action, d.rule, d.reasons) for d in story.decisions() if d.action >= K]
    assert said == [
        (K, "operator", ("operator: stop",)),
        (K, "operator", ("operator: it falls",)),
        (D, "operator", ("operator: it falls",)),
    ]
    assert all(d.shadow for d in story.decisions())
    for one, name in ((DEVICE_ASKS, "device asks for a kill"), (OUT, "parachute open")):
        story = Story(mode=i.Mode.SHADOW).flying()
        story.at(1.0, one)
        assert [(d.rule, d.shadow) for d in story.decisions(K)] == [(name, True)]
        assert story.state.killing.kill is None


@pytest.mark.parametrize("wanted", [K, D])
def test_the_log_says_what_a_rule_saw(wanted):
    seen = rule(SINKS, action=wanted, hold=0.5, samples=3)
    story = Story(with_rules(seen)).flying().fly(1.0, vertical_speed=-13.0)
    (kill,) = story.decisions(K)
    assert kill.rule == "tested"
    assert kill.reasons[0] == "vertical_speed -13.00 (below -12)"
    assert kill.reasons[1].startswith("counter 0.5")
    assert f"IN_FLIGHT -> KILLING: a kill was decided ({'; '.join(kill.reasons)})" in story.said()


def test_the_log_says_what_a_person_wanted():
    said = killing(STOP).said()
    assert "IN_FLIGHT -> KILLING: a kill was decided (operator: stop)" in said
