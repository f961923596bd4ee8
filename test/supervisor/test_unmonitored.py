"""A device that never says anything: hoped for where a person says so, and never believed."""

import pytest
from story import DOWN, LINK, Story, parachute

from chute_ros.errors import ParameterError
from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage

RELAY = "relay"
ALONE = {"required_links": (LINK, RELAY), "deploy_links": (RELAY,)}


def beats(story: Story, state: LinkState = LinkState.UNMONITORED) -> tuple[i.LinkHeartbeat, ...]:
    return story.heartbeat(), story.heartbeat(RELAY, healthy=False, state=state)


def standing(*allowed: str, state: LinkState = LinkState.UNMONITORED, **links: object) -> Story:
    """On the ground for 12 s, in which both nodes are heard."""
    story = Story(SupervisorConfig(unmonitored_links=allowed, **{**ALONE, **links}))
    for step in range(1, 121):
        story.at(step * 0.1, *beats(story, state), story.told(**DOWN, height=0.0))
    return story


def reasons(story: Story) -> str:
    return "; ".join(story.newest(Action.FLIGHT_BLOCK).reasons)


def test_it_forbids_flight_where_nobody_allows_it():
    story = standing()
    assert story.state.stage is Stage.BLOCKED
    assert "relay: UNMONITORED, its device never reports anything" in reasons(story)
    assert "unmonitored_links" in reasons(story), "what to do is named"


def test_it_forbids_flight_also_as_a_second_parachute_that_flight_does_not_depend_on():
    story = standing(required_links=(LINK,), deploy_links=(LINK, RELAY))
    assert story.state.stage is Stage.BLOCKED
    assert "relay: UNMONITORED" in reasons(story)


def test_where_it_is_allowed_the_vehicle_may_fly():
    story = standing(RELAY)
    assert story.state.stage is Stage.READY
    evidence = story.state.evidence(RELAY)
    judged = evidence.judged(story.config.limits(RELAY), 1000.0 + story.t)
    assert judged is LinkJudgement.UNMONITORED, "allowed is not healthy"


@pytest.mark.parametrize("state", [LinkState.NEVER_SEEN, LinkState.LOST])
def test_an_output_that_cannot_be_opened_forbids_flight_all_the_same(state):
    assert standing(RELAY, state=state).state.stage is Stage.BLOCKED


def test_its_node_must_be_heard():
    story = standing(RELAY)
    for step in range(1, 21):
        story.at(12.0 + step * 0.1, story.heartbeat(), story.told(**DOWN, height=0.0))
    assert story.state.stage is Stage.BLOCKED
    assert "relay: STALE, heartbeat of its node" in reasons(story)


def test_one_that_a_person_armed_is_armed_after_a_gap_of_a_link_too():
    story = standing(RELAY)
    story.at(12.0, *beats(story), i.ArmDone(1, True, True, "it can always fire"))
    assert story.state.stage is Stage.ARMED
    for step in range(1, 81):
        heard = beats(story) if step > 20 else (story.heartbeat(),)
        story.at(12.0 + step * 0.1, *heard, story.told(**DOWN, height=0.0))
        assert step != 20 or story.state.stage is Stage.BLOCKED
    assert story.state.stage is Stage.ARMED
    story.at(20.1, *beats(story), i.ArmDone(2, False, True, "disarmed"))
    assert story.state.stage is Stage.READY


def test_it_is_the_last_step_of_a_deploy_wherever_it_is_named():
    links = {"deploy_links": (RELAY, LINK), "required_links": (LINK,)}
    config = SupervisorConfig(unmonitored_links=(RELAY,), **links)
    assert config.ladder == (Rung(LINK), Rung(RELAY))
    named = SupervisorConfig(
        unmonitored_links=(RELAY,), deploy_ladder=(Rung(RELAY), Rung(LINK)), **links
    )
    assert named.ladder == (Rung(RELAY), Rung(LINK)), "an order that a person gives counts"


def test_a_deploy_that_was_sent_is_never_taken_for_confirmed():
    story = standing(RELAY)
    for step in range(1, 21):
        story.at(12.0 + step * 0.1, *beats(story), story.told(height=50.0))
    assert story.state.stage is Stage.IN_FLIGHT
    story.at(14.1, i.DeployRequest(1, False, "a person saw it"))
    story.at(14.15, story.report(Action.KILL, Outcome.CONFIRMED))
    deploy = story.newest(Action.DEPLOY)
    assert deploy.targets == (RELAY,)
    assert story.alarms() == []
    story.at(14.2, story.report(Action.DEPLOY, Outcome.SENT, RELAY, "sent"))
    assert story.state.stage is Stage.FAULT, "nothing more can come"
    assert not story.answer(1).success
    alarm = "no parachute confirmed and none can be: relay: sent"
    assert story.alarms() == [alarm]
    for step in range(1, 80):
        story.at(14.2 + step * 0.1, *beats(story), story.told(height=50.0))
    assert len(story.decisions(Action.DEPLOY)) == 1, "SENT is heard: nothing is sent again"
    assert story.alarms() == [alarm, *[f"still no parachute confirmed: {alarm}"] * 3]


def test_while_another_link_may_yet_confirm_a_deploy_the_relay_s_sent_does_not_end_it():
    story = standing(RELAY, required_links=(LINK,), deploy_links=(LINK, RELAY))
    for step in range(1, 21):
        story.at(12.0 + step * 0.1, *beats(story), parachute(), story.told(height=80.0))
    story.at(14.1, i.DeployRequest(1, False, "a person saw it"))
    story.at(14.15, story.report(Action.KILL, Outcome.CONFIRMED))
    story.at(14.2, story.report(Action.DEPLOY, Outcome.SENT, LINK, "sent"))
    assert story.state.stage is Stage.DEPLOYING
    for step in range(1, 31):
        story.at(14.2 + step * 0.1, *beats(story), parachute(), story.told(height=70.0))
    first, second = story.decisions(Action.DEPLOY)
    assert second.targets == (RELAY,)
    story.at(17.3, story.report(Action.DEPLOY, Outcome.SENT, RELAY, "sent"))
    assert story.state.stage is Stage.FAULT
    story.at(17.4, i.ActionReport(first.epoch, first.id, LINK, Outcome.CONFIRMED, "out"))
    assert story.state.stage is Stage.DEPLOYED, "the first one opened late"


def test_beside_a_parachute_that_tells_it_fires_once_that_one_does_not_open():
    story = standing(RELAY, required_links=(LINK,), deploy_links=(RELAY, LINK))
    for step in range(1, 21):
        story.at(12.0 + step * 0.1, *beats(story), parachute(), story.told(height=80.0))
    story.at(14.1, i.DeployRequest(1, False, "a person saw it"))
    story.at(14.15, story.report(Action.KILL, Outcome.CONFIRMED))
    for step in range(1, 31):
        story.at(14.2 + step * 0.1, *beats(story), parachute(), story.told(height=70.0))
    assert [d.targets for d in story.decisions(Action.DEPLOY)] == [(LINK,), (RELAY,)]


def test_a_link_that_is_not_there_cannot_be_allowed():
    with pytest.raises(ParameterError, match="unmonitored_links names relay: need one of mavlink"):
        SupervisorConfig(unmonitored_links=(RELAY,))
