"""The trigger: told by a service or a broadcast, tested, stuck, faulty."""

import pytest
from upf_device_bench import BOTH_LAYOUTS, CONTROLLER, TRIGGER, Story, ready

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.model import ParachuteState as S
from chute_ros.sim.flight import FlightModel

LAUNCH = "TYPE_LAUNCH"


def told(story, name=LAUNCH, **changes):
    """Ask the trigger; the name of its result."""
    values = story.definitions.request(names.TRIGGER_SERVICE, name) | changes
    return story.result(names.TRIGGER_SERVICE, values, TRIGGER)


def broadcast(story, **changes):
    """Tell every trigger, or the one that is named."""
    kind = story.definitions.types.message(names.TRIGGER_LAUNCH)
    values = {"magic_number": kind.constants[names.MAGIC]} | changes
    story.vehicle.endpoint.broadcast(names.TRIGGER_LAUNCH, values)
    story.run(0.1)


def status(story):
    """The newest TriggerStatus: (state, fired, faults)."""
    values = story.heard(names.TRIGGER_STATUS, TRIGGER)[-1].values
    state = story.definitions.state_name(names.TRIGGER_STATUS, values)
    return state, values.get("is_launched", state == "LAUNCHED")


def faults(story):
    values = story.heard(names.TRIGGER_STATUS, TRIGGER)[-1].values
    return story.definitions.faults(names.TRIGGER_STATUS, values)


@BOTH_LAYOUTS
def test_it_says_that_it_is_ready_ten_times_a_second(layout):
    story = ready(layout)
    story.forget()
    story.run(2.0)
    assert len(story.heard(names.TRIGGER_STATUS, TRIGGER)) == pytest.approx(20, abs=1)
    assert status(story) == ("READY", False)
    assert faults(story) == []


def test_it_fires_once():
    story = ready()
    assert [told(story), told(story)] == ["SUCCESS", "SUCCESS"]
    broadcast(story)
    assert len([event for _, event in story.log if "FIRED" in event]) == 1


@BOTH_LAYOUTS
def test_a_faulty_one_says_so_and_does_not_fire(layout):
    story = ready(layout)
    story.bus.act("trigger-error")
    story.run(0.05)
    assert status(story) == ("ABNORMAL", False)
    assert len(faults(story)) == 1
    assert "circuit_open" in faults(story)[0].lower()
    failed = "FAILED" if layout == "ours" else "REJECTED"
    assert told(story) == failed
    # The other types have no self test.
    assert layout == "other" or told(story, "TYPE_SELF_TEST") == "FAILED"
    broadcast(story)
    assert not story.trigger.fired
    story.bus.act("clear-errors")
    assert told(story) == "SUCCESS"
    assert story.trigger.fired


@BOTH_LAYOUTS
def test_a_stuck_one_says_yes_and_nothing_comes_out(layout):
    story = ready(layout)
    story.bus.act("trigger-stuck")
    assert told(story) == "SUCCESS"
    broadcast(story)
    assert not story.trigger.fired
    assert status(story) == ("READY", False)


def test_a_mute_one_is_not_fired_by_anybody():
    story = ready()
    story.trigger.act("mute")
    assert told(story) is None
    broadcast(story)
    assert not story.trigger.fired


@BOTH_LAYOUTS
def test_what_has_fired_stays_so_over_a_restart(layout):
    story = ready(layout)
    told(story)
    story.restart(TRIGGER)
    story.run(2.5)
    assert status(story) == ("LAUNCHED", True)


def test_with_the_canopy_goes_whoever_waits_for_it():
    """Given a vehicle in the air: its canopy leaves when the trigger fires."""
    story = ready()
    story.flight = FlightModel(height=50.0)
    told(story)
    story.run(2.0)
    assert story.flight.canopy == 1.0


@BOTH_LAYOUTS
def test_two_triggers_are_both_told_and_one_that_fires_is_enough(layout):
    story = Story(layout, trigger_values={"Static Node ID": 40}).run(1.0)
    assert story.heard(names.TRIGGER_STATUS, 40)
    story.forget()
    assert story.ask("DEPLOY_FORCE", CONTROLLER) == "SUCCESS"
    story.run(0.2)
    assert story.trigger.fired
    assert story.state is S.LAUNCHED
