"""Decisions and reports that are lost, late, doubled, overtaken or refused; orders that cross."""

import math
from dataclasses import replace

import pytest
from story import FLYING, LINK, STANDING, START, Story, changed, parachute

from chute_ros.model import Action, Armed, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.wakes import next_deadline

K, D = Action.KILL, Action.DEPLOY
TWO = SupervisorConfig(deploy_links=(LINK, "upf_can"))


def out(link: str = LINK, device: str = "1/161", deployed: bool = True) -> i.ParachuteReport:
    return parachute(link, device, deployed, ())


def falling(config: SupervisorConfig | None = None) -> Story:
    """In flight, deploy asked for at t = 1 (token 5)."""
    story = Story(config or SupervisorConfig()).flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    return story


def deploying(config: SupervisorConfig | None = None) -> Story:
    """The same, the kill confirmed at 1.1."""
    story = falling(config)
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    return story


def sent(story: Story, start: float = 0.0) -> list[tuple[Action, bool]]:
    """Kills and deploys in the order in which they left; True: again."""
    return [
        (o.decision.action, o.again)
        for t, o in story.outputs
        if t >= start and isinstance(o, i.Decide) and o.decision.action in (K, D)
    ]


# -- a kill that is asked for again ---------------------------------------------------------------


def test_a_kill_that_was_given_up_is_sent_anew_when_asked_for_again() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(30.0)
    assert "the motors may still turn" in story.alarms()[0]
    story.at(30.0, i.KillRequest(2, "operator", "stop!"))
    assert len(story.decisions(K)) == 2
    assert story.answers(2) == []
    story.at(30.1, story.report(K, Outcome.CONFIRMED))
    assert story.answer(2).success


def test_a_person_who_sees_motors_turn_after_a_confirmed_kill_is_obeyed_again() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(2.0, i.KillRequest(2, "operator", "they turn"))
    assert len(story.decisions(K)) == 2
    assert story.answers(2) == []


def test_a_device_that_repeats_its_request_makes_no_new_decision_each_time() -> None:
    story = Story().flying()
    ask = i.KillRequest(0, "upf_can 33", "about to launch")
    for tick in range(30):
        story.at(1.0 + tick * 0.1, ask)
        story.at(1.05 + tick * 0.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(K)) == 1
    story.at(8.0, ask)
    assert len(story.decisions(K)) == 2


def test_a_device_that_asks_while_the_motors_turn_again_is_obeyed_again() -> None:
    """A kill was confirmed, and undone since: the vehicle says that it is armed."""
    story = Story().flying()
    ask = i.KillRequest(0, "upf_can 33", "about to launch")
    story.at(1.0, ask)
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(3.0, i.VehicleReport(replace(FLYING, armed=Armed.DISARMED)))
    story.at(3.5, ask)
    assert len(story.decisions(K)) == 1, "it is still off"
    story.at(4.0, i.VehicleReport(FLYING))
    story.at(4.5, ask)
    assert len(story.decisions(K)) == 2


def test_what_the_vehicle_said_before_the_kill_does_not_undo_it() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(0, "upf_can 33", "about to launch"))
    story.at(1.05, story.report(K, Outcome.CONFIRMED))
    story.at(1.1, i.VehicleReport(FLYING), i.KillRequest(0, "upf_can 33", "again"))
    assert len(story.decisions(K)) == 1


def test_a_device_that_repeats_its_request_cannot_put_off_the_answer_to_a_person() -> None:
    story = Story().flying()
    story.at(1.0, out())
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    for tick in range(80):
        story.at(1.1 + tick * 0.1, i.KillRequest(0, "upf_can 33", "launched"))
    assert not story.answer(1).success


def test_a_kill_that_fails_and_is_asked_for_again_and_again_does_not_put_off_the_deploy() -> None:
    story = falling()
    for tick in range(1, 12):
        story.at(1.0 + tick * 0.05, story.report(K, Outcome.FAILED, detail="no autopilot"))
        story.at(1.0 + tick * 0.05, i.KillRequest(0, "upf_can 33", "launching"))
    assert story.when(D) == pytest.approx(1.5)


def test_a_kill_that_a_device_asks_for_and_nobody_confirms_is_an_alarm() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(0, "upf_can 33", "about to launch"))
    story.at(1.1, story.report(K, Outcome.FAILED, detail="no autopilot"))
    story.at(30.0)
    assert [text for text in story.alarms() if "motors may still turn" in text] == [
        "the motors may still turn, no kill confirmed: mavlink_parachute: no autopilot"
    ]


def test_a_confirmation_after_a_failure_counts() -> None:
    story = falling()
    story.at(1.1, story.report(K, Outcome.FAILED))
    story.at(1.2, story.report(K, Outcome.CONFIRMED))
    assert story.when(D) == 1.2


def test_a_failure_after_the_confirmation_undoes_nothing() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED), story.report(K, Outcome.FAILED))
    story.at(9.0)
    assert story.answer(1).success
    assert story.alarms() == []


# -- a deploy after a kill ------------------------------------------------------------------------


def test_a_deploy_after_a_confirmed_kill_leaves_at_once() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(60.0, i.DeployRequest(2, False, "and now"))
    assert story.when(D) == 60.0
    assert len(story.decisions(K)) == 1


@pytest.mark.parametrize("failed", [True, False], ids=["failed", "given up"])
def test_a_deploy_after_a_kill_that_came_to_nothing_kills_once_more_first(failed: bool) -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    if failed:
        story.at(1.1, story.report(K, Outcome.FAILED))
    story.at(20.0, i.DeployRequest(2, False, "and now"))
    assert len(story.decisions(K)) == 2
    story.at(21.0)
    assert story.when(D) == pytest.approx(20.5)


def test_a_deploy_joins_a_kill_on_its_way_and_leaves_when_that_is_due() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.3, i.DeployRequest(2, False, "and now"))
    story.at(3.0)
    assert story.when(D) == pytest.approx(1.5)
    assert len(story.decisions(K)) == 1


def test_a_second_deploy_request_while_the_kill_runs_does_not_put_the_first_off() -> None:
    story = falling()
    story.at(1.1, story.report(K, Outcome.FAILED))
    story.at(1.4, i.DeployRequest(6, False, "now!"))
    story.at(3.0)
    assert story.when(D) == pytest.approx(1.5)
    assert len(story.decisions(K)) == 1


def test_a_kill_without_a_report_leaves_once_more_directly_before_the_deploy() -> None:
    story = falling()
    story.at(1.55)
    order = sent(story, 1.5 - 1e-9)
    assert order[: order.index((D, False))] == [(K, True)]
    # And once more each time that the deploy is said again.
    again = order[order.index((D, False)) + 1 :]
    assert again
    assert again == [(K, True), (D, True)] * (len(again) // 2)


# -- refused as older -----------------------------------------------------------------------------


def test_a_kill_that_a_node_missed_and_then_refuses_as_older_gets_a_new_number() -> None:
    story = falling()
    story.at(1.6)
    story.at(1.6, story.report(D, Outcome.SENT))
    story.at(1.7, story.report(K, Outcome.FAILED, detail="older"))
    assert len(story.decisions(K)) == 2
    assert story.newest(K).id > story.newest(D).id
    assert "saw a newer decision first" in story.newest(K).reasons[-1]
    # Refused as well although nothing is newer: that is a real failure.
    story.at(1.8, story.report(K, Outcome.FAILED))
    assert len(story.decisions(K)) == 2


def test_a_deploy_that_a_later_kill_overtook_gets_a_new_number() -> None:
    story = deploying()
    story.at(1.2, i.KillRequest(7, "operator", "stop!"))
    story.at(1.3, story.report(K, Outcome.SENT), story.report(D, Outcome.FAILED, detail="older"))
    assert story.state.stage is Stage.DEPLOYING
    assert len(story.decisions(D)) == 2
    assert story.newest(D).id > story.newest(K).id
    story.at(1.4, story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).success


def test_a_failure_after_it_was_sent_is_no_refusal() -> None:
    story = falling()
    story.at(1.2, story.report(K, Outcome.SENT))
    story.at(1.7, story.report(K, Outcome.FAILED, detail="no acknowledgement"))
    assert len(story.decisions(K)) == 1


def test_a_report_that_says_nothing_is_no_report() -> None:
    story = deploying()
    story.at(1.15, story.report(D, Outcome.NONE))
    story.at(1.25)
    assert (D, True) in sent(story)


# -- epochs and restarts in between ---------------------------------------------------------------


def test_a_device_that_confirmed_under_the_old_epoch_is_not_fired_again() -> None:
    story = deploying()
    deploy = story.newest(D)
    report = i.ActionReport(7, deploy.id, LINK, Outcome.CONFIRMED, "deployed", newest_epoch=900)
    story.at(1.2, report)
    assert story.state.stage is Stage.DEPLOYED
    assert len(story.decisions(D)) == 1
    assert story.answer(5).success


def test_a_device_that_has_begun_under_the_old_epoch_is_not_told_to_begin_again() -> None:
    story = deploying()
    deploy = story.newest(D)
    story.at(1.2, i.ActionReport(7, deploy.id, LINK, Outcome.ACCEPTED, "acknowledged", 900))
    assert story.state.epoch == 904
    assert len(story.decisions(D)) == 1
    story.at(1.3, i.ActionReport(7, deploy.id, LINK, Outcome.CONFIRMED, "deployed", 904))
    assert story.state.stage is Stage.DEPLOYED


def test_a_device_that_refused_the_old_epoch_is_told_under_the_new_one() -> None:
    story = deploying()
    deploy = story.newest(D)
    story.at(1.2, i.ActionReport(7, deploy.id, LINK, Outcome.FAILED, "older", newest_epoch=900))
    assert story.state.stage is Stage.DEPLOYING
    assert story.newest(D).epoch == 904
    story.at(1.2 + 8.0)
    assert story.state.stage is Stage.FAULT


def test_a_restart_of_a_node_that_deploys_nothing_fires_nothing_again() -> None:
    story = Story(SupervisorConfig(required_links=(LINK, "umbilical")))
    beat = i.LinkHeartbeat("umbilical", LinkState.OK, True, 50)
    story.at(0.0, story.heartbeat(), beat, i.VehicleReport(FLYING))
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.SENT))
    story.at(1.6)
    story.at(1.6, story.report(D, Outcome.SENT))
    story.at(1.7, i.LinkHeartbeat("umbilical", LinkState.OK, True, 0))
    assert len(story.decisions(K)) == 1
    assert len(story.decisions(D)) == 1


def test_a_flight_block_does_not_overtake_a_deploy_on_its_way() -> None:
    story = deploying(TWO)
    story.seq = -1
    before = len(story.decisions())
    story.at(1.2, story.heartbeat())
    assert [d.action for d in story.decisions()[before:]] == [D]


# -- when it ends ---------------------------------------------------------------------------------


def test_a_deploy_that_was_given_up_is_not_sent_to_a_node_that_comes_later() -> None:
    story = deploying(SupervisorConfig(deploy_timeout=2.0, kill_timeout=6.0))
    story.at(3.2)
    assert story.state.stage is Stage.FAULT
    count = len(story.outputs)
    story.at(7.0)
    assert not [o for _, o in story.outputs[count:] if isinstance(o, i.Decide)]


def test_a_deploy_stops_when_a_parachute_is_out() -> None:
    story = deploying(TWO)
    story.at(1.15, story.report(D, Outcome.CONFIRMED, link="upf_can"))
    count = len(story.outputs)
    story.at(12.0)
    assert not [o for _, o in story.outputs[count:] if isinstance(o, i.Decide)]


def test_at_rest_nothing_wakes_it() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.CONFIRMED))
    story.at(30.0)
    assert math.isinf(next_deadline(story.config, story.state, START + story.t))


def test_the_same_alarm_is_kept_once_and_said_each_time() -> None:
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(11.0)
    for t in (11.0, 12.0):
        story.at(t, story.heartbeat(healthy=False), i.VehicleReport(STANDING))
        story.at(t + 0.1, i.VehicleReport(FLYING))
    assert len(story.alarms()) == 2
    assert len(story.state.alarming.alarms) == 1


# -- parachutes that were out before --------------------------------------------------------------


def test_one_that_was_out_before_the_flight_stops_no_motors_at_take_off() -> None:
    story = Story(TWO).ready()
    story.at(0.1, out("upf_can", "33"), i.VehicleReport(STANDING))
    story.at(0.2, i.VehicleReport(FLYING))
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.decisions(K) == []


def test_one_that_was_out_before_the_flight_does_not_stand_for_the_one_that_is_needed() -> None:
    story = Story(TWO).ready()
    story.at(0.1, out("upf_can", "33"), i.VehicleReport(STANDING))
    story.at(0.2, i.VehicleReport(FLYING), story.heartbeat())
    story.at(1.0, i.DeployRequest(5, False, "it falls"), story.heartbeat())
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 1
    assert story.answers(5) == []
    story.at(1.2, out())
    story.at(1.8)
    assert story.answer(5).success


def test_one_that_is_packed_again_counts_again() -> None:
    story = Story(TWO).ready()
    story.at(0.1, out("upf_can", "33"), i.VehicleReport(STANDING))
    story.at(0.2, out("upf_can", "33", deployed=False))
    story.at(0.3, i.VehicleReport(FLYING))
    story.at(0.4, out("upf_can", "33"))
    assert story.state.stage is Stage.DEPLOYED
    assert len(story.decisions(K)) == 1


def test_a_supervisor_that_starts_under_the_open_canopy_stops_the_motors() -> None:
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False), out(), i.VehicleReport(FLYING))
    assert story.state.stage is Stage.DEPLOYED
    assert len(story.decisions(K)) == 1


def test_a_landed_state_that_is_wrong_while_the_canopy_opens_hides_nothing() -> None:
    story = Story().flying()
    story.at(1.0, out(), i.VehicleReport(STANDING))
    story.at(1.5, story.heartbeat(), i.VehicleReport(FLYING))
    assert story.state.stage is Stage.DEPLOYED
    assert len(story.decisions(K)) == 1


def test_one_that_was_out_before_and_was_lost_for_a_while_is_no_news_in_flight() -> None:
    story = Story(TWO).ready()
    story.at(0.1, out("upf_can", "33"), i.VehicleReport(STANDING))
    story.at(0.2, i.VehicleReport(FLYING))
    story.at(0.3, parachute("upf_can", "33", True, (), alive=False))
    story.at(0.4, out("upf_can", "33"))
    assert story.decisions(K) == []


def test_a_forced_test_on_the_ground_is_not_answered_by_what_was_out_before() -> None:
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False), out())
    story.at(0.1, i.DeployRequest(1, True, "test"))
    assert story.answers(1) == []
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 1


def test_after_a_reset_what_is_out_is_known_to_be_out() -> None:
    story = deploying()
    story.at(1.2, out())
    story.at(20.0, i.VehicleReport(STANDING))
    story.at(20.1, i.ResetRequest(8))
    assert story.answer(8).success
    story.at(20.2, story.heartbeat(), i.VehicleReport(FLYING))
    assert story.state.stage is Stage.IN_FLIGHT
    assert len(story.decisions(K)) == 1


# -- what is refused, and what not ----------------------------------------------------------------


def test_without_a_vehicle_state_the_refusal_says_that_nothing_is_known() -> None:
    story = Story()
    story.at(0.0, story.heartbeat())
    story.at(0.1, i.DeployRequest(1, False, "it falls"))
    assert "nothing fresh says whether it is in the air" in story.answer(1).message


def test_a_reset_without_a_vehicle_state_does_not_stop_a_deploy_on_its_way() -> None:
    story = falling()
    story.state = changed(story.state, vehicle_received=math.nan)
    story.at(1.1, i.ResetRequest(2))
    assert "a deploy is under way" in story.answer(2).message
    story.at(2.0)
    assert len(story.decisions(D)) == 1


def test_after_a_kill_a_person_may_disarm_the_parachute_on_the_ground() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.1, i.ArmRequest(2, False, 0))
    assert "not disarmed in flight" in story.answer(2).message
    outputs = story.at(5.0, i.VehicleReport(STANDING), i.ArmRequest(3, False, 0))
    assert i.ArmDevices(3, False, 0, (LINK,)) in outputs


def test_a_deploy_on_its_way_is_not_disarmed_by_a_wrong_landed_state() -> None:
    story = falling()
    story.at(1.1, i.VehicleReport(STANDING), i.ArmRequest(3, False, 0))
    assert "not disarmed in flight" in story.answer(3).message


def test_shadow_says_that_it_would_have_stopped_the_motors_under_an_open_canopy() -> None:
    story = Story(mode=i.Mode.SHADOW).flying()
    story.at(1.0, out())
    assert [d.shadow for d in story.decisions(K)] == [True]
    assert story.state.killing.kill is None


def test_shadow_names_the_device_that_asked() -> None:
    story = Story(mode=i.Mode.SHADOW).flying()
    story.at(1.0, i.KillRequest(0, "upf_can 33", "launching"))
    assert story.newest(K).rule == "device asks for a kill"


def test_a_mode_that_comes_and_goes_within_one_turn_stops_the_deploy() -> None:
    story = deploying()
    story.at(
        1.2,
        i.ModeRequest(1, i.Mode.INHIBITED, True),
        i.ModeRequest(2, i.Mode.ACTIVE, True),
        i.DeployRequest(3, False, "it falls still"),
    )
    assert not story.answer(5).success
    assert story.state.stage is Stage.KILLING
    story.at(1.3, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 2
