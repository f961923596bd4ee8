"""The states of a controller: every pair of the table, what enters with them, jumps."""

import pytest

from chute_ros.errors import TransitionError
from chute_ros.links.upf.protocol import machine
from chute_ros.links.upf.protocol.machine import Stimulus as E
from chute_ros.model import ParachuteState as S
from chute_ros.transitions import after

NAMED = [state for state in S if state is not S.UNKNOWN]
RESTARTS = {(state, E.RESTART): S.NOT_READY for state in NAMED}
WANTED = {
    (S.NOT_READY, E.SELF_TEST_PASSED): S.READY,
    (S.NOT_READY, E.SELF_TEST_FAILED): S.ABNORMAL,
    (S.NOT_READY, E.TRIGGER_FIRED): S.LAUNCHED,
    (S.READY, E.TAKEOFF): S.TAKEOFF,
    (S.READY, E.TRIGGER_FIRED): S.LAUNCHED,
    (S.READY, E.FAULT): S.ABNORMAL,
    (S.TAKEOFF, E.ARM): S.ARMED,
    (S.TAKEOFF, E.LAND): S.READY,
    (S.TAKEOFF, E.TRIGGER_FIRED): S.LAUNCHED,
    (S.TAKEOFF, E.FAULT): S.ABNORMAL,
    (S.ARMED, E.DISARM): S.TAKEOFF,
    (S.ARMED, E.TRIGGER_FIRED): S.LAUNCHED,
    (S.ARMED, E.FAULT): S.ABNORMAL,
    (S.LAUNCHED, E.AT_REST): S.TOUCHDOWN,
    (S.ABNORMAL, E.FAULT_CLEARED): S.READY,
    (S.ABNORMAL, E.TRIGGER_FIRED): S.LAUNCHED,
    **RESTARTS,
}
JUMPS = {(before, after) for (before, _), after in WANTED.items()}


def test_states_are_numbered_as_in_the_document():
    assert [(state.name, int(state)) for state in NAMED] == [
        ("NOT_READY", 1),
        ("READY", 2),
        ("TAKEOFF", 3),
        ("ARMED", 4),
        ("LAUNCHED", 5),
        ("TOUCHDOWN", 6),
        ("ABNORMAL", 7),
    ]


@pytest.mark.parametrize("state", S)
@pytest.mark.parametrize("stimulus", E)
def test_pair_of_state_and_stimulus_moves_or_raises(state, stimulus):
    if (state, stimulus) in WANTED:
        assert after(machine.TRANSITIONS, state, stimulus) is WANTED[state, stimulus]
    else:
        with pytest.raises(TransitionError, match=state.name):
            after(machine.TRANSITIONS, state, stimulus)


@pytest.mark.parametrize("before", S)
@pytest.mark.parametrize("after", S)
def test_jump_is_known_if_the_table_has_a_cause_for_it(before, after):
    known = before in (after, S.UNKNOWN) or (before, after) in JUMPS
    assert machine.is_known_jump(before, after) is known
    moved = before not in (after, S.UNKNOWN)
    assert bool(machine.causes(before, after)) is (moved and (before, after) in JUMPS)


def test_cause_of_a_jump_is_told():
    assert machine.causes(S.READY, S.TAKEOFF) == [E.TAKEOFF]
    assert set(machine.causes(S.ABNORMAL, S.READY)) == {E.FAULT_CLEARED}
    assert machine.causes(S.TOUCHDOWN, S.NOT_READY) == [E.RESTART]


def test_requests_on_entering_a_state_are_those_of_the_document():
    assert machine.ENTRY_REQUESTS == {
        S.NOT_READY: "TYPE_FLIGHT_BLOCK",
        S.READY: "TYPE_FLIGHT_BLOCK_RELEASE",
        S.ABNORMAL: "TYPE_FLIGHT_BLOCK",
    }
    assert machine.LAUNCH_REQUEST == "TYPE_KILLSWITCH"
    assert machine.REST_TIME == 5.0
    assert {S.NOT_READY, S.ABNORMAL} == machine.BLOCKING
    assert {S.LAUNCHED, S.TOUCHDOWN} == machine.DEPLOYED


# -- the vehicle follows ----------------------------------------------------------------------


@pytest.mark.parametrize(("before", "after"), sorted(JUMPS))
def test_jump_of_the_table_is_followed_without_a_warning(bench, before, after):
    story = bench("").status(before.name).clear().status(after.name)
    controller = story.link.devices.controllers[33]
    assert (controller.state, controller.unknown_jumps) == (after, 0)
    told = [text for text in story.notices() if "controller 33" in text]
    assert told == ([] if before is after else [f"controller 33: {before.name} to {after.name}"])


UNKNOWN_JUMPS = [(b, a) for b in NAMED for a in NAMED if a is not b and (b, a) not in JUMPS]


@pytest.mark.parametrize(("before", "after"), UNKNOWN_JUMPS)
def test_jump_that_the_table_does_not_know_is_followed_and_reported(bench, before, after):
    story = bench("").status(before.name).clear().status(after.name)
    controller = story.link.devices.controllers[33]
    assert (controller.state, controller.unknown_jumps) == (after, 1)
    assert controller.newest_unknown_jump == f"{before.name} to {after.name}"
    wanted = f"controller 33 went from {before.name} to {after.name}, which is not in its document"
    assert wanted in story.notices()


def test_first_state_that_is_heard_needs_no_cause(bench):
    story = bench("").status("LAUNCHED")
    assert story.link.devices.controllers[33].unknown_jumps == 0


def test_number_without_a_name_is_unknown_and_said_to_be(bench):
    story = bench("").status("READY")
    free = next(n for n in range(8) if story.definitions.state(n) is None)
    story.puppet(33).broadcast("flyfire.ParachuteStatus", {"state": free})
    story.deliver(story.puppet(33))
    picture = story.picture()
    assert picture.state is S.UNKNOWN
    assert f"state {free} has no name" in picture.faults
