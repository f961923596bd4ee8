"""A stranger on the CAN bus: what the node sees through, and what classic CAN cannot tell."""

from __future__ import annotations

from chute_msgs.msg import ParachuteStatus, SafetyRequest
from upf_bench import Devices, Network

from chute_ros.links.upf.protocol.config import NODE_ID
from chute_ros.links.upf.protocol.definitions import (
    PARACHUTE_STATUS,
    TRIGGER_STATUS,
    VEHICLE_SERVICE,
)
from chute_ros.model import ParachuteState

KILL = "TYPE_KILLSWITCH"
STRANGER, OURS = 60, NODE_ID


def answers(party):
    return [one for one in party.heard if one.name == VEHICLE_SERVICE]


def test_a_strangers_kill_switch_stops_no_motor_where_the_controller_is_named(bench):
    network = Network(bench, controller_node_id=33, trigger_node_id=34)
    asked = bench.follow(SafetyRequest, "safety/request")
    stranger = network.party(STRANGER)
    request = network.definitions.request(VEHICLE_SERVICE, KILL)
    stranger.ask(OURS, VEHICLE_SERVICE, 1, **request)
    bench.until(lambda: answers(stranger), "it is answered")
    result = network.definitions.result_name(VEHICLE_SERVICE, answers(stranger)[0].values)
    assert result == "REJECTED"
    stranger.ask(OURS, VEHICLE_SERVICE, 2, **(request | {"magic_number": 1}))
    bench.until(lambda: len(answers(stranger)) == 2, "a bad magic number as well")
    assert asked == []
    # The same from the controller itself goes on.
    network.party(33).ask(OURS, VEHICLE_SERVICE, 1, **request)
    bench.until(lambda: asked, "the supervisor is asked")
    assert (asked[0].request, asked[0].device) == (SafetyRequest.KILL, "33")


def test_the_states_of_strangers_are_not_followed_where_ours_are_named(bench):
    network = Network(bench, controller_node_id=33, trigger_node_id=34)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    devices = Devices(network)
    stranger = network.party(STRANGER)
    launched = network.definitions.state_number(ParachuteState.LAUNCHED)
    stranger.say(PARACHUTE_STATUS, **(devices.controller.status() | {"state": launched}))
    stranger.say(TRIGGER_STATUS, state=launched)
    bench.until(
        lambda: network.link.counts["status of devices not followed"] >= 2, "both are counted"
    )
    bench.turns(0.2)
    assert {one.device for one in statuses} == {"33"}
    assert not any(one.deployed for one in statuses)


def test_who_takes_the_controllers_node_id_is_believed_for_as_long_as_it_speaks(bench):
    """The limit of classic CAN, which has no signatures, written down."""
    network = Network(bench, controller_node_id=33, trigger_node_id=34)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    devices = Devices(network)
    liar = network.party(33)
    launched = network.definitions.state_number(ParachuteState.LAUNCHED)

    def lie():
        liar.say(PARACHUTE_STATUS, **(devices.controller.status() | {"state": launched}))
        bench.turns(0.02)
        return any(one.deployed for one in statuses)

    bench.until(lie, "the lie is believed")
    bench.until(lambda: not statuses[-1].deployed, "until the controller speaks again")
    assert not devices.trigger.fired
