"""Requests and their answers, word for word."""

from dataclasses import replace
from operator import attrgetter
from typing import Any

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


def refused(token: int, why: str) -> i.Finish:
    return i.Finish(token, False, False, f"refused: {why}")


def followed(story: Story) -> Story:
    """Another supervisor decides from now on."""
    story.at(story.t, i.StepDown("the other was first"))
    return story


def killed_and_down() -> Story:
    """Killed in flight at 1.0 by a person, on the ground since 1.2."""
    story = Story().flying().fly(0.95)
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.heartbeat(), story.told(**DOWN))
    assert story.state.stage is Stage.KILLING
    return story


# -- arming --------------------------------------------------------------------------------------


def test_arming_is_refused_in_whole_words() -> None:
    story = Story(mode=i.Mode.SHADOW).ready()
    story.at(0.1, i.BlockRequest("upf_can", "33", True, "hot"), i.ArmRequest(1, True, 0))
    assert story.answer(1) == refused(
        1, "upf_can 33 asks to block flight: hot; supervisor mode is SHADOW (need ACTIVE)"
    )


def test_arming_knows_the_day() -> None:
    story = Story().ready()
    told = replace(parachute().status, packed_date="2024-06-01")
    story.at(0.1, i.ParachuteReport(LINK, told), i.ArmRequest(1, True, 0, day=20_700))
    assert story.answer(1).message == (
        "refused: mavlink_parachute 1/161: packed on 2024-06-01, 825 days ago (limit 365)"
    )


def test_disarming_in_flight_is_refused_in_whole_words() -> None:
    story = Story().flying()
    story.at(0.1, i.ArmRequest(1, False, 0))
    assert story.answer(1) == refused(1, "the vehicle is IN_FLIGHT: not disarmed in flight")


def test_a_deploy_that_is_under_way_is_not_disarmed_on_the_ground() -> None:
    story = Story().ready()
    story.at(0.1, i.DeployRequest(1, True, "test"), i.ArmRequest(2, False, 0))
    assert story.answer(2) == refused(2, "the vehicle is KILLING: not disarmed in flight")


def test_after_a_kill_in_flight_it_is_disarmed_once_it_is_down() -> None:
    story = killed_and_down()
    outputs = story.at(2.0, story.told(**DOWN), i.ArmRequest(2, False, 4))
    assert i.ArmDevices(2, False, 4, (LINK,)) in outputs


def test_on_the_ground_it_is_disarmed_also_where_the_vehicle_says_nothing() -> None:
    story = Story()
    outputs = story.at(0.1, i.ArmRequest(1, False, 4))
    assert i.ArmDevices(1, False, 4, (LINK,)) in outputs


def test_what_came_of_arming_is_answered_with_the_words_of_the_devices() -> None:
    story = Story().ready()
    story.at(0.1, i.ArmDone(1, True, True, "armed"))
    assert story.answer(1) == i.Finish(1, True, True, "armed")
    assert story.said().splitlines()[-1] == "READY -> ARMED: the parachute was armed"
    story.at(0.2, i.ArmDone(2, False, False, "denied"))
    assert story.answer(2) == i.Finish(2, False, False, "denied")
    assert story.state.stage is Stage.ARMED


def test_a_vehicle_that_takes_off_while_it_is_armed_is_in_flight() -> None:
    story = Story().flying()
    story.at(0.1, i.ArmDone(1, True, True, "armed"))
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.answer(1).success


# -- a kill --------------------------------------------------------------------------------------


def test_one_that_follows_refuses_a_persons_kill_and_says_who_decides() -> None:
    story = followed(Story().flying())
    story.at(0.1, i.KillRequest(1, "operator", "stop"))
    assert story.answer(1) == refused(1, "another supervisor decides, call again")
    assert story.fired() == []


def test_a_kill_that_is_not_sent_is_refused_in_whole_words() -> None:
    story = Story(mode=i.Mode.SHADOW).flying()
    story.at(0.1, i.KillRequest(1, "operator", "stop"))
    assert story.answers(1) == [refused(1, "mode is SHADOW; nothing is sent")]


def test_a_kill_that_is_sent_is_answered_once() -> None:
    story = Story().flying()
    story.at(0.1, i.KillRequest(1, "upf operator", "stop"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED, detail="motors off"))
    assert story.answers(1) == [i.Finish(1, True, True, "mavlink_parachute: motors off")]
    assert (story.newest(K).rule, story.newest(K).reasons) == (
        "upf operator",
        ("upf operator: stop",),
    )


@pytest.mark.parametrize(("link", "kills"), [("upf_can", 1), (LINK, 0)])
def test_a_rule_may_listen_to_the_devices_of_one_link(link: str, kills: int) -> None:
    listens = rule(replace(ASKED, link=link), action=K)
    story = Story(with_rules(listens, deploy_links=(LINK, "upf_can"))).flying()
    story.at(0.1, i.KillRequest(0, "upf_can left one", "smoke"))
    assert len(story.decisions(K)) == kills


def test_a_wish_is_remembered_as_long_as_it_lasts_and_makes_room_for_the_next() -> None:
    story = Story().flying()
    wishes = [i.KillRequest(0, f"upf_can {n}", "smoke") for n in range(MOST_DEVICE_BLOCKS)]
    story.at(1.0, *wishes)
    last = f"upf_can {MOST_DEVICE_BLOCKS - 1}"
    assert last in story.state.asks
    story.at(1.5, i.KillRequest(0, "upf_can 0", "fire"), i.KillRequest(0, "late", "smoke"))
    assert story.state.asks["upf_can 0"].reason == "fire"
    assert "late" not in story.state.asks
    story.at(1.0 + ASK_LASTS, i.KillRequest(0, "late", "smoke"))
    assert set(story.state.asks) == {"upf_can 0", "late"}


def test_a_device_that_asks_anew_is_a_new_occasion_for_the_rules_that_listen_alone() -> None:
    never = {"clears": Clears.NEVER, "action": Action.NONE, "states": tuple(Stage)}
    sinks = rule(SINKS, name="sinks", says="it sinks", **never)
    asked = rule(SINKS, ASKED, name="asked", says="it is asked for", **never)
    story = Story(with_rules(sinks, asked)).flying()
    for t in (1.0, 3.0):
        story.at(t, story.told(vertical_speed=-13.0), i.KillRequest(0, "upf_can 33", "smoke"))
    told = [text.partition(" (")[0] for text in story.alarms()]
    assert told == [
        "rule 'sinks': it sinks",
        "rule 'asked': it is asked for",
        "rule 'asked': it is asked for",
    ]


def test_a_device_that_asks_again_and_again_does_not_undo_what_was_counted() -> None:
    counts = rule(SINKS, ASKED, action=K, hold=0.5, samples=3)
    story = Story(with_rules(counts)).flying()
    for tick in range(10):
        wish = i.KillRequest(0, "upf_can 33", "smoke")
        story.at(1.0 + tick * 0.1, story.told(vertical_speed=-13.0), wish)
    assert story.when(K) == pytest.approx(1.5)


def test_a_rule_that_has_acted_is_free_to_act_once_a_device_asks_anew() -> None:
    story = Story(with_rules(rule(SINKS, ASKED, action=Action.NONE))).flying()
    wish = i.KillRequest(0, "upf_can 33", "smoke")
    story.at(1.0, story.told(vertical_speed=-13.0), wish)
    assert story.state.rule("tested").latched is True
    story.at(3.0, story.told(), wish)
    assert story.state.rule("tested").latched is False


# -- a flight block of a device ------------------------------------------------------------------


def test_the_alarm_of_a_flood_is_an_alarm_and_ends_when_one_lets_go() -> None:
    story = Story().ready()
    asks = [i.BlockRequest("upf_can", str(n), True, "x") for n in range(MOST_DEVICE_BLOCKS)]
    story.at(0.1, *asks, i.BlockRequest("upf_can", "more", True, ""))
    text = "upf_can more asks to block flight: not remembered, 64 devices do already"
    assert story.alarms() == [text]
    story.at(0.2, i.BlockRequest("upf_can", "0", True, "y"))
    story.at(0.3, i.BlockRequest("upf_can", "more", True, ""))
    assert story.alarms() == [text], "it is as full as before"


def test_a_device_that_gives_no_reason_is_quoted_so() -> None:
    story = Story().ready()
    story.at(0.1, i.BlockRequest("upf_can", "33", True, ""))
    assert story.newest(BLOCK).reasons == ("upf_can 33 asks to block flight: no reason given",)


# -- a deploy ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("one", "reason"),
    [
        (i.DeployRequest(1, True, "test"), "operator, forced: test"),
        (i.DeployRequest(1, False, ""), "operator: no reason given"),
    ],
)
def test_a_deploy_is_ordered_with_the_persons_words(one: i.DeployRequest, reason: str) -> None:
    story = Story().flying()
    story.at(0.1, one)
    assert (story.newest(K).rule, story.newest(K).reasons) == ("operator", (reason,))


def test_a_deploy_on_the_ground_is_refused_in_whole_words() -> None:
    story = Story().ready()
    story.at(0.1, i.DeployRequest(1, False, "no"))
    why = "the vehicle is READY, not in flight; force deploys all the same"
    assert story.answers(1) == [refused(1, why)]


def test_a_deploy_of_a_vehicle_that_is_not_heard_any_more_says_so() -> None:
    story = Story().ready()
    story.at(20.0, i.DeployRequest(1, False, "no"))
    assert "(nothing fresh says whether it is in the air)" in story.answer(1).message


def test_a_deploy_that_is_not_sent_is_refused_in_whole_words() -> None:
    story = Story(mode=i.Mode.SHADOW).flying()
    story.at(0.1, i.DeployRequest(1, False, "it falls"))
    assert story.answers(1) == [refused(1, "mode is SHADOW; nothing is sent")]
    assert (story.newest(D).rule, story.newest(D).reasons) == ("operator", ("operator: it falls",))


# -- a reset -------------------------------------------------------------------------------------


def test_a_reset_in_the_air_is_refused_in_whole_words() -> None:
    story = Story().flying()
    story.at(0.1, i.ResetRequest(1))
    assert story.answer(1) == refused(1, "the vehicle is in the air")
    story.at(20.0, i.ResetRequest(2))
    assert story.answer(2) == refused(2, "the vehicle is in the air"), "nor is it known to be down"
    story.at(20.1, story.told(), i.KillRequest(3, "operator", "stop"), i.ResetRequest(4))
    assert story.answer(4) == refused(4, "the vehicle is in the air")


def test_a_reset_in_a_stage_that_has_none_is_refused_in_whole_words() -> None:
    story = Story()
    story.at(0.1, i.ResetRequest(1))
    assert story.answer(1) == refused(1, "the vehicle is STARTUP")


def test_a_reset_is_refused_while_a_deploy_is_under_way_and_nothing_is_known() -> None:
    story = Story().flying()
    story.at(3.0, i.DeployRequest(1, False, "it falls"), i.ResetRequest(2))
    why = "a deploy is under way and nothing fresh says that it is on the ground"
    assert story.answer(2) == refused(2, why)
    story.at(3.6)
    assert story.fired() == ["KILL", "DEPLOY"]


def test_a_reset_of_one_that_is_not_heard_any_more_is_taken_where_nothing_is_under_way() -> None:
    story = killed_and_down()
    story.at(30.0, i.ResetRequest(2))
    assert story.answer(2).success


def test_a_reset_says_so_to_everyone() -> None:
    story = Story().ready()
    story.at(0.1, i.DeployRequest(1, True, "test"), i.KillRequest(2, "operator", "stop"))
    story.at(0.2, i.VehicleReport(STANDING), i.ResetRequest(3))
    assert story.answer(1) == i.Finish(1, False, False, "reset by a person")
    assert story.answer(2) == i.Finish(2, False, False, "reset by a person")
    assert story.answer(3) == i.Finish(3, True, True, "back to the start")
    assert "KILLING -> STARTUP: a person asked for the start" in story.said().splitlines()


def test_after_a_reset_links_have_their_time_to_come_up_again() -> None:
    story = killed_and_down()
    story.at(20.0, story.told(**DOWN), i.ResetRequest(2))
    story.at(29.9)
    assert story.state.stage is Stage.STARTUP
    story.at(30.1)
    assert story.state.stage is Stage.BLOCKED


def test_after_a_reset_flight_is_blocked_anew() -> None:
    story = Story().ready()
    story.at(0.1, i.KillRequest(1, "operator", "stop"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(BLOCK)) == 1
    story.at(8.0, i.VehicleReport(STANDING), i.ResetRequest(2))
    assert len(story.decisions(BLOCK)) == 2


def test_after_a_reset_nothing_of_the_last_deploy_is_left() -> None:
    story = Story().flying().fly(0.95)
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


def test_a_parachute_that_is_tried_after_a_reset_was_out_before_the_flight() -> None:
    story = killed_and_down()
    story.at(2.0, story.heartbeat(), story.told(**DOWN), i.ResetRequest(2))
    story.at(2.1, story.heartbeat(), story.told(**DOWN), parachute(deployed=True))
    story.at(2.15, story.heartbeat(), i.VehicleReport(IDLING))
    story.at(2.2, story.heartbeat(), story.told(height=55.0))
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.fired() == ["KILL"]


def test_after_a_reset_armed_motors_alone_are_no_flight() -> None:
    story = killed_and_down()
    story.at(2.0, story.heartbeat(), story.told(**DOWN), i.ResetRequest(2))
    story.at(2.1, story.heartbeat(), vehicle(armed=Armed.ARMED))
    assert story.state.stage is Stage.READY


def test_after_a_reset_the_height_of_an_autopilot_that_started_anew_counts_again() -> None:
    story = Story().flying().fly(1.0)
    again = {"rebooted_in_flight": True, "reboot_count": 1}
    story.fly(1.5, **again)
    assert "the autopilot started anew in flight" in story.alarms()
    story.at(1.6, i.KillRequest(1, "operator", "stop"))
    story.fly(14.0, **again, **DOWN, height=0.0, vertical_speed=0.0)
    story.at(14.1, story.told(**again, **DOWN, height=0.0), i.ResetRequest(2))
    assert story.answer(2).success
    assert readings.unusable(story.config, story.state, "height", START + story.t) == ""


def test_after_a_reset_a_rule_speaks_again() -> None:
    told = rule(SINKS, action=Action.NONE, says="it sinks", states=tuple(Stage))
    story = Story(with_rules(told)).ready()
    for token, t in ((1, 0.1), (2, 0.3)):
        story.at(t, story.told(**DOWN, vertical_speed=-13.0))
        assert len(story.alarms()) == token
        story.at(t + 0.1, story.told(**DOWN, vertical_speed=0.0), i.ResetRequest(token))
        assert story.answer(token).success


def test_after_a_reset_nothing_of_the_flight_is_remembered() -> None:
    story = killed_and_down()
    story.at(1.4, story.heartbeat(), story.told(**DOWN), i.ResetRequest(2))
    new = State(epoch=7, started_at=START + 1.4)
    names = ("started_at", "asks", "flight.flown", "flight.airborne", "flight.rebooted")
    for name in (*names, "killing.killed_in_flight"):
        assert attrgetter(name)(story.state) == attrgetter(name)(new), name


def test_after_a_reset_the_alarm_of_the_last_deploy_is_not_said_any_more() -> None:
    story = Story().flying().fly(0.95)
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.FAULT
    story.at(1.3, story.heartbeat(), story.told(**DOWN), i.ResetRequest(6))
    assert story.answer(6).success
    assert story.state.alarming.alarms == ()
    story.at(60.0)
    assert len(story.alarms()) == 1


def test_a_wish_of_before_a_reset_stops_no_motors_after_it() -> None:
    story = Story().ready()
    story.at(0.1, i.KillRequest(0, "upf_can 33", "smoke"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    story.at(0.3, i.ResetRequest(2))
    assert story.answer(2).success
    story.at(0.4, story.heartbeat())
    assert story.state.stage is Stage.READY
    assert story.fired() == ["KILL"]


# -- a mode --------------------------------------------------------------------------------------


def test_a_mode_is_answered_in_whole_words() -> None:
    story = Story().flying()
    story.at(0.1, i.ModeRequest(1, i.Mode.ACTIVE, force=False))
    assert story.answer(1) == i.Finish(1, True, True, "mode is ACTIVE already")
    story.at(0.2, i.ModeRequest(2, i.Mode.SHADOW, force=False))
    why = "the vehicle is IN_FLIGHT; force changes it all the same"
    assert story.answer(2) == refused(2, why)
    assert story.state.mode is i.Mode.ACTIVE
    story.at(0.3, i.DeployRequest(3, False, "it falls"), i.KillRequest(4, "operator", "stop"))
    story.at(0.4, i.ModeRequest(5, i.Mode.SHADOW, force=True))
    assert story.answer(5) == i.Finish(5, True, True, "mode SHADOW")
    assert "mode ACTIVE -> SHADOW (no reason given)" in story.said().splitlines()
    story.at(story.t + 0.1, i.ModeRequest(6, i.Mode.ACTIVE, True, "the test is over"))
    assert "mode SHADOW -> ACTIVE (the test is over)" in story.said().splitlines()
    assert story.answer(3) == i.Finish(3, False, False, "mode changed to SHADOW")
    assert story.answer(4) == i.Finish(4, False, False, "mode changed to SHADOW")


def test_on_the_ground_a_mode_needs_no_force() -> None:
    story = Story().ready()
    story.at(0.1, i.ModeRequest(1, i.Mode.INHIBITED, force=False))
    assert story.answer(1) == i.Finish(1, True, True, "mode INHIBITED")


def test_a_mode_that_ends_a_deploy_says_so() -> None:
    story = Story().flying()
    story.at(1.0, i.DeployRequest(1, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, i.ModeRequest(2, i.Mode.INHIBITED, force=True))
    line = "DEPLOYING -> KILLING: a person changed the mode while a deploy was under way"
    assert line in story.said().splitlines()
    assert (story.state.killing.kill, story.state.deploying.deploys) == (None, ())


def test_leaving_active_takes_the_block_back_in_whole_words() -> None:
    links: dict[str, Any] = {"kill_links": (LINK, "umbilical")}
    story = Story(SupervisorConfig(**links))
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(0.1, i.ModeRequest(1, i.Mode.INHIBITED, force=False))
    taken = story.newest(RELEASE)
    assert taken.rule == "mode"
    assert taken.reasons == ("mode changes from ACTIVE to INHIBITED",)
    assert taken.targets == (LINK, "umbilical")
    assert not taken.shadow


@pytest.mark.parametrize(("reported", "releases"), [(False, 2), (True, 1)])
def test_leaving_active_a_release_is_repeated_if_a_node_may_not_have_it(
    reported: bool, releases: int
) -> None:
    story = Story().ready()
    if reported:
        story.at(0.1, story.report(RELEASE, Outcome.SENT))
    story.at(0.2, i.ModeRequest(1, i.Mode.INHIBITED, force=False))
    assert len(story.decisions(RELEASE)) == releases


def test_what_was_only_said_is_decided_in_active() -> None:
    story = Story(mode=i.Mode.SHADOW)
    story.at(0.0, story.heartbeat(healthy=False))
    assert [d.shadow for d in story.decisions(BLOCK)] == [True]
    story.at(0.1, i.ModeRequest(1, i.Mode.ACTIVE, force=False))
    assert [d.shadow for d in story.decisions(BLOCK)] == [True, False]


def test_a_rule_that_only_spoke_in_shadow_acts_in_active() -> None:
    story = Story(with_rules(rule(SINKS, action=K)), mode=i.Mode.SHADOW).flying()
    story.at(0.1, story.told(vertical_speed=-13.0))
    story.at(0.2, story.told(vertical_speed=-13.0), i.ModeRequest(1, i.Mode.ACTIVE, force=True))
    assert [d.shadow for d in story.decisions(K)] == [True, False]
