"""What a leader tells those that follow, and how one goes on where it stopped."""

import json
import math

import pytest
from story import FLYING, LINK, START, Story, parachute

from chute_ros.errors import RecordError
from chute_ros.model import Action, Outcome
from chute_ros.supervisor import handover
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.state import Own, State

K, D = Action.KILL, Action.DEPLOY
CONFIG = SupervisorConfig(standby=True)
#: The other host's monotonic clock is ahead by this, s.
AHEAD = 5000.0


def follower(now: float = START) -> State:
    return State(epoch=1, started_at=now + AHEAD, own=Own(leading=False))


def handed(story: Story, to: State | None = None) -> State:
    """The follower's state after the leader's newest claim."""
    now = START + story.t
    return handover.followed(to or follower(), handover.told(story.state, now), now + AHEAD)


def take_over(state: State, t: float) -> tuple[State, tuple[i.Output, ...]]:
    return update(CONFIG, state, (i.TakeOver(8),), START + AHEAD + t)


def decided(outputs: tuple[i.Output, ...], action: Action) -> list[i.Decide]:
    return [o for o in outputs if isinstance(o, i.Decide) and o.decision.action is action]


def falling() -> Story:
    """In flight, a deploy asked for at t = 1."""
    story = Story(CONFIG).flying()
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    return story


def test_times_are_told_as_ages_and_come_back_in_the_other_hosts_clock() -> None:
    story = falling()
    story.at(1.2)
    state = handed(story)
    assert state.stage is Stage.KILLING
    assert state.deploying.deploy_due == pytest.approx(START + AHEAD + 1.5)
    assert state.killing.kill is not None
    assert state.killing.kill.decided_at == pytest.approx(START + AHEAD + 1.0)
    assert state.stage_since == pytest.approx(START + AHEAD + 1.0)
    assert math.isnan(state.alarming.alarm_at)


def test_what_each_hears_itself_is_not_taken_over() -> None:
    story = falling()
    own = follower()
    own, _ = update(CONFIG, own, (story.heartbeat(), i.VehicleReport(FLYING)), START + AHEAD)
    state = handed(story, own)
    assert state.heard.links == own.heard.links
    assert state.heard.vehicle == own.heard.vehicle
    assert not state.own.leading


def test_one_that_follows_decides_and_answers_nothing() -> None:
    story = Story(CONFIG).flying()
    state = handed(story)
    for one in (
        i.DeployRequest(1, True, "now"),
        i.KillRequest(2, "operator", "now"),
        i.ArmRequest(3, True, 0),
        i.ResetRequest(4),
        i.ModeRequest(6, i.Mode.SHADOW, True),
    ):
        state, outputs = update(CONFIG, state, (one,), START + AHEAD + 1.0)
        (answer,) = outputs
        assert isinstance(answer, i.Finish)
        assert "another supervisor decides" in answer.message
        assert state.stage is Stage.IN_FLIGHT
    state, outputs = update(
        CONFIG, state, (i.KillRequest(0, "upf_can 33", "about to launch"),), START + AHEAD + 2.0
    )
    assert outputs == ()
    # Who takes over within the time that the wish lasts follows it.
    state, outputs = take_over(state, 2.5)
    assert decided(outputs, K)


def test_a_deploy_that_waits_for_its_kill_goes_on_at_its_time() -> None:
    story = falling()
    state = handed(story)
    state, outputs = take_over(state, 1.3)
    # The kill was not reported as begun: it leaves again, under the new number.
    (kill,) = decided(outputs, K)
    assert kill.decision.epoch == 8
    assert decided(outputs, D) == []
    state, outputs = update(CONFIG, state, (), START + AHEAD + 1.5)
    (deploy,) = decided(outputs, D)
    assert (deploy.decision.epoch, state.stage) == (8, Stage.DEPLOYING)


@pytest.mark.parametrize("outcome", [Outcome.SENT, Outcome.ACCEPTED])
def test_a_shot_that_a_device_has_begun_is_not_shot_again(outcome: Outcome) -> None:
    story = falling()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.heartbeat(), story.report(D, outcome))
    number = story.newest(D)
    state, outputs = take_over(handed(story), 1.3)
    assert decided(outputs, D) == []
    confirmed = i.ActionReport(number.epoch, number.id, LINK, Outcome.CONFIRMED, "out")
    state, _ = update(CONFIG, state, (confirmed,), START + AHEAD + 1.4)
    assert state.stage is Stage.DEPLOYED


def test_a_shot_that_nobody_has_begun_is_not_lost() -> None:
    story = falling()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    _, outputs = take_over(handed(story), 1.3)
    (deploy,) = decided(outputs, D)
    assert deploy.decision.epoch == 8


def test_a_parachute_that_is_out_stays_out_for_the_next_leader() -> None:
    story = falling()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, parachute(deployed=True))
    state, outputs = take_over(handed(story), 9.0)
    assert state.stage is Stage.DEPLOYED
    assert decided(outputs, K) == decided(outputs, D) == []


def test_whoever_waits_at_one_that_steps_down_is_told() -> None:
    story = falling()
    state, outputs = update(CONFIG, story.state, (i.StepDown("it was stopped"),), START + 1.1)
    (answer,) = (o for o in outputs if isinstance(o, i.Finish))
    assert answer.token == 5
    assert "another supervisor decides, call again: it was stopped" in answer.message
    assert not state.own.leading


def test_what_another_version_wrote_is_refused_in_words() -> None:
    with pytest.raises(RecordError, match="class Stat is not known"):
        handover.followed(follower(), '{"is":"Stat"}', START)
    with pytest.raises(RecordError, match="not a state"):
        handover.followed(follower(), "[]", START)


def test_two_that_hear_the_same_are_in_the_same_state() -> None:
    story = falling()
    own = handed(story)
    again = handed(story, own)
    assert CODEC.to_json(own) == CODEC.to_json(again)


def test_a_parachute_that_the_follower_has_heard_to_be_out_is_not_ordered_once_more() -> None:
    """The leader has not, as nothing reaches it any more."""
    story = falling()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    state, outputs = take_over(handed(story), 1.2)
    assert decided(outputs, D), "it has not heard of it either"
    now = START + AHEAD
    state, _ = update(CONFIG, follower(), (story.heartbeat(), parachute()), now + 1.0)
    heard, _ = update(CONFIG, state, (story.heartbeat(), parachute(deployed=True)), now + 1.15)
    state, outputs = take_over(handed(story, heard), 1.2)
    assert state.stage is Stage.DEPLOYED
    assert not decided(outputs, D)


def spoilt(**fields: object) -> str:
    """What a leader in flight tells, with other values in these fields."""
    told = json.loads(handover.told(falling().state, START))
    return json.dumps(told | fields)


@pytest.mark.parametrize(
    "fields",
    [
        {"epoch": 2**70},
        {"epoch": 2**32},
        {"epoch": 0},
        {"epoch": -5},
        {"next_id": 2**64 - 1},
        {"next_id": 0},
        {"alarms": ["\ud800"]},
        {"device_blocks": [["\udfff", "why"]]},
    ],
    ids=str,
)
def test_what_cannot_be_decided_nor_told_is_not_followed(fields: dict[str, object]) -> None:
    assert handover.followed(follower(), spoilt(), START).stage is Stage.KILLING
    with pytest.raises(RecordError):
        handover.followed(follower(), spoilt(**fields), START)


def test_a_decision_under_way_whose_number_no_message_holds_is_not_followed() -> None:
    kill = json.loads(spoilt())["kill"]
    kill["decision"]["id"] = 2**64
    with pytest.raises(RecordError, match="there is no decision"):
        handover.followed(follower(), spoilt(kill=kill), START)
