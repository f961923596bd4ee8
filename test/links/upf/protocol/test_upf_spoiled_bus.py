"""A bus that loses, doubles, delays and spoils frames: what is asked for gets through, whole."""

import pytest

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.protocol.dronecan.calls import CallLimits
from chute_ros.protocol.goal import EffectLimits
from chute_ros.protocol.liveness import LivenessLimits
from chute_ros.sim.can_faults import CanFaultKnobs

#: A bus that loses much needs limits to match.
FORGIVING = {
    "liveness": LivenessLimits(2.5, 5.0),
    "status_timeout": 2.5,
    "calls": CallLimits(0.2, 7),
    "effect": EffectLimits(2.0, 0.25, 15.0),
    "last_resort_after": 10.0,
}
FAULTS = {
    "loss": CanFaultKnobs(loss=0.3),
    "duplicates": CanFaultKnobs(duplicate=0.3),
    "reordering": CanFaultKnobs(reorder=0.3),
    "delay": CanFaultKnobs(delay=0.02),
    "corruption": CanFaultKnobs(corrupt=0.1),
    "toggle": CanFaultKnobs(toggle=0.1),
    "half": CanFaultKnobs(half=0.3),
    "all": CanFaultKnobs(
        loss=0.1, duplicate=0.1, reorder=0.1, corrupt=0.02, toggle=0.05, half=0.1, delay=0.005
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_forced_deploy_gets_through_what_happens_to_frames(bench, name):
    story = bench(knobs=FAULTS[name], **FORGIVING).ready()
    story.call("deploy", 1, True).after(16.0)
    assert story.end(1).success, story.end(1).message
    assert story.trigger.fired
    assert set(story.controller.requests_heard) == {"TYPE_DEPLOY_FORCE"}


#: What a transfer of nine frames may have to go through; on a bus, its frames stay in order.
LONG = {
    "loss": CanFaultKnobs(loss=0.05),
    "duplicates": CanFaultKnobs(duplicate=0.3),
    "corruption": CanFaultKnobs(corrupt=0.05),
    "toggle": CanFaultKnobs(toggle=0.05),
    "half": CanFaultKnobs(half=0.3),
    "all": CanFaultKnobs(loss=0.02, duplicate=0.1, corrupt=0.02, toggle=0.02, half=0.05),
}


@pytest.mark.parametrize("name", LONG)
def test_long_transfers_get_through_whole_or_not_at_all(bench, name):
    story, answered = bench(knobs=LONG[name], **FORGIVING).ready(), 0
    for token in range(10):
        story.call("bus_request", token, 33, bus_requests.node_info)
        done = story.after(2.0).bus_request(token)
        if done.success:
            answered += 1
            assert bytes(done.values["name"]) == b"upf.controller"
            unique_id = bytes(done.values["hardware_version"]["unique_id"])
            assert unique_id == story.controller.settings.unique_id
        else:
            assert "no acknowledgement after 7 sends" in done.message
    assert answered
