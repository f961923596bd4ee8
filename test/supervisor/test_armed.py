"""ARMED is what the parachutes say, not what was commanded once."""

from dataclasses import replace
from typing import Any

import pytest
from story import LINK, STANDING, START, Story, parachute

from chute_ros.model import LinkState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.link_reports import MOST_REMEMBERED
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.wakes import next_deadline

UPF = "upf_can"
GONE = "no parachute says any more that it is armed"


def says(armed: bool, link: str = LINK, alive: bool = True) -> i.ParachuteReport:
    told = parachute(link, alive=alive)
    return replace(told, status=replace(told.status, armed=armed))


def armed(**config: Any) -> Story:
    """Armed at t = 0 through safety/arm."""
    story = Story(SupervisorConfig(**config)).ready()
    story.at(0.0, says(True), i.ArmDone(1, True, True, "armed"))
    assert story.state.stage is Stage.ARMED
    return story


def keeps_saying(story: Story, until: float, *told: i.ParachuteReport) -> None:
    while story.t < until - 1e-9:
        beats = [story.heartbeat(one) for one in (LINK, UPF)]
        story.at(story.t + 0.1, *beats, i.VehicleReport(STANDING), *told)


def test_one_that_was_disarmed_past_the_supervisor_is_armed_no_more():
    story = armed()
    keeps_saying(story, 5.0, says(True))
    assert story.state.stage is Stage.ARMED
    story.at(5.1, story.heartbeat(), says(False))
    assert story.state.stage is Stage.READY
    assert story.alarms() == [GONE]
    assert f"ARMED -> READY: the parachute was disarmed ({GONE})" in story.said()


@pytest.mark.parametrize(("after", "stage"), [(1.9, Stage.ARMED), (2.05, Stage.READY)])
def test_its_status_has_two_seconds_to_show_it(after, stage):
    story = armed()
    keeps_saying(story, 1.8, says(False))
    story.at(after, story.heartbeat())
    assert story.state.stage is stage


def test_the_core_wakes_for_it_by_itself():
    story = armed()
    keeps_saying(story, 1.9, says(False))
    assert next_deadline(story.config, story.state, START + 1.95) == START + 2.0


@pytest.mark.parametrize(
    "told",
    [
        # Nothing is known of it any more.
        (says(False, alive=False),),
        # One of two is.
        (says(False), says(True, UPF)),
        # A link that deploys nothing says nothing of it.
        (says(True), says(False, "umbilical")),
    ],
)
def test_it_stays_armed_while_one_says_so_or_nobody_knows(told):
    story = armed(deploy_links=(LINK, UPF), required_links=(LINK,))
    keeps_saying(story, 5.0, *told)
    assert story.state.stage is Stage.ARMED


# -- armed past the supervisor, or before a link was silent --------------------------------------


def test_one_that_is_armed_past_the_supervisor_is_armed():
    story = Story().ready()
    keeps_saying(story, 1.9, says(True))
    assert story.state.stage is Stage.READY
    keeps_saying(story, 2.1, says(True))
    assert story.state.stage is Stage.ARMED
    assert f"READY -> ARMED: the parachute was armed ({LINK} 1/161 says armed)" in story.said()


def test_after_it_was_disarmed_its_status_has_two_seconds_to_show_it():
    story = armed()
    keeps_saying(story, 3.0, says(True))
    story.at(3.05, i.ArmDone(2, False, True, "disarmed"))
    keeps_saying(story, 4.5, says(True))
    assert story.state.stage is Stage.READY
    assert next_deadline(story.config, story.state, START + 4.9) == START + 5.05
    keeps_saying(story, 9.0, says(False))
    assert story.state.stage is Stage.READY


@pytest.mark.parametrize(("told", "stage"), [(True, Stage.ARMED), (False, Stage.READY)])
def test_when_a_link_is_whole_again_it_is_armed_again_if_it_still_says_so(told, stage):
    story = armed()
    keeps_saying(story, 3.0, says(True))
    while story.t < 4.5:
        story.at(story.t + 0.1, i.VehicleReport(STANDING))
    assert story.state.stage is Stage.BLOCKED
    keeps_saying(story, 5.0, says(told))
    assert story.state.stage is Stage.BLOCKED, "heard again, not for long enough"
    keeps_saying(story, 6.0, says(told))
    assert story.state.stage is stage


def test_a_heartbeat_that_overtakes_its_status_hides_no_armed_parachute():
    """The two come on two topics, whose order nobody promises."""
    story = armed()
    keeps_saying(story, 3.0, says(True))
    silent = story.heartbeat(healthy=False, state=LinkState.STALE)
    story.at(3.1, silent, says(True, alive=False), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.BLOCKED
    story.at(3.2, story.heartbeat())
    assert story.state.stage is Stage.ARMED
    story.at(3.3, says(True), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.ARMED


@pytest.mark.parametrize(("told", "stage"), [(False, Stage.READY), (None, Stage.ARMED)])
def test_what_it_was_before_the_silence_holds_until_it_says_otherwise(told, stage):
    story = armed()
    keeps_saying(story, 3.0, says(True))
    silent = story.heartbeat(healthy=False, state=LinkState.STALE)
    story.at(3.1, silent, says(True, alive=False), i.VehicleReport(STANDING))
    story.at(3.2, story.heartbeat())
    keeps_saying(story, 6.0, *(() if told is None else (says(told),)))
    assert story.state.stage is stage


def test_while_its_status_is_old_it_says_nothing_of_it():
    story = Story().ready()
    keeps_saying(story, 5.0, says(True, alive=False))
    assert story.state.stage is Stage.READY


def test_a_node_that_starts_anew_without_its_device_takes_nothing_back():
    story = armed()
    story.at(0.1, says(False, alive=False))
    assert story.state.last_armed == {(LINK, "1/161")}
    story.at(0.2, says(False))
    assert story.state.last_armed == frozenset()


@pytest.mark.parametrize(("heard", "left"), [(True, 0), (False, 1)])
def test_a_reset_forgets_one_that_was_exchanged_and_none_whose_node_is_silent(heard, left):
    story = armed()
    story.at(0.1, says(True, alive=False))
    while story.t < 4.0:
        beats = [story.heartbeat(healthy=False)] if heard else []
        story.at(story.t + 0.1, *beats, i.VehicleReport(STANDING))
    hint = "one that was exchanged since is forgotten by safety/reset"
    assert "ARMED when it was last received: mavlink_parachute 1/161" in story.text()
    assert (hint in story.text()) is heard
    story.at(4.1, i.ResetRequest(2))
    assert len(story.state.last_armed) == left


def test_what_is_armed_on_a_link_that_releases_nothing_is_nobodys_concern():
    story = Story(SupervisorConfig(required_links=(LINK, UPF), deploy_links=(LINK,)))
    story.at(0.1, says(True, UPF))
    assert story.state.last_armed == frozenset()


def test_made_up_names_do_not_grow_what_is_remembered():
    story = Story().ready()
    every = [says(True).status for _ in range(MOST_REMEMBERED + 5)]
    told = [replace(one, device=f"1/{n}") for n, one in enumerate(every)]
    story.at(0.1, *(i.ParachuteReport(LINK, one) for one in told))
    assert len(story.state.last_armed) == MOST_REMEMBERED
