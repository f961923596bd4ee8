"""The table of stages: what is listed, and that nothing else is possible."""

import itertools

import pytest

from chute_ros.errors import TransitionError
from chute_ros.supervisor.machine import TRANSITIONS, Stage, StageEvent, listed
from chute_ros.transitions import after

PAIRS = list(itertools.product(Stage, StageEvent))


@pytest.mark.parametrize(("stage", "event"), PAIRS, ids=lambda one: one.name)
def test_a_pair_is_listed_or_raises(stage: Stage, event: StageEvent) -> None:
    if (stage, event) in TRANSITIONS:
        assert listed(stage, event)
        assert after(TRANSITIONS, stage, event) is TRANSITIONS[stage, event]
    else:
        assert not listed(stage, event)
        with pytest.raises(TransitionError, match=stage.name):
            after(TRANSITIONS, stage, event)


def test_every_stage_is_reachable_from_the_start() -> None:
    reached = {Stage.STARTUP}
    while True:
        more = {after for (before, _), after in TRANSITIONS.items() if before in reached}
        if more <= reached:
            break
        reached |= more
    assert reached == set(Stage)


def test_deploying_is_entered_only_from_killing() -> None:
    entries = {before for (before, _), after in TRANSITIONS.items() if after is Stage.DEPLOYING}
    assert entries == {Stage.KILLING}


def test_only_a_reset_a_person_who_insists_or_a_device_that_erred_leaves_deployed() -> None:
    ways = {event for (before, event) in TRANSITIONS if before is Stage.DEPLOYED}
    assert ways == {StageEvent.RESET, StageEvent.KILL, StageEvent.TAKEN_BACK}


def test_nothing_but_a_reset_leads_back_to_the_start() -> None:
    ways = {s for (_, s), after in TRANSITIONS.items() if after is Stage.STARTUP}
    assert ways == {StageEvent.RESET}
