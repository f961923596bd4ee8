"""Several simulated nodes behind one connection: they hear each other, and act by a script."""

import math

import pytest
from upf_device_bench import CONTROLLER, NODE_STATUS, TRIGGER, Story, Vehicle, definitions, ready

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import UpfController
from chute_ros.links.upf.simulator.trigger import UpfTrigger
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.can_frame import unpack


def test_what_one_says_the_others_hear_and_the_wire_gets_as_well():
    story = ready()
    story.ask("DEPLOY_FORCE")
    story.run(0.1)
    assert story.trigger.fired, "it heard the controller"
    assert story.controller.state is ParachuteState.LAUNCHED, "it heard the trigger"
    assert story.heard(names.TRIGGER_LAUNCH), "the vehicle heard both"


def test_what_comes_from_the_wire_all_hear():
    story = Story().run(1.0)
    assert story.controller.vehicle_connected
    values = story.definitions.request(names.TRIGGER_SERVICE, "TYPE_LAUNCH")
    assert story.result(names.TRIGGER_SERVICE, values, TRIGGER) == "SUCCESS"


def test_each_frame_goes_out_once_and_a_node_does_not_hear_itself():
    # Each frame goes out once.
    bus = UpfBus([UpfController(definitions()), UpfTrigger(definitions())])
    bus.update(10.0)
    frames = bus.take_output()
    assert frames
    assert len(set(frames)) == len(frames)
    assert bus.take_output() == []
    bus.update(10.0)
    assert bus.take_output() == []
    # A node does not hear itself.
    story = Story().run(5.0)
    for node in story.bus.nodes:
        assert math.isnan(node.endpoint.own_id_heard)


def test_a_script_acts_in_its_time_which_is_a_deadline():
    # A script acts in its time.
    story = Story(script=[(2.0, "silent"), (1.0, "error=IMU"), (3.0, "speak")])
    story.run(1.5)
    assert story.faults() == ["IMU"]
    story.run(0.6)
    story.forget()
    assert not story.run(0.8).vehicle.messages
    assert story.run(0.3).heard(names.PARACHUTE_STATUS)
    # A script is a deadline.
    story = Story(script=[(2.005, "error=IMU")]).run(2.0)
    assert story.bus.next_deadline() <= story.began + 2.005 + story.STEP


def test_an_action_is_of_every_node_that_knows_it():
    story = ready()
    story.bus.act("mute")
    assert story.controller.mute
    assert story.trigger.mute
    story.bus.act("unmute")
    story.bus.act("trigger-error")
    assert story.trigger.errors
    assert story.run(0.2).faults() == []


def test_all_actions_and_their_arguments_are_known():
    bus = UpfBus([UpfController(definitions()), UpfTrigger(definitions())])
    assert set(bus.actions) == {
        *("mute", "unmute", "silent", "speak", "reboot", "error", "clear-errors", "deploy"),
        *("trigger-error", "trigger-stuck", "trigger-free", "refuse", "accept", "repack"),
    }
    bus.arguments["error"].convert("IMU")
    with pytest.raises(KeyError):
        bus.arguments["error"].convert("NO_SUCH_ERROR")


@pytest.mark.parametrize("alone", [UpfController, UpfTrigger])
def test_one_alone_is_a_bus_as_well(alone):
    bus = UpfBus([alone(definitions())])
    assert bus.next_deadline() <= 0.0, "at once"
    vehicle, now = Vehicle(definitions()), 10.0
    for _ in range(200):
        bus.update(now)
        for frame in bus.take_output():
            vehicle.receive(frame, now)
        now += 0.01
    source = CONTROLLER if alone is UpfController else TRIGGER
    assert {message.source for message in vehicle.messages[NODE_STATUS]} == {source}
    bus.stream_ended(None)


def test_nothing_is_left_for_later_than_the_next_deadline():
    """Given a bus that is only looked at when it wants to be: it says all that it would."""
    bus = UpfBus([UpfController(definitions()), UpfTrigger(definitions())])
    now, frames = 10.0, 0
    while now < 15.0:
        bus.update(now)
        for frame in bus.take_output():
            frames += bool(unpack(frame))
        following = bus.next_deadline()
        assert now < following < math.inf
        now = following
    # NodeStatus of both, ParachuteStatus and TriggerStatus (with a voltage: one frame).
    assert frames == pytest.approx(5 * (1 + 1 + 10 * 2 + 10), abs=25)


@pytest.mark.parametrize("data", [b"", b"\xff" * 16, b"\x00" * 16, bytes(range(16)), b"x" * 40])
def test_what_is_no_frame_of_ours_disturbs_nobody(data):
    story = ready()
    story.bus.receive(data, story.now, stream="a wire")
    story.forget()
    story.run(1.0)
    assert story.heard(names.PARACHUTE_STATUS)
