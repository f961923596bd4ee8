"""Heartbeats of the links: what blocks flight, in which words, and what releases it."""

import itertools

import pytest
from story import FLYING, IDLING, LINK, STANDING, Story, parachute

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import block_reasons


def reasons(story: Story) -> str:
    return "; ".join(block_reasons(story.config, story.state, 1000.0 + story.t))


def test_flight_is_blocked_from_the_first_moment() -> None:
    story = Story()
    story.at(0.0)
    assert [d.action for d in story.decisions()] == [Action.FLIGHT_BLOCK]
    assert "nothing received from its node" in reasons(story)


def test_links_that_do_not_come_up_in_time_are_a_fault() -> None:
    story = Story()
    story.at(9.9)
    assert story.state.stage is Stage.STARTUP
    story.at(10.1)
    assert story.state.stage is Stage.BLOCKED


def test_healthy_links_release_flight() -> None:
    story = Story()
    story.at(0.0)
    story.at(0.1, story.heartbeat(), i.VehicleReport(STANDING))
    blocked = [Action.FLIGHT_BLOCK, Action.FLIGHT_BLOCK_RELEASE]
    assert [d.action for d in story.decisions()] == blocked
    assert story.state.stage is Stage.READY


@pytest.mark.parametrize(
    ("heartbeat", "words"),
    [
        ((False, LinkState.OK), "its device is not healthy"),
        ((False, LinkState.NEVER_SEEN), "nothing received from its device"),
        ((False, LinkState.STALE), "its device is STALE"),
        ((False, LinkState.LOST), "its device is LOST"),
    ],
)
def test_missing_stale_lost_and_unhealthy_are_different(
    heartbeat: tuple[bool, LinkState], words: str
) -> None:
    story = Story().ready()
    story.at(0.1, story.heartbeat(healthy=heartbeat[0], state=heartbeat[1]))
    assert story.state.stage is Stage.BLOCKED
    assert words in reasons(story)
    assert words in "; ".join(story.newest(Action.FLIGHT_BLOCK).reasons)


def test_the_faults_of_the_device_are_named() -> None:
    story = Story().ready()
    story.at(0.1, parachute(LINK, "1/161", False, ("LOW_POWER",)))
    story.at(0.1, story.heartbeat(healthy=False))
    assert "1/161 LOW_POWER" in reasons(story)


def test_a_silent_node_is_stale_and_then_lost_each_at_its_limit() -> None:
    story = Story().ready()
    story.at(0.49)
    assert story.state.stage is Stage.READY
    story.at(0.5)
    assert story.state.stage is Stage.BLOCKED
    assert "STALE, heartbeat of its node 0.50 s old (limit 0.5 s)" in reasons(story)
    story.at(1.0)
    assert "LOST, heartbeat of its node 1.00 s old" in reasons(story)


def test_a_link_that_comes_back_releases_flight_again() -> None:
    story = Story().ready()
    story.at(2.0)
    story.at(2.1, story.heartbeat(), i.VehicleReport(STANDING))
    assert "REGAINED, received again for 0.00 s (need 1 s)" in reasons(story)
    story.alive(3.05)
    assert story.state.stage is Stage.BLOCKED
    story.alive(3.25)
    assert story.state.stage is Stage.READY
    assert story.decisions()[-1].action is Action.FLIGHT_BLOCK_RELEASE


def test_a_link_that_is_not_required_does_not_block() -> None:
    story = Story(SupervisorConfig(deploy_links=(LINK, "upf_can"))).ready()
    assert story.state.stage is Stage.READY


def test_a_link_that_is_not_ours_is_not_followed() -> None:
    story = Story().ready()
    story.at(0.0, story.heartbeat("stranger"), parachute("stranger", "9", True, ()))
    assert set(story.state.heard.links) == {LINK}


def test_a_restarted_node_hears_of_the_block_again() -> None:
    story = Story()
    story.at(0.0, i.LinkHeartbeat(LINK, LinkState.OK, False, 500))
    first = story.newest(Action.FLIGHT_BLOCK)
    story.at(0.1, story.report(Action.FLIGHT_BLOCK, Outcome.CONFIRMED))
    story.at(0.2, i.LinkHeartbeat(LINK, LinkState.OK, False, 0))
    second = story.newest(Action.FLIGHT_BLOCK)
    assert second.id == first.id + 1
    assert "restarted" in second.reasons[-1]


def test_a_node_that_restarts_before_its_second_heartbeat_is_noticed_too() -> None:
    story = Story()
    story.at(0.0, parachute(LINK, "1/161", False, ()))
    story.at(0.1, i.LinkHeartbeat(LINK, LinkState.OK, False, 0))
    assert len(story.decisions()) == 1
    story.at(0.2, i.LinkHeartbeat(LINK, LinkState.OK, False, 0))
    assert len(story.decisions()) == 2


def test_a_node_that_was_lost_may_have_restarted_and_hears_of_the_block_again() -> None:
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(0.1, story.report(Action.FLIGHT_BLOCK, Outcome.CONFIRMED))
    story.at(5.0, story.heartbeat(healthy=False))
    assert len(story.decisions(Action.FLIGHT_BLOCK)) == 2
    assert "is back" in story.newest(Action.FLIGHT_BLOCK).reasons[-1]


def test_a_node_that_never_reports_is_asked_ever_more_rarely_but_once_a_second() -> None:
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    for tick in range(1, 3000):
        story.at(tick * 0.1, story.heartbeat(healthy=False))
    times = [t for t, o in story.outputs if isinstance(o, i.Decide) and o.again]
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert gaps[0] == pytest.approx(0.1)
    assert max(gaps) <= 1.1
    assert len(times) < 320


def test_a_block_is_sent_again_until_reported_but_only_to_a_node_that_lives() -> None:
    story = Story()
    story.at(5.0)
    assert not [o for _, o in story.outputs if isinstance(o, i.Decide) and o.again]
    story.at(5.1, story.heartbeat(healthy=False))
    again = [o for _, o in story.outputs if isinstance(o, i.Decide) and o.again]
    assert [o.decision.action for o in again] == [Action.FLIGHT_BLOCK]
    story.at(5.2, story.report(Action.FLIGHT_BLOCK, Outcome.CONFIRMED))
    count = len(story.outputs)
    story.alive(5.3)
    assert not [o for _, o in story.outputs[count:] if isinstance(o, i.Decide) and o.again]


def test_taking_off_although_blocked_is_an_alarm_and_followed_as_a_flight() -> None:
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(0.1, i.VehicleReport(FLYING))
    assert story.state.stage is Stage.IN_FLIGHT
    assert "in the air although" in story.alarms()[0]
    # The device node undoes arming on the ground while blocked; one wrong landed state in the air
    # must not make it stop the motors.
    assert story.decisions()[-1].action is Action.FLIGHT_BLOCK_RELEASE


def test_a_lost_link_in_flight_neither_blocks_nor_fires() -> None:
    story = Story().flying()
    before = len(story.decisions())
    story.at(60.0)
    assert story.state.stage is Stage.IN_FLIGHT
    assert len(story.decisions()) == before


def test_after_landing_a_disarmed_parachute_makes_it_ready_again() -> None:
    story = Story().flying()
    story.at(0.1, story.heartbeat(), i.VehicleReport(IDLING))
    assert story.state.stage is Stage.LANDED
    story.at(0.2, i.ArmDone(0, False, True, "done"))
    assert story.state.stage is Stage.READY


def test_after_landing_an_autopilot_that_disarms_makes_it_ready_without_a_reset() -> None:
    story = Story().flying()
    story.at(0.1, story.heartbeat(), i.VehicleReport(IDLING))
    assert story.state.stage is Stage.LANDED
    story.at(0.2, i.VehicleReport(STANDING))
    assert story.state.stage is Stage.READY
    story.at(0.3, i.VehicleReport(FLYING))
    assert story.state.stage is Stage.IN_FLIGHT


def test_after_landing_a_link_that_is_not_healthy_blocks_the_next_flight() -> None:
    story = Story().flying()
    story.at(0.1, story.heartbeat(healthy=False), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.BLOCKED
    assert story.decisions()[-1].action is Action.FLIGHT_BLOCK


def test_a_vehicle_state_that_is_old_says_nothing() -> None:
    story = Story().ready()
    assert flight.in_air(story.config, story.state, 1000.0 + 2.0) is False
    assert flight.in_air(story.config, story.state, 1000.0 + 3.0) is None


def test_a_lying_epoch_is_left_behind_and_what_holds_is_decided_anew() -> None:
    story = Story().ready()
    old = story.newest(Action.FLIGHT_BLOCK_RELEASE)
    report = i.ActionReport(old.epoch, old.id, LINK, Outcome.FAILED, "older", newest_epoch=900)
    story.at(0.1, report)
    assert story.state.epoch == 904
    assert story.newest(Action.FLIGHT_BLOCK_RELEASE).epoch == 904


def test_a_report_of_a_stranger_moves_no_epoch() -> None:
    story = Story().ready()
    story.at(0.1, i.ActionReport(7, 1, "stranger", Outcome.FAILED, "older", newest_epoch=900))
    assert story.state.epoch == 7


def test_a_report_on_the_decision_of_another_supervisor_moves_no_epoch() -> None:
    # Two that overtook each other at every report would never end.
    story = Story().ready()
    story.at(0.1, i.ActionReport(900, 1, LINK, Outcome.SENT, "told", newest_epoch=900))
    assert story.state.epoch == 7


def test_a_node_that_knows_higher_numbers_of_our_own_epoch_is_overtaken() -> None:
    # A supervisor before us had the same epoch: its host's clock starts at the same time always.
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    report = i.ActionReport(7, 1, LINK, Outcome.CONFIRMED, "another 7.1", 7, newest_id=40)
    story.at(0.1, report)
    assert story.state.epoch == 8
    assert story.newest(Action.FLIGHT_BLOCK).epoch == 8
    assert story.state.block is not None
    assert not story.state.block.confirmed


def test_the_largest_epoch_cannot_be_overtaken_and_is_not_followed() -> None:
    story = Story().ready()
    story.at(0.1, i.ActionReport(7, 1, LINK, Outcome.FAILED, "older", newest_epoch=2**32 - 1))
    assert story.state.epoch == 7
    assert "the largest: restart it" in story.alarms()[0]


def test_without_vehicle_state_flight_is_blocked_in_those_words() -> None:
    story = Story()
    story.at(0.0, story.heartbeat())
    assert story.state.stage is Stage.STARTUP
    assert "armed or disarmed was never reported" in reasons(story)


def test_a_vehicle_state_that_stops_blocks_flight_at_its_limit() -> None:
    story = Story().ready()
    story.alive(2.4)
    assert story.state.stage is Stage.READY
    story.alive(2.6)
    assert story.state.stage is Stage.BLOCKED
    assert "armed or not is 2.6 s old (limit 2.5 s)" in reasons(story)


def test_vehicle_state_can_be_done_without() -> None:
    story = Story(SupervisorConfig(require_vehicle_state=False))
    story.at(0.0, story.heartbeat())
    assert story.state.stage is Stage.READY


def test_a_deploy_link_that_does_not_exist_blocks_flight_and_is_named() -> None:
    story = Story(SupervisorConfig(deploy_links=("umbilicl",)))
    story.at(0.0, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.STARTUP
    assert reasons(story) == "umbilicl: nothing received from its node"


def test_a_kill_link_that_does_not_exist_blocks_flight_and_is_named() -> None:
    story = Story(SupervisorConfig(kill_links=("mavlnk",)))
    story.at(0.0, story.heartbeat(), i.VehicleReport(STANDING))
    assert reasons(story) == "mavlnk: nothing received from its node"
