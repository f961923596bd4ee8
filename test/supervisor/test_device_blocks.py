"""A device asks to block flight: what it blocks and when, who is told, and what ends it."""

import pytest
from story import FLYING, LINK, STANDING, Story

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import block_reasons
from chute_ros.supervisor.requests import MOST_DEVICE_BLOCKS

BLOCK, RELEASE = Action.FLIGHT_BLOCK, Action.FLIGHT_BLOCK_RELEASE
WORDS = "upf_can 33 asks to block flight: ABNORMAL"


def ask(reason: str = "ABNORMAL", device: str = "33") -> i.BlockRequest:
    return i.BlockRequest("upf_can", device, True, reason)


def let_go(device: str = "33") -> i.BlockRequest:
    return i.BlockRequest("upf_can", device, False, "READY")


def reasons(story: Story) -> tuple[str, ...]:
    return block_reasons(story.config, story.state, 1000.0 + story.t)


def refusals(story: Story) -> list[str]:
    return [text for text in story.alarms() if "not remembered" in text]


# What it blocks


def test_a_device_blocks_flight_and_lets_it_go_again():
    story = Story().ready()
    story.at(0.1, ask())
    assert story.state.stage is Stage.BLOCKED
    assert story.decisions()[-1].action is BLOCK
    assert story.newest(BLOCK).reasons == (WORDS,)
    assert story.newest(BLOCK).targets == story.config.links
    story.at(0.2, let_go())
    assert story.state.stage is Stage.READY
    assert story.decisions()[-1].action is RELEASE
    assert dict(story.state.device_blocks) == {}


def test_arming_is_refused_with_the_devices_reason():
    story = Story().ready()
    story.at(0.1, ask(), i.ArmRequest(1, True, 0))
    assert not story.answer(1).success
    assert WORDS in story.answer(1).message
    story.at(0.2, let_go())
    story.at(0.3, i.ArmRequest(2, True, 0))
    assert [o for _, o in story.outputs if isinstance(o, i.ArmDevices)]


def test_an_armed_vehicle_on_the_ground_is_blocked_too_and_in_shadow_it_is_only_said():
    for mode in (i.Mode.ACTIVE, i.Mode.SHADOW):
        story = Story(mode=mode).ready()
        story.at(0.1, i.ArmDone(0, True, True, ""))
        story.at(0.2, ask())
        assert story.state.stage is Stage.BLOCKED
        block = story.decisions()[-1]
        assert (block.action, block.shadow) == (BLOCK, mode is i.Mode.SHADOW)


def test_a_device_that_asks_while_it_is_being_armed_is_not_outrun_by_the_arming():
    story = Story().ready()
    story.at(0.1, i.ArmRequest(1, True, 0))
    story.at(0.2, ask(), i.ArmDone(1, True, True, "armed"))
    assert story.state.stage is Stage.BLOCKED


def test_every_device_that_asks_is_named_and_the_last_one_to_let_go_releases():
    story = Story().ready()
    story.at(0.1, ask(), ask("NOT_READY", "34"))
    assert reasons(story) == (WORDS, "upf_can 34 asks to block flight: NOT_READY")
    story.at(0.2, let_go(), i.BlockRequest(LINK, "34", False, "READY"))
    assert story.state.stage is Stage.BLOCKED, "a device speaks only for itself"
    story.at(0.3, let_go("34"))
    assert story.state.stage is Stage.READY


def test_a_device_that_lets_go_does_not_outvote_an_unhealthy_link():
    story = Story().ready()
    story.at(0.1, ask(), story.heartbeat(healthy=False))
    story.at(0.2, let_go())
    assert story.state.stage is Stage.BLOCKED
    story.at(0.3, story.heartbeat())
    assert story.state.stage is Stage.READY


@pytest.mark.parametrize(
    ("one", "words"),
    [
        (ask(""), "upf_can 33 asks to block flight: no reason given"),
        (ask(device=""), "upf_can asks to block flight: ABNORMAL"),
    ],
)
def test_what_a_device_leaves_out_is_said_in_words(one, words):
    story = Story().ready()
    story.at(0.1, one)
    assert reasons(story) == story.newest(BLOCK).reasons == (words,)


# Repeating


def test_asking_for_the_same_or_letting_go_of_what_was_never_asked_changes_nothing():
    for first, again in ((ask(), ask()), (let_go("34"), let_go())):
        story = Story().ready()
        story.at(0.1, first, story.report(RELEASE, Outcome.CONFIRMED))
        before, count = story.state, len(story.outputs)
        story.at(0.1, again)
        assert story.state == before
        assert len(story.outputs) == count


def test_another_reason_takes_the_place_of_the_first_without_a_new_decision():
    story = Story().ready()
    story.at(0.1, ask())
    story.at(0.2, ask("NOT_READY"))
    assert reasons(story) == ("upf_can 33 asks to block flight: NOT_READY",)
    assert len(story.decisions(BLOCK)) == 1


# While starting


def test_while_starting_it_blocks_as_an_unhealthy_link_does():
    story = Story()
    story.at(0.0, ask(), story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.STARTUP
    assert WORDS in story.newest(BLOCK).reasons
    for tick in range(1, 102):
        story.at(tick * 0.1, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.BLOCKED
    assert [d.action for d in story.decisions()] == [BLOCK]
    story = Story()
    story.at(0.0, ask(), story.heartbeat(), i.VehicleReport(STANDING))
    story.at(0.1, let_go())
    assert story.state.stage is Stage.READY, "let go while starting it was never a fault"


# In the air


def test_in_the_air_nothing_is_undone_and_it_counts_once_on_the_ground():
    story = Story().flying()
    count = len(story.decisions())
    story.at(0.1, ask())
    story.alive(2.0)
    story.at(2.05, i.ResetRequest(1))
    assert not story.answer(1).success
    assert "upf_can 33" in story.state.device_blocks, "a refused reset forgets nothing"
    assert story.state.stage is Stage.IN_FLIGHT
    assert len(story.decisions()) == count
    story.at(2.1, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.BLOCKED
    assert WORDS in story.newest(BLOCK).reasons
    # What was let go in the air does not count on the ground.
    story = Story().flying()
    story.at(0.1, ask())
    story.at(0.2, let_go())
    story.at(0.3, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.READY


def test_taking_off_although_a_device_asks_is_an_alarm_and_followed_as_a_flight():
    story = Story().ready()
    story.at(0.1, ask())
    story.at(0.2, i.VehicleReport(FLYING))
    assert story.state.stage is Stage.IN_FLIGHT
    assert "took off although BLOCKED" in story.alarms()[0]
    assert story.decisions()[-1].action is RELEASE
    assert "upf_can 33" in story.state.device_blocks


def test_a_kill_and_a_deploy_go_on_whatever_a_device_asks():
    story = Story().flying()
    story.at(1.0, i.DeployRequest(1, False, "it falls"), ask())
    story.at(1.1, story.report(Action.KILL, Outcome.CONFIRMED), ask("NOT_READY"))
    story.at(1.2, story.report(Action.DEPLOY, Outcome.CONFIRMED))
    assert story.answer(1).success
    assert story.state.stage is Stage.DEPLOYED


# Reset and modes


def test_a_reset_forgets_a_unit_that_was_exchanged_and_one_that_still_asks_is_heard():
    story = Story().ready()
    story.at(0.1, ask())
    story.at(0.2, i.ResetRequest(1))
    assert story.answer(1).success
    assert story.state.stage is Stage.READY
    assert dict(story.state.device_blocks) == {}
    story.at(0.3, ask())
    assert story.state.stage is Stage.BLOCKED


def test_inhibited_it_is_remembered_and_blocks_once_active():
    story = Story(mode=i.Mode.INHIBITED).ready()
    story.at(0.1, ask())
    assert story.decisions() == []
    story.at(0.2, i.ModeRequest(1, i.Mode.ACTIVE, force=False))
    assert WORDS in story.newest(BLOCK).reasons


# Too many


def full() -> Story:
    story = Story().ready()
    story.at(0.1, *[ask(device=str(n)) for n in range(MOST_DEVICE_BLOCKS)])
    assert len(story.state.device_blocks) == MOST_DEVICE_BLOCKS
    assert refusals(story) == []
    return story


def test_made_up_names_are_not_remembered_without_end_which_is_said_once():
    story = full()
    for n in range(1000):
        story.at(0.2, ask(device=f"made up {n}"))
    assert len(story.state.device_blocks) == MOST_DEVICE_BLOCKS
    (text,) = refusals(story)
    assert text == "upf_can made up 0 asks to block flight: not remembered, 64 devices do already"


def test_those_that_are_remembered_may_still_change_their_reason_and_let_go():
    story = full()
    story.at(0.2, ask(device="one more"))
    story.at(0.3, ask("NOT_READY", "7"))
    assert story.state.device_blocks["upf_can 7"] == "NOT_READY"
    story.at(0.4, ask(device="one more"))
    assert len(refusals(story)) == 1
    story.at(0.5, let_go("7"), ask(device="one more"))
    assert "upf_can one more" in story.state.device_blocks
    story.at(0.6, ask(device="yet another"))
    assert len(refusals(story)) == 2


def test_after_a_reset_a_new_flood_is_said_again():
    story = full()
    story.at(0.2, ask(device="one more"), i.ResetRequest(1))
    story.at(0.3, *[ask(device=str(n)) for n in range(MOST_DEVICE_BLOCKS + 1)])
    assert len(refusals(story)) == 2
