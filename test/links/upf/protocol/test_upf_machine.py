"""The states of a controller: every pair of the table, what enters with them, jumps."""

import itertools

import pytest

from chute_ros.errors import TransitionError
from chute_ros.links.upf.protocol import machine
from chute_ros.links.upf.protocol.machine import ControllerEvent
from chute_ros.model import ParachuteState as S
from chute_ros.transitions import after

NAMED = [state for state in S if state is not S.UNKNOWN]
RESTARTS = {(state, ControllerEvent.RESTART): S.NOT_READY for state in NAMED}
WANTED = {
    (S.NOT_READY, ControllerEvent.SELF_TEST_PASSED): S.READY,
    (S.NOT_READY, ControllerEvent.SELF_TEST_FAILED): S.ABNORMAL,
    (S.NOT_READY, ControllerEvent.TRIGGER_FIRED): S.LAUNCHED,
    (S.READY, ControllerEvent.TAKEOFF): S.TAKEOFF,
    (S.READY, ControllerEvent.TRIGGER_FIRED): S.LAUNCHED,
    (S.READY, ControllerEvent.FAULT): S.ABNORMAL,
    (S.TAKEOFF, ControllerEvent.ARM): S.ARMED,
    (S.TAKEOFF, ControllerEvent.LAND): S.READY,
    (S.TAKEOFF, ControllerEvent.TRIGGER_FIRED): S.LAUNCHED,
    (S.TAKEOFF, ControllerEvent.FAULT): S.ABNORMAL,
    (S.ARMED, ControllerEvent.DISARM): S.TAKEOFF,
    (S.ARMED, ControllerEvent.TRIGGER_FIRED): S.LAUNCHED,
    (S.ARMED, ControllerEvent.FAULT): S.ABNORMAL,
    (S.LAUNCHED, ControllerEvent.AT_REST): S.TOUCHDOWN,
    (S.ABNORMAL, ControllerEvent.FAULT_CLEARED): S.READY,
    (S.ABNORMAL, ControllerEvent.TRIGGER_FIRED): S.LAUNCHED,
    **RESTARTS,
}
#: After the parachute is out only a restart leads back.
NOT_IN_DOCUMENT = {
    *itertools.product((S.LAUNCHED, S.TOUCHDOWN), (S.READY, S.TAKEOFF, S.ARMED, S.ABNORMAL)),
    (S.TOUCHDOWN, S.LAUNCHED),
}


def test_states_are_numbered_as_in_the_document():
    names = "NOT_READY READY TAKEOFF ARMED LAUNCHED TOUCHDOWN ABNORMAL"
    assert [(state.name, int(state)) for state in NAMED] == [
        (name, number) for number, name in enumerate(names.split(), 1)
    ]


def test_pair_of_state_and_stimulus_moves_or_raises():
    for state, event in itertools.product(S, ControllerEvent):
        if (state, event) in WANTED:
            moved = after(machine.TRANSITIONS, state, event)
            assert moved is WANTED[state, event], (state, event)
        else:
            with pytest.raises(TransitionError, match=state.name):
                after(machine.TRANSITIONS, state, event)


def test_jump_is_known_if_steps_of_the_table_lead_to_it():
    """READY to ARMED passes TAKEOFF, for less than the interval of the status."""
    for before, now in itertools.product(NAMED, NAMED):
        known = (before, now) not in NOT_IN_DOCUMENT
        assert machine.is_known_jump(before, now) is known, (before, now)
        assert machine.is_known_jump(S.UNKNOWN, now)
        assert not machine.is_known_jump(before, S.UNKNOWN)


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


def test_jump_is_followed_and_reported_if_the_table_does_not_know_it(bench):
    for before, now in itertools.product(NAMED, NAMED):
        story = bench("").status(before.name).clear().status(now.name)
        controller = story.link.devices.controllers[33]
        unknown = (before, now) in NOT_IN_DOCUMENT
        jump = f"{before.name} to {now.name}"
        assert (controller.state, controller.unknown_jumps) == (now, int(unknown)), jump
        told = [text for text in story.notices() if "controller 33" in text]
        if unknown:
            assert controller.newest_unknown_jump == jump
            strange = f"controller 33 went from {jump}, which is not in its document"
            assert strange in told
        else:
            assert told == ([] if before is now else [f"controller 33: {jump}"])
    story = bench("").status("LAUNCHED")
    assert story.link.devices.controllers[33].unknown_jumps == 0, "the first needs no cause"


def test_number_without_a_name_is_unknown_and_said_to_be(bench):
    story = bench("").status("READY")
    free = next(n for n in range(8) if story.definitions.state(n) is None)
    story.puppet(33).broadcast("flyfire.ParachuteStatus", {"state": free})
    story.deliver(story.puppet(33))
    picture = story.picture()
    assert picture.state is S.UNKNOWN
    assert f"state {free} has no name" in picture.faults
