"""What was recorded is decided once more, to the last bit."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from story import START, Story, shipped
from test_properties import EVIDENCE, RELEASED, REQUESTS, TIMES

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.record import CODEC, CoreTurn, replay
from chute_ros.supervisor.state import State

MULTIROTOR = shipped("multirotor")
NAMES = ("height", "vertical_speed", "tilt", "acceleration", "latitude")
FIELDS = st.one_of(st.floats(), st.floats(-20.0, 20.0))
VEHICLES = st.builds(
    lambda parts: Story().told(**parts),
    st.fixed_dictionaries({}, optional=dict.fromkeys(NAMES, FIELDS)),
)
SEQUENCES = st.lists(
    st.tuples(
        st.one_of(TIMES, st.floats(0.0, 3.0)),
        st.lists(st.one_of(EVIDENCE, RELEASED, REQUESTS, VEHICLES), max_size=3),
    ),
    max_size=25,
)


def record(
    config: SupervisorConfig, state: State, sequence: list[tuple[float, list[i.Input]]]
) -> tuple[State, list[CoreTurn]]:
    """Live: each turn as the black box keeps it."""
    now, turns = START, []
    for wait, inputs in sequence:
        now += wait
        state, outputs = update(config, state, tuple(inputs), now)
        turns.append(CoreTurn(now, tuple(inputs), outputs))
    return state, turns


def decided(outputs: tuple[i.Output, ...]) -> list[i.Output]:
    """The decisions among them: what is told on the ground differs with each profile."""
    return [output for output in outputs if isinstance(output, i.Decide)]


def through_the_file(turns: list[CoreTurn]) -> list[CoreTurn]:
    """Each part written as text and read back."""
    return [
        CoreTurn(
            CODEC.from_json(CODEC.to_json(turn.now)),
            tuple(CODEC.from_json(CODEC.to_json(one)) for one in turn.inputs),
            tuple(CODEC.from_json(CODEC.to_json(one)) for one in turn.outputs),
        )
        for turn in turns
    ]


@settings(max_examples=80)
@given(SEQUENCES, st.sampled_from(i.Mode))
def test_a_replay_decides_what_was_decided(sequence, mode):
    state = State(epoch=7, started_at=START, mode=mode)
    end, turns = record(MULTIROTOR, state, sequence)
    config = CODEC.from_json(CODEC.to_json(MULTIROTOR, whole=True))
    first = CODEC.from_json(CODEC.to_json(state))
    again = list(replay(config, first, through_the_file(turns)))
    assert [outputs for _, _, outputs in again] == [turn.outputs for turn in turns]
    if again:
        assert CODEC.to_json(again[-1][1]) == CODEC.to_json(end)


@settings(max_examples=40)
@given(SEQUENCES, SEQUENCES)
def test_a_replay_may_begin_in_the_middle(before, after):
    state = State(epoch=7, started_at=START)
    middle, turns = record(MULTIROTOR, state, before)
    later = [(sum(wait for wait, _ in before), []), *after]
    _, more = record(MULTIROTOR, middle, later)
    begun = CODEC.from_json(CODEC.to_json(middle, whole=True))
    for turn, _, outputs in replay(MULTIROTOR, begun, through_the_file(more)):
        assert outputs == turn.outputs
    assert len(turns) == len(before)


def test_a_flight_that_ended_under_its_parachute_is_replayed():
    story = Story(MULTIROTOR)
    begin = story.state
    story.ready().fly(1.0).fall(3.0)
    story.at(3.0, story.report(Action.DEPLOY, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYED
    end = begin
    for turn, state, outputs in replay(MULTIROTOR, begin, through_the_file(story.turns)):
        assert outputs == turn.outputs
        end = state
    assert str(end) == str(story.state)


def test_with_other_settings_the_replay_differs_and_shows_where():
    story = Story(MULTIROTOR)
    begin = story.state
    story.ready().fly(1.0).fly(2.0, tilt=70.0, vertical_speed=-4.0)
    again = replay(shipped("fixed_wing"), begin, story.turns)
    differs = [turn.now for turn, _, outputs in again if decided(outputs) != decided(turn.outputs)]
    assert differs[0] == pytest.approx(START + story.when(Action.KILL), abs=1e-6)
