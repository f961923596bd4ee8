"""A parachute that was released is not forgotten before a person resets, whoever released it."""

from typing import Any

import pytest
from story import DOWN, LINK, STANDING, START, Story, parachute

from chute_ros.errors import RecordError
from chute_ros.model import Action, Armed
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.link_reports import MOST_REMEMBERED
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import block_reasons
from chute_ros.supervisor.resume import dump_parachutes, load_parachutes

WHO = f"{LINK} 1/161"
TOLD = f"{WHO} was released: repack or replace it, then call safety/reset"


def on(story: Story, until: float, *told: i.Input, **vehicle: Any) -> None:
    """Healthy links and a vehicle that stands."""
    while story.t < until - 1e-9:
        standing = story.told(**(DOWN | {"height": 0.0} | vehicle))
        story.at(story.t + 0.1, story.heartbeat(), standing, *told)


def armed() -> Story:
    story = Story().ready()
    story.at(0.1, i.ArmDone(1, True, True, "armed"))
    assert story.state.stage is Stage.ARMED
    return story


def why(story: Story) -> str:
    return "; ".join(block_reasons(story.config, story.state, START + story.t))


@pytest.mark.parametrize("start", [Story().ready, armed])
def test_one_that_is_released_past_the_supervisor_on_the_ground_blocks_until_a_reset(start):
    story = start()
    on(story, 1.0, parachute(deployed=True))
    assert story.state.stage is Stage.BLOCKED
    assert story.alarms() == [TOLD]
    # Given a module that starts anew and has forgotten it
    on(story, 20.0, parachute(deployed=False))
    assert story.state.stage is Stage.BLOCKED
    assert why(story) == TOLD
    assert story.newest(Action.FLIGHT_BLOCK).reasons == (TOLD,)
    story.at(20.1, story.heartbeat(), i.ResetRequest(2))
    assert story.answer(2).success
    on(story, 21.0, parachute(deployed=False))
    assert story.state.stage is Stage.READY
    assert story.state.alarming.alarms == ()


def test_a_reset_counts_for_one_that_still_says_it_but_not_for_the_next_release():
    story = Story().ready()
    on(story, 1.0, parachute(deployed=True))
    story.at(1.1, story.heartbeat(), i.ResetRequest(2))
    on(story, 2.0, parachute(deployed=True))
    assert story.state.released_since_reset == frozenset()
    on(story, 3.0, parachute(deployed=False))
    assert story.state.stage is Stage.READY
    on(story, 4.0, parachute(deployed=True))
    assert why(story) == TOLD


def test_what_was_released_in_flight_is_remembered_after_the_landing():
    """Nobody ordered it, and the device takes it back: the rules live, and nobody takes off with
    it again."""
    story = Story().flying()
    story.at(1.0, story.heartbeat(), story.told(height=50.0), parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    story.at(2.0, story.heartbeat(), story.told(height=50.0), parachute(deployed=False))
    assert story.state.stage is Stage.IN_FLIGHT
    assert not any(TOLD in one for one in story.alarms())
    on(story, 10.0)
    assert story.state.stage is Stage.BLOCKED
    assert why(story) == TOLD


def test_where_it_may_have_bounced_it_holds_nothing_back():
    story = Story().flying()
    on(story, 0.1, landed_state=STANDING.landed_state, armed=Armed.ARMED)
    story.at(0.2, story.heartbeat(), parachute(deployed=True))
    assert story.state.stage is Stage.LANDED
    assert why(story) == ""


def test_a_vehicle_that_takes_off_with_it_all_the_same_is_guarded_by_what_is_left():
    story = Story().ready()
    on(story, 1.0, parachute(deployed=True))
    on(story, 1.5, parachute(deployed=True), armed=Armed.ARMED)
    story.at(2.0, story.heartbeat(), story.told(height=30.0))
    assert story.state.stage is Stage.IN_FLIGHT
    assert "took off although BLOCKED" in story.alarms()


def test_a_link_that_deploys_nothing_says_nothing_of_it():
    story = Story(SupervisorConfig(required_links=(LINK, "upf_can"), deploy_links=(LINK,)))
    story.at(0.1, story.heartbeat("upf_can"), parachute("upf_can", "33", deployed=True))
    assert "33" in story.state.evidence("upf_can").devices
    assert story.state.released_since_reset == frozenset()


def test_made_up_names_do_not_grow_it():
    story = Story().ready()
    every = [parachute(device=f"1/{n}", deployed=True) for n in range(MOST_REMEMBERED + 5)]
    story.at(0.1, *every)
    assert len(story.state.released_since_reset) == MOST_REMEMBERED


def test_what_is_left_of_it_in_a_file_comes_back():
    assert dump_parachutes(frozenset()) == ""
    released = frozenset({(LINK, "1/161"), ("upf_can", "33")})
    text = dump_parachutes(released)
    assert text == '[["mavlink_parachute", "1/161"], ["upf_can", "33"]]'
    assert load_parachutes(text) == released


@pytest.mark.parametrize("text", ["", "{", "{}", "[1]", '["ab"]', '[["a"]]', '[["a", 1]]', "null"])
def test_a_file_that_says_something_else_is_told(text):
    with pytest.raises(RecordError):
        load_parachutes(text)
