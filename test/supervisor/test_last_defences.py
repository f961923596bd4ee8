"""What stops a mistake of the core itself, or of who feeds it, before it reaches a device."""

from dataclasses import replace
from types import MappingProxyType

import pytest
from story import LINK, START, Story, changed

from chute_ros.model import Action, Decision, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.requests import MOST_DEVICE_BLOCKS
from chute_ros.supervisor.sending import fire
from chute_ros.supervisor.turn import Turn

K, D = Action.KILL, Action.DEPLOY
TWO = SupervisorConfig(deploy_links=(LINK, "upf_can"))


def deploying() -> Story:
    return Story(TWO).deploying(LINK, "upf_can")


def test_no_step_is_fired_after_a_confirmation_or_beyond_the_last_whoever_asks():
    story = deploying()
    (step,) = story.state.deploying.deploys
    confirmed = MappingProxyType({LINK: frozenset({Outcome.CONFIRMED})})
    for deploys in ((replace(step, outcomes=confirmed),), (step, step)):
        turn = Turn(story.config, changed(story.state, deploys=deploys), START + 1.2)
        fire(turn, D, "mistake", ())
        assert turn.outputs == []


@pytest.mark.parametrize(
    "alarms", [(), ("no parachute confirmed within 5.0 s: x",), ("another before it", "the last")]
)
def test_an_alarm_that_is_due_is_said_though_the_state_knows_of_none(alarms):
    """A state that contradicts itself, of a black box or of a leader: it still falls."""
    story = deploying()
    due = {"alarms": alarms, "alarm_at": START + 1.2}
    story.state = changed(story.state, stage=Stage.FAULT, **due)
    said = [o.text for o in story.at(1.2) if isinstance(o, i.LogMessage)]
    assert ": ".join(("still no parachute confirmed", *alarms[-1:])) in said
    assert story.state.alarming.alarm_at == START + 1.2 + story.config.alarm_interval


def test_a_step_of_the_ladder_that_addresses_nobody_is_followed_by_the_next():
    story = deploying()
    (step,) = story.state.deploying.deploys
    nobody = replace(step, targets=(), decision=replace(step.decision, targets=()))
    story.state = changed(story.state, deploys=(nobody,))
    story.at(1.2)
    assert story.newest(D).targets == ("upf_can",)


@pytest.mark.parametrize("mode", [i.Mode.SHADOW, i.Mode.INHIBITED])
def test_a_ladder_that_is_found_in_another_mode_sends_nothing_and_ends(mode):
    story = deploying()
    story.state = replace(story.state, mode=mode)
    count = len(story.decisions(D))
    story.at(60.0)
    assert all(decision.shadow for decision in story.decisions(D)[count:])


def test_one_that_follows_takes_a_refusal_for_no_reason_to_decide_anew():
    story = deploying()
    decision = story.newest(D)
    later = Pending(Decision(7, 99, D, "later", (), (LINK,)), (LINK,), START + 1.1, START + 1.1)
    deploys = (*story.state.deploying.deploys, later)
    story.state = changed(story.state, leading=False, deploys=deploys)
    count = len(story.decisions())
    failed = i.ActionReport(decision.epoch, decision.id, LINK, Outcome.FAILED, "older")
    story.at(1.2, failed)
    assert len(story.decisions()) == count


def test_made_up_devices_that_ask_for_a_kill_do_not_grow_it_and_are_obeyed():
    story = Story().flying()
    for n in range(2 * MOST_DEVICE_BLOCKS):
        story.at(0.1, i.KillRequest(0, f"made up {n}", "why"))
    assert len(story.state.asks) == MOST_DEVICE_BLOCKS
    assert story.fired() == ["KILL"]


def test_time_that_runs_backwards_is_not_followed():
    story = Story().flying().fly(1.0)
    before = story.state
    story._update((story.heartbeat(state=LinkState.OK),), 0.2)
    assert story.state.own.updated_at == before.own.updated_at
    assert story.state.heard.links[LINK].heard == START + 1.0
