"""Arm, kill, deploy, reset and mode: what is done, what is refused, each answer in its words."""

from dataclasses import replace
from operator import attrgetter

import pytest
from story import (
    DOWN,
    IDLING,
    LINK,
    SINKS,
    STANDING,
    START,
    Story,
    parachute,
    refused,
    rule,
    vehicle,
    with_rules,
)

from chute_ros.model import Action, Armed, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor import readings
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.pending import ASK_LASTS
from chute_ros.supervisor.requests import MOST_DEVICE_BLOCKS
from chute_ros.supervisor.rules import Clears
from chute_ros.supervisor.state import State

K, D = Action.KILL, Action.DEPLOY
BLOCK, RELEASE = Action.FLIGHT_BLOCK, Action.FLIGHT_BLOCK_RELEASE
ASKED = DeviceCondition(DeviceFact.ASKS_FOR_KILL)
STOP = i.KillRequest(1, "operator", "stop")
SMOKE = i.KillRequest(0, "upf_can 33", "smoke")
FALLS = i.DeployRequest(1, False, "it falls")


def ready() -> Story:
    return Story().ready()


def flying() -> Story:
    return Story().flying()


def in_shadow() -> Story:
    return Story(mode=i.Mode.SHADOW).flying()


def on_ground_in_shadow() -> Story:
    return Story(mode=i.Mode.SHADOW).ready()


def inhibited() -> Story:
    return Story(mode=i.Mode.INHIBITED).flying()


def follower() -> Story:
    return flying().follows()


def on_trial() -> Story:
    """A forced deploy is under way."""
    story = ready()
    story.at(0.1, i.DeployRequest(9, True, "test"))
    return story


def killed_and_down() -> Story:
    """Killed in flight at 1.0 by a person, on the ground since 1.2."""
    story = flying().fly(0.95)
    story.at(1.0, STOP)
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.heartbeat(), story.told(**DOWN))
    assert story.state.stage is Stage.KILLING
    return story


CALL_AGAIN = "another supervisor decides, call again"
NOT_SENT = "mode is SHADOW; nothing is sent"


@pytest.mark.parametrize(
    ("given", "asked", "why"),
    [
        (flying, i.ArmRequest(1, False, 0), "the vehicle is IN_FLIGHT: not disarmed in flight"),
        (on_trial, i.ArmRequest(1, False, 0), "the vehicle is KILLING: not disarmed in flight"),
        (in_shadow, STOP, NOT_SENT),
        (in_shadow, FALLS, NOT_SENT),
        (inhibited, STOP, "mode is INHIBITED; nothing is sent"),
        (inhibited, FALLS, "mode is INHIBITED; nothing is sent"),
        # Force would send nothing either, and is no remedy to name.
        (on_ground_in_shadow, FALLS, NOT_SENT),
        (ready, FALLS, "the vehicle is READY, not in flight; force deploys all the same"),
        (flying, i.ResetRequest(1), "the vehicle is in the air"),
        (Story, i.ResetRequest(1), "the vehicle is STARTUP"),
        (
            flying,
            i.ModeRequest(1, i.Mode.SHADOW, force=False),
            "the vehicle is IN_FLIGHT; force changes it all the same",
        ),
        (
            flying,
            i.ModeRequest(1, i.Mode.INHIBITED, force=False),
            "the vehicle is IN_FLIGHT; force changes it all the same",
        ),
        (follower, STOP, CALL_AGAIN),
        (follower, i.ArmRequest(1, True, 0), CALL_AGAIN),
        (follower, i.DeployRequest(1, True, "now"), CALL_AGAIN),
        (follower, i.ResetRequest(1), CALL_AGAIN),
        (follower, i.ModeRequest(1, i.Mode.SHADOW, force=True), CALL_AGAIN),
    ],
)
def test_a_request_is_refused_in_whole_words_and_nothing_is_sent(given, asked, why):
    story = given()
    story.at(0.15)
    before, stage, mode = len(story.decisions()), story.state.stage, story.state.mode
    story.at(0.2, asked)
    assert story.answers(1) == [refused(1, why)]
    assert all(decision.shadow for decision in story.decisions()[before:])
    assert (story.state.stage, story.state.mode) == (stage, mode)


# -- arming --------------------------------------------------------------------------------------


def test_arming_goes_to_the_devices_and_counts_when_they_have_done_it():
    story = ready()
    outputs = story.at(0.1, i.ArmRequest(1, True, 4))
    assert i.ArmDevices(1, True, 4, (LINK,)) in outputs
    story.at(0.2, i.ArmDone(2, True, False, "denied"))
    assert story.answer(2) == i.Finish(2, False, False, "denied")
    assert story.state.stage is Stage.READY
    story.at(0.3, i.ArmDone(1, True, True, "armed"))
    assert story.answer(1) == i.Finish(1, True, True, "armed")
    assert story.said().splitlines()[-1] == "READY -> ARMED: the parachute was armed"
    story.at(0.35, i.ArmRequest(3, False, 0))
    story.at(0.4, i.ArmDone(3, False, False, "denied"))
    assert story.state.stage is Stage.ARMED
    story.at(0.45, i.ArmDone(4, False, True, "disarmed"))
    assert story.state.stage is Stage.READY


def test_arming_is_refused_with_every_reason():
    story = Story(mode=i.Mode.SHADOW)
    story.at(0.0, i.ArmRequest(1, True, 0))
    message = story.answer(1).message
    assert "nothing received from its node" in message
    assert "the vehicle is STARTUP (need READY)" in message
    story.ready().at(0.1, i.BlockRequest("upf_can", "33", True, "hot"), i.ArmRequest(2, True, 0))
    assert story.answer(2) == refused(
        2, "upf_can 33 asks to block flight: hot; supervisor mode is SHADOW (need ACTIVE)"
    )


def test_arming_knows_the_day():
    story = ready()
    told = replace(parachute().status, packed_date="2024-06-01")
    story.at(0.1, i.ParachuteReport(LINK, told), i.ArmRequest(1, True, 0, day=20_700))
    assert story.answer(1).message == (
        "refused: mavlink_parachute 1/161: packed on 2024-06-01, 825 days ago (limit 365)"
    )


def test_on_the_ground_it_is_disarmed_after_a_kill_in_flight_and_where_nothing_is_said():
    killed = killed_and_down()
    for story, told in ((killed, [killed.told(**DOWN)]), (Story(), [])):
        outputs = story.at(2.0, *told, i.ArmRequest(2, False, 4))
        assert i.ArmDevices(2, False, 4, (LINK,)) in outputs, story.state.stage


def test_a_link_that_fails_takes_the_armed_stage_back():
    story = ready()
    story.at(0.1, i.ArmDone(0, True, True, ""))
    story.at(0.2, story.heartbeat(healthy=False))
    assert story.state.stage is Stage.BLOCKED


def test_a_vehicle_that_takes_off_while_it_is_armed_is_in_flight():
    story = flying()
    story.at(0.1, i.ArmDone(1, True, True, "armed"))
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.answer(1).success


# -- a kill --------------------------------------------------------------------------------------


@pytest.mark.parametrize("given", [ready, flying])
def test_a_kill_leaves_at_once_and_is_answered_once_at_its_confirmation(given):
    story = given()
    story.at(1.0, i.KillRequest(1, "upf operator", "stop"))
    assert story.when(K) == 1.0
    kill = story.newest(K)
    assert (kill.rule, kill.reasons) == ("upf operator", ("upf operator: stop",))
    story.at(1.1, story.report(K, Outcome.SENT, detail="sent"))
    story.at(1.1, story.report(K, Outcome.ACCEPTED, detail="taken"))
    assert story.answers(1) == []
    story.at(1.2, story.report(K, Outcome.CONFIRMED, detail="off"))
    text = "mavlink_parachute: taken; mavlink_parachute: off"
    assert story.answers(1) == [i.Finish(1, True, True, text)], "the last two details"
    story.at(30.0)
    assert story.fired() == ["KILL"]


def test_a_kill_that_nobody_confirms_says_so_after_its_limit():
    story = flying()
    story.at(1.0, STOP)
    story.at(6.9)
    assert story.answers(1) == []
    story.at(7.1)
    assert "no report within 6.0 s" in story.answer(1).message


def test_a_kill_that_failed_everywhere_is_answered_at_once_and_may_be_repeated():
    story = flying()
    story.at(1.0, STOP)
    story.at(1.1, story.report(K, Outcome.FAILED, detail="no autopilot"))
    assert "no autopilot" in story.answer(1).message
    story.at(1.2, i.KillRequest(2, "operator", "stop!"))
    assert len(story.decisions(K)) == 2


def test_a_second_kill_joins_one_that_is_under_way():
    story = flying()
    story.at(1.0, STOP)
    story.at(1.1, i.KillRequest(2, "operator", "stop"))
    story.at(1.2, story.report(K, Outcome.CONFIRMED))
    assert story.answer(1).success
    assert story.answer(2).success
    assert len(story.decisions(K)) == 1


def test_a_kill_under_an_open_canopy_is_not_refused():
    story = flying()
    story.at(1.0, parachute(deployed=True))
    story.at(1.1, story.report(K, Outcome.SENT))
    story.at(20.0, i.KillRequest(1, "operator", "they turn"))
    assert len(story.decisions(K)) == 2


def test_a_device_may_ask_for_a_kill_and_nobody_waits_for_the_answer():
    story = flying()
    story.at(1.0, SMOKE)
    assert story.newest(K).rule == "device asks for a kill"
    story.at(9.0)
    assert not [o for _, o in story.outputs if isinstance(o, i.Finish)]


@pytest.mark.parametrize(("link", "kills"), [("upf_can", 1), (LINK, 0)])
def test_a_rule_may_listen_to_the_devices_of_one_link(link, kills):
    listens = rule(replace(ASKED, link=link), action=K)
    story = Story(with_rules(listens, deploy_links=(LINK, "upf_can"))).flying()
    story.at(0.1, i.KillRequest(0, "upf_can left one", "smoke"))
    assert len(story.decisions(K)) == kills


def test_a_wish_is_remembered_as_long_as_it_lasts_and_makes_room_for_the_next():
    story = flying()
    wishes = [i.KillRequest(0, f"upf_can {n}", "smoke") for n in range(MOST_DEVICE_BLOCKS)]
    story.at(1.0, *wishes)
    last = f"upf_can {MOST_DEVICE_BLOCKS - 1}"
    assert last in story.state.asks
    story.at(1.5, i.KillRequest(0, "upf_can 0", "fire"), i.KillRequest(0, "late", "smoke"))
    assert story.state.asks["upf_can 0"].reason == "fire"
    assert "late" not in story.state.asks
    story.at(1.0 + ASK_LASTS, i.KillRequest(0, "late", "smoke"))
    assert set(story.state.asks) == {"upf_can 0", "late"}


def test_a_device_that_asks_anew_is_a_new_occasion_for_the_rules_that_listen_alone():
    never = {"clears": Clears.NEVER, "action": Action.NONE, "states": tuple(Stage)}
    sinks = rule(SINKS, name="sinks", says="it sinks", **never)
    asked = rule(SINKS, ASKED, name="asked", says="it is asked for", **never)
    story = Story(with_rules(sinks, asked)).flying()
    for t in (1.0, 3.0):
        story.at(t, story.told(vertical_speed=-13.0), SMOKE)
    told = [text.partition(" (")[0] for text in story.alarms()]
    assert told == ["rule 'sinks': it sinks", *["rule 'asked': it is asked for"] * 2]


def test_a_device_that_asks_again_and_again_does_not_undo_what_was_counted():
    counts = rule(SINKS, ASKED, action=K, hold=0.5, samples=3)
    story = Story(with_rules(counts)).flying()
    for tick in range(10):
        story.at(1.0 + tick * 0.1, story.told(vertical_speed=-13.0), SMOKE)
    assert story.when(K) == pytest.approx(1.5)


def test_a_rule_that_has_acted_is_free_to_act_once_a_device_asks_anew():
    story = Story(with_rules(rule(SINKS, ASKED, action=Action.NONE))).flying()
    story.at(1.0, story.told(vertical_speed=-13.0), SMOKE)
    assert story.state.rule("tested").latched is True
    story.at(3.0, story.told(), SMOKE)
    assert story.state.rule("tested").latched is False


# -- a deploy ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "one", "reason"),
    [
        (flying, i.DeployRequest(1, True, "test"), "operator, forced: test"),
        (flying, i.DeployRequest(1, False, ""), "operator: no reason given"),
        (ready, i.DeployRequest(1, True, "test"), "operator, forced: test"),
    ],
)
def test_a_deploy_is_ordered_with_the_persons_words_and_kills_first(given, one, reason):
    story = given()
    story.at(0.1, one)
    assert (story.newest(K).rule, story.newest(K).reasons) == ("operator", (reason,))
    assert story.state.stage is Stage.KILLING
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert story.newest(D).reasons[0] == reason


@pytest.mark.parametrize("given", [ready, Story])
def test_a_deploy_of_a_vehicle_that_is_not_heard_says_so(given):
    story = given()
    story.at(20.0, story.heartbeat(), i.DeployRequest(1, False, "no"))
    assert "(nothing fresh says whether it is in the air)" in story.answer(1).message


def test_in_shadow_a_deploy_is_decided_in_words_and_nothing_is_sent():
    story = in_shadow()
    story.at(1.0, FALLS)
    assert [d.action for d in story.decisions()][-2:] == [K, D]
    assert (story.newest(D).rule, story.newest(D).reasons) == ("operator", ("operator: it falls",))
    assert all(d.shadow for d in story.decisions())
    assert story.state.stage is Stage.IN_FLIGHT
    count = len(story.outputs)
    story.at(20.0)
    assert not [o for _, o in story.outputs[count:] if isinstance(o, i.Decide)]


# -- a reset -------------------------------------------------------------------------------------


def test_a_reset_is_refused_while_it_is_not_known_to_be_down():
    story = flying()
    story.at(20.0, i.ResetRequest(2))
    lies = "if it lies still: safety/kill (kill_only), and this again after 10 s"
    why = "the vehicle was in the air, and nothing fresh says that it is down"
    assert story.answer(2) == refused(2, f"{why}; {lies}")
    story.at(20.1, story.told(), i.KillRequest(3, "operator", "stop"), i.ResetRequest(4))
    assert story.answer(4) == refused(4, f"the vehicle is in the air; {lies}")
    story = flying()
    story.at(3.0, FALLS, i.ResetRequest(2))
    why = "a deploy is under way and nothing fresh says that it is on the ground"
    assert story.answer(2) == refused(2, why)
    story.at(3.6)
    assert story.fired() == ["KILL", "DEPLOY"]


def test_a_reset_of_one_that_is_not_heard_any_more_is_taken_where_nothing_is_under_way():
    story = killed_and_down()
    story.at(30.0, i.ResetRequest(2))
    assert story.answer(2).success


def test_a_reset_says_so_to_everyone():
    story = ready()
    story.at(0.1, i.DeployRequest(1, True, "test"), i.KillRequest(2, "operator", "stop"))
    story.at(0.2, i.VehicleReport(STANDING), i.ResetRequest(3))
    assert story.answer(1) == i.Finish(1, False, False, "reset by a person")
    assert story.answer(2) == i.Finish(2, False, False, "reset by a person")
    assert story.answer(3) == i.Finish(3, True, True, "back to the start")
    assert "KILLING -> STARTUP: a person asked for the start" in story.said().splitlines()


def test_after_a_reset_links_have_their_time_to_come_up_again():
    story = killed_and_down()
    story.at(20.0, story.told(**DOWN), i.ResetRequest(2))
    story.at(29.9)
    assert story.state.stage is Stage.STARTUP
    story.at(30.1)
    assert story.state.stage is Stage.BLOCKED


def test_after_a_reset_flight_is_blocked_anew():
    story = ready()
    story.at(0.1, STOP)
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(BLOCK)) == 1
    story.at(8.0, i.VehicleReport(STANDING), i.ResetRequest(2))
    assert len(story.decisions(BLOCK)) == 2


def test_after_a_reset_nothing_of_the_last_deploy_is_left():
    story = flying().fly(0.95)
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.report(D, Outcome.CONFIRMED))
    story.at(2.0, story.heartbeat(), story.told(**DOWN), i.ResetRequest(6))
    assert story.answer(6).success
    story.at(2.05, story.heartbeat(), i.VehicleReport(IDLING))
    story.at(2.1, story.heartbeat(), story.told(height=55.0))
    assert story.state.stage is Stage.IN_FLIGHT
    story.at(2.2, i.DeployRequest(7, False, "it falls again"))
    assert story.answers(7) == []
    story.at(2.3, story.report(K, Outcome.CONFIRMED))
    assert story.fired() == ["KILL", "DEPLOY"] * 2


def test_a_parachute_that_is_tried_after_a_reset_was_out_before_the_flight():
    story = killed_and_down()
    story.at(2.0, story.heartbeat(), story.told(**DOWN), i.ResetRequest(2))
    story.at(2.1, story.heartbeat(), story.told(**DOWN), parachute(deployed=True))
    story.at(2.15, story.heartbeat(), i.VehicleReport(IDLING))
    story.at(2.2, story.heartbeat(), story.told(height=55.0))
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.fired() == ["KILL"]


def test_after_a_reset_armed_motors_alone_are_no_flight():
    story = killed_and_down()
    story.at(2.0, story.heartbeat(), story.told(**DOWN), i.ResetRequest(2))
    story.at(2.1, story.heartbeat(), vehicle(armed=Armed.ARMED))
    assert story.state.stage is Stage.READY


def test_after_a_reset_the_height_of_an_autopilot_that_started_anew_counts_again():
    story = flying().fly(1.0)
    again = {"rebooted_in_flight": True, "reboot_count": 1}
    story.fly(1.5, **again)
    assert "the autopilot restarted in flight" in story.alarms()
    story.at(1.6, STOP)
    story.fly(14.0, **again, **DOWN, height=0.0, vertical_speed=0.0)
    story.at(14.1, story.told(**again, **DOWN, height=0.0), i.ResetRequest(2))
    assert story.answer(2).success
    assert readings.unusable(story.config, story.state, "height", START + story.t) == ""


def test_after_a_reset_a_rule_speaks_again():
    told = rule(SINKS, action=Action.NONE, says="it sinks", states=tuple(Stage))
    story = Story(with_rules(told)).ready()
    for token, t in ((1, 0.1), (2, 0.3)):
        story.at(t, story.told(**DOWN, vertical_speed=-13.0))
        assert len(story.alarms()) == token
        story.at(t + 0.1, story.told(**DOWN, vertical_speed=0.0), i.ResetRequest(token))
        assert story.answer(token).success


def test_after_a_reset_nothing_of_the_flight_is_remembered():
    story = killed_and_down()
    story.at(1.4, story.heartbeat(), story.told(**DOWN), i.ResetRequest(2))
    new = State(epoch=7, started_at=START + 1.4)
    names = ("started_at", "asks", "flight.flown", "flight.airborne", "flight.rebooted")
    for name in (*names, "killing.kill", "killing.killed_in_flight"):
        assert attrgetter(name)(story.state) == attrgetter(name)(new), name


def test_after_a_reset_the_alarm_of_the_last_deploy_is_not_said_any_more():
    story = flying().fly(0.95)
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.FAULT
    story.at(1.3, story.heartbeat(), story.told(**DOWN), i.ResetRequest(6))
    assert story.answer(6).success
    assert story.state.alarming.alarms == ()
    story.at(60.0)
    assert len(story.alarms()) == 1


def test_a_wish_of_before_a_reset_stops_no_motors_after_it():
    story = ready()
    story.at(0.1, SMOKE)
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    story.at(0.3, i.ResetRequest(2))
    assert story.answer(2).success
    story.at(0.4, story.heartbeat())
    assert story.state.stage is Stage.READY
    assert story.fired() == ["KILL"]


# -- a mode --------------------------------------------------------------------------------------


def test_a_mode_is_answered_in_whole_words():
    story = flying()
    story.at(0.1, i.ModeRequest(1, i.Mode.ACTIVE, force=False))
    assert story.answer(1) == i.Finish(1, True, True, "mode is ACTIVE already")
    story.at(0.3, i.DeployRequest(3, False, "it falls"), i.KillRequest(4, "operator", "stop"))
    story.at(0.4, i.ModeRequest(5, i.Mode.SHADOW, force=True))
    assert story.answer(5) == i.Finish(5, True, True, "mode SHADOW")
    assert "mode ACTIVE -> SHADOW (no reason given)" in story.said().splitlines()
    story.at(story.t + 0.1, i.ModeRequest(6, i.Mode.ACTIVE, True, "the test is over"))
    assert "mode SHADOW -> ACTIVE (the test is over)" in story.said().splitlines()
    assert story.answer(3) == i.Finish(3, False, False, "mode changed to SHADOW")
    assert story.answer(4) == i.Finish(4, False, False, "mode changed to SHADOW")


def test_on_the_ground_a_mode_needs_no_force_and_inhibited_a_restarted_node_is_told_nothing():
    story = ready()
    story.at(0.1, story.report(RELEASE, Outcome.CONFIRMED))
    story.at(0.2, i.ModeRequest(1, i.Mode.INHIBITED, force=False))
    assert story.answer(1) == i.Finish(1, True, True, "mode INHIBITED")
    count = len(story.decisions())
    story.seq = -1
    story.at(0.3, story.heartbeat())
    assert len(story.decisions()) == count


def test_inhibited_decides_nothing():
    story = Story(mode=i.Mode.INHIBITED)
    story.at(0.0)
    story.ready().at(1.0, STOP)
    assert story.decisions() == []


def test_leaving_active_between_kill_and_deploy_stops_the_deploy_and_says_so():
    story = Story().ordered()
    story.at(1.1, i.ModeRequest(2, i.Mode.INHIBITED, force=True))
    assert "mode changed to INHIBITED" in story.answer(5).message
    story.at(30.0)
    assert story.decisions(D) == []


def test_leaving_active_after_the_deploy_left_ends_it_and_it_may_be_ordered_again():
    story = Story().deploying()
    story.at(1.2, i.ModeRequest(2, i.Mode.INHIBITED, force=True))
    line = "DEPLOYING -> KILLING: a person changed the mode while a deploy was under way"
    assert line in story.said().splitlines()
    assert (story.state.killing.kill, story.state.deploying.deploys) == (None, ())
    story.at(1.3, i.ModeRequest(3, i.Mode.ACTIVE, force=True))
    story.at(1.4, i.DeployRequest(4, False, "it still falls"))
    story.at(1.5, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 2


def test_a_mode_that_comes_and_goes_within_one_turn_stops_the_deploy():
    story = Story().deploying()
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


def test_leaving_active_takes_the_block_back_in_whole_words_and_coming_back_renews_it():
    story = Story(SupervisorConfig(kill_links=(LINK, "umbilical")))
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(0.1, i.ModeRequest(1, i.Mode.INHIBITED, force=False))
    taken = story.newest(RELEASE)
    assert (taken.rule, taken.reasons) == ("mode", ("mode changes from ACTIVE to INHIBITED",))
    assert (taken.targets, taken.shadow) == ((LINK, "umbilical"), False)
    story.at(0.2, i.ModeRequest(2, i.Mode.ACTIVE, force=False))
    block = story.decisions()[-1]
    assert (block.action, block.shadow) == (BLOCK, False)


@pytest.mark.parametrize(("reported", "releases"), [(False, 2), (True, 1)])
def test_leaving_active_a_release_is_repeated_if_a_node_may_not_have_it(reported, releases):
    story = ready()
    if reported:
        story.at(0.1, story.report(RELEASE, Outcome.SENT))
    story.at(0.2, i.ModeRequest(1, i.Mode.INHIBITED, force=False))
    assert len(story.decisions(RELEASE)) == releases


def test_what_was_only_said_is_decided_in_active():
    story = Story(mode=i.Mode.SHADOW)
    story.at(0.0, story.heartbeat(healthy=False))
    assert [d.shadow for d in story.decisions(BLOCK)] == [True]
    story.at(0.1, i.ModeRequest(1, i.Mode.ACTIVE, force=False))
    assert [d.shadow for d in story.decisions(BLOCK)] == [True, False]
