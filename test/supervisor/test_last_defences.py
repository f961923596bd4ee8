"""What stops a mistake of the core itself, or of who feeds it, before it reaches a device."""

from dataclasses import replace
from types import MappingProxyType

import pytest
from story import LINK, START, Story

from chute_ros.errors import RecordError
from chute_ros.model import Action, Decision, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.handover import followed
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.requests import MOST_DEVICE_BLOCKS
from chute_ros.supervisor.sending import fire
from chute_ros.supervisor.turn import Turn

K, D = Action.KILL, Action.DEPLOY
TWO = SupervisorConfig(deploy_links=(LINK, "upf_can"))


def deploying() -> Story:
    story = Story(TWO).flying()
    story.at(0.9, story.heartbeat(), story.heartbeat("upf_can"))
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    return story


def test_after_a_confirmation_no_step_is_fired_whoever_asks() -> None:
    story = deploying()
    (step,) = story.state.deploying.deploys
    confirmed = MappingProxyType({LINK: frozenset({Outcome.CONFIRMED})})
    state = replace(
        story.state,
        deploying=replace(story.state.deploying, deploys=(replace(step, outcomes=confirmed),)),
    )
    turn = Turn(story.config, state, START + 1.2)
    fire(turn, D, "mistake", ())
    assert turn.outputs == []


def test_beyond_the_last_step_of_the_ladder_nothing_is_fired() -> None:
    story = deploying()
    (step,) = story.state.deploying.deploys
    state = replace(story.state, deploying=replace(story.state.deploying, deploys=(step, step)))
    turn = Turn(story.config, state, START + 1.2)
    fire(turn, D, "mistake", ())
    assert turn.outputs == []


@pytest.mark.parametrize(
    "alarms", [(), ("no parachute confirmed within 5.0 s: x",), ("another before it", "the last")]
)
def test_an_alarm_that_is_due_is_said_though_the_state_knows_of_none(alarms: tuple) -> None:
    """A state that contradicts itself, of a black box or of a leader: it still falls."""
    story = deploying()
    story.state = replace(
        story.state,
        stage=Stage.FAULT,
        alarming=replace(story.state.alarming, alarms=alarms, alarm_at=START + 1.2),
    )
    said = [o.text for o in story.at(1.2) if isinstance(o, i.LogMessage)]
    assert ": ".join(("still no parachute confirmed", *alarms[-1:])) in said
    assert story.state.alarming.alarm_at == START + 1.2 + story.config.alarm_interval


def test_a_step_of_the_ladder_that_addresses_nobody_is_followed_by_the_next() -> None:
    story = deploying()
    (step,) = story.state.deploying.deploys
    nobody = replace(step, targets=(), decision=replace(step.decision, targets=()))
    story.state = replace(story.state, deploying=replace(story.state.deploying, deploys=(nobody,)))
    story.at(1.2)
    assert story.newest(D).targets == ("upf_can",)


@pytest.mark.parametrize("mode", [i.Mode.SHADOW, i.Mode.INHIBITED])
def test_a_ladder_that_is_found_in_another_mode_sends_nothing_and_ends(mode: i.Mode) -> None:
    story = deploying()
    story.state = replace(story.state, mode=mode)
    count = len(story.decisions(D))
    story.at(60.0)
    assert all(decision.shadow for decision in story.decisions(D)[count:])


def test_one_that_follows_takes_a_refusal_for_no_reason_to_decide_anew() -> None:
    story = deploying()
    decision = story.newest(D)
    later = Decision(7, 99, D, "later", (), (LINK,))
    state = replace(
        story.state,
        own=replace(story.state.own, leading=False),
        deploying=replace(
            story.state.deploying,
            deploys=(
                *story.state.deploying.deploys,
                Pending(later, (LINK,), START + 1.1, START + 1.1),
            ),
        ),
    )
    story.state = state
    count = len(story.decisions())
    failed = i.ActionReport(decision.epoch, decision.id, LINK, Outcome.FAILED, "older")
    story.at(1.2, failed)
    assert len(story.decisions()) == count


def test_what_a_node_has_seen_of_a_newer_leader_is_told_by_a_standby_and_not_outbid() -> None:
    story = Story(SupervisorConfig(standby=True)).flying()
    story.at(1.0, i.KillRequest(5, "operator", "stop"))
    kill = story.newest(K)
    seen = i.ActionReport(kill.epoch, kill.id, LINK, Outcome.FAILED, "older", 9, 1)
    outputs = story.at(1.1, seen)
    assert i.Refused(9) in outputs
    assert story.state.epoch == kill.epoch


def test_made_up_devices_that_ask_for_a_kill_do_not_grow_it_and_are_obeyed() -> None:
    story = Story().flying()
    for n in range(2 * MOST_DEVICE_BLOCKS):
        story.at(0.1, i.KillRequest(0, f"made up {n}", "why"))
    assert len(story.state.asks) == MOST_DEVICE_BLOCKS
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize("plain", ["7", '"kill"', "[1]"])
def test_a_part_of_a_record_that_is_of_another_kind_is_said(plain: str) -> None:
    with pytest.raises(RecordError, match="VehicleState"):
        CODEC.from_json(f'{{"is":"VehicleReport","state":{plain}}}')


def test_what_a_leader_told_that_does_not_fit_is_said() -> None:
    kill = '{"is":"Ask","at":1,"link":"a","reason":"b"}'
    text = f'{{"is":"State","epoch":1,"started_at":0,"kill":{kill}}}'
    with pytest.raises(RecordError, match="is no Pending"):
        followed(Story().state, text, START)


def test_time_that_runs_backwards_is_not_followed() -> None:
    story = Story().flying().fly(1.0)
    before = story.state
    story._update((story.heartbeat(state=LinkState.OK),), 0.2)
    assert story.state.own.updated_at == before.own.updated_at
    assert story.state.heard.links[LINK].heard == START + 1.0
