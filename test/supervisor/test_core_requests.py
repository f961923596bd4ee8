"""Arm, kill, reset and mode: what is done, and what is refused for which stated reason."""

import pytest
from story import LINK, STANDING, Story, parachute

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage

K, D = Action.KILL, Action.DEPLOY


def test_arming_goes_to_the_devices_and_counts_when_they_have_done_it() -> None:
    story = Story().ready()
    outputs = story.at(0.1, i.ArmRequest(1, True, 4))
    assert i.ArmDevices(1, True, 4, (LINK,)) in outputs
    assert story.state.stage is Stage.READY
    story.at(0.2, i.ArmDone(1, True, True, "armed"))
    assert story.state.stage is Stage.ARMED
    assert story.answer(1).success
    story.at(0.3, i.ArmRequest(2, False, 0))
    story.at(0.4, i.ArmDone(2, False, True, "disarmed"))
    assert story.state.stage is Stage.READY


def test_arming_that_fails_at_a_device_says_so() -> None:
    story = Story().ready()
    story.at(0.1, i.ArmRequest(1, True, 0))
    story.at(0.2, i.ArmDone(1, True, False, "mavlink_parachute: denied"))
    assert story.state.stage is Stage.READY
    assert "denied" in story.answer(1).message


def test_arming_is_refused_with_every_reason() -> None:
    story = Story(mode=i.Mode.SHADOW)
    story.at(0.0, i.ArmRequest(1, True, 0))
    message = story.answer(1).message
    assert "nothing received from its node" in message
    assert "mode is SHADOW (need ACTIVE)" in message
    assert "the vehicle is STARTUP (need READY)" in message


def test_disarming_in_flight_is_refused() -> None:
    story = Story().flying()
    story.at(0.1, i.ArmRequest(1, False, 0))
    assert "not disarmed in flight" in story.answer(1).message


def test_a_link_that_fails_takes_the_armed_stage_back() -> None:
    story = Story().ready()
    story.at(0.1, i.ArmDone(0, True, True, ""))
    story.at(0.2, story.heartbeat(healthy=False))
    assert story.state.stage is Stage.BLOCKED


@pytest.mark.parametrize("flying", [False, True])
def test_a_kill_leaves_at_once_and_is_answered_at_its_confirmation(flying: bool) -> None:
    story = Story().flying() if flying else Story().ready()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    assert story.when(K) == 1.0
    story.at(1.1, story.report(K, Outcome.ACCEPTED))
    assert story.answers(1) == []
    story.at(1.2, story.report(K, Outcome.CONFIRMED, detail="motors off"))
    assert story.answer(1).success
    assert story.answer(1).accepted
    story.at(30.0)
    assert story.decisions(D) == []


def test_a_kill_that_nobody_confirms_says_so_after_its_limit() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(6.9)
    assert story.answers(1) == []
    story.at(7.1)
    assert "no report within 6.0 s" in story.answer(1).message


def test_a_kill_that_failed_everywhere_is_answered_at_once_and_may_be_repeated() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.1, story.report(K, Outcome.FAILED, detail="no autopilot"))
    assert "no autopilot" in story.answer(1).message
    story.at(1.2, i.KillRequest(2, "operator", "stop!"))
    assert len(story.decisions(K)) == 2


def test_a_second_kill_joins_one_that_is_under_way() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.1, i.KillRequest(2, "operator", "stop"))
    story.at(1.2, story.report(K, Outcome.CONFIRMED))
    assert story.answer(1).success
    assert story.answer(2).success
    assert len(story.decisions(K)) == 1


def test_a_kill_under_an_open_canopy_is_not_refused() -> None:
    story = Story().flying()
    story.at(1.0, parachute(LINK, "1/161", True, ()))
    story.at(1.1, story.report(K, Outcome.SENT))
    story.at(20.0, i.KillRequest(1, "operator", "they turn"))
    assert len(story.decisions(K)) == 2


def test_a_device_may_ask_for_a_kill_and_nobody_waits_for_the_answer() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(0, "upf_can 33", "about to launch"))
    assert story.newest(K).rule == "device asks for a kill"
    story.at(9.0)
    assert not [o for _, o in story.outputs if isinstance(o, i.Finish)]


def test_a_reset_in_the_air_is_refused() -> None:
    story = Story().flying()
    story.at(0.1, i.ResetRequest(1))
    assert "in the air" in story.answer(1).message


def test_a_reset_in_the_starting_stage_is_refused() -> None:
    story = Story()
    story.at(0.1, i.ResetRequest(1))
    assert "STARTUP" in story.answer(1).message


def test_a_reset_on_the_ground_begins_again_and_answers_who_waits() -> None:
    story = Story().flying()
    story.alive(0.9)
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    story.at(1.1, i.VehicleReport(STANDING))
    story.at(1.2, i.ResetRequest(2))
    assert story.answer(1).message == "reset by a person"
    assert story.answer(2).success
    assert story.state.killing.kill is None
    story.at(1.3, story.heartbeat())
    assert story.state.stage is Stage.READY


def test_shadow_says_what_it_would_have_done_and_sends_nothing() -> None:
    story = Story(mode=i.Mode.SHADOW).flying()
    story.at(1.0, i.DeployRequest(1, False, "it falls"))
    assert "SHADOW; nothing is sent" in story.answer(1).message
    assert [d.action for d in story.decisions()][-2:] == [K, D]
    assert all(d.shadow for d in story.decisions())
    assert story.state.stage is Stage.IN_FLIGHT
    count = len(story.outputs)
    story.at(20.0)
    assert not [o for _, o in story.outputs[count:] if isinstance(o, i.Decide)]


def test_inhibited_decides_nothing() -> None:
    story = Story(mode=i.Mode.INHIBITED)
    story.at(0.0)
    story.ready()
    story.at(1.0, i.KillRequest(1, "operator", "stop"))
    assert "INHIBITED; nothing is sent" in story.answer(1).message
    assert story.decisions() == []


def test_the_mode_changes_in_flight_only_with_force() -> None:
    story = Story().flying()
    story.at(0.1, i.ModeRequest(1, i.Mode.INHIBITED, force=False))
    assert "IN_FLIGHT; force" in story.answer(1).message
    story.at(0.2, i.ModeRequest(2, i.Mode.INHIBITED, force=True))
    assert story.answer(2).success
    story.at(0.3, i.ModeRequest(3, i.Mode.INHIBITED, force=False))
    assert "already" in story.answer(3).message


def test_leaving_active_takes_the_flight_block_back_and_coming_back_renews_it() -> None:
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(0.1, i.ModeRequest(1, i.Mode.SHADOW, force=False))
    release = story.decisions()[-1]
    assert (release.action, release.shadow) == (Action.FLIGHT_BLOCK_RELEASE, False) or (
        story.decisions()[-2].action,
        story.decisions()[-2].shadow,
    ) == (Action.FLIGHT_BLOCK_RELEASE, False)
    story.at(0.2, i.ModeRequest(2, i.Mode.ACTIVE, force=False))
    block = story.decisions()[-1]
    assert (block.action, block.shadow) == (Action.FLIGHT_BLOCK, False)


def test_leaving_active_between_kill_and_deploy_stops_the_deploy_and_says_so() -> None:
    story = Story().flying()
    story.at(1.0, i.DeployRequest(1, False, "it falls"))
    story.at(1.1, i.ModeRequest(2, i.Mode.INHIBITED, force=True))
    assert "mode changed to INHIBITED" in story.answer(1).message
    story.at(30.0)
    assert story.decisions(D) == []


def test_inhibited_a_node_that_restarts_is_told_nothing() -> None:
    story = Story().ready()
    story.at(0.1, story.report(Action.FLIGHT_BLOCK_RELEASE, Outcome.CONFIRMED))
    story.at(0.2, i.ModeRequest(1, i.Mode.INHIBITED, force=False))
    count = len(story.decisions())
    story.seq = -1
    story.at(0.3, story.heartbeat())
    assert len(story.decisions()) == count


def test_leaving_active_after_the_deploy_left_ends_it_and_it_may_be_ordered_again() -> None:
    story = Story().flying()
    story.at(1.0, i.DeployRequest(1, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, i.ModeRequest(2, i.Mode.INHIBITED, force=True))
    assert story.state.stage is Stage.KILLING
    story.at(1.3, i.ModeRequest(3, i.Mode.ACTIVE, force=True))
    story.at(1.4, i.DeployRequest(4, False, "it still falls"))
    story.at(1.5, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 2
