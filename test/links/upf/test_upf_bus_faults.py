"""upf_can on a bus that loses, doubles, spoils and floods."""

import random

import pytest
from chute_msgs.msg import LinkHeartbeat, ParachuteStatus
from chute_msgs.srv import Arm, Deploy
from upf_bench import Devices, Network

from chute_ros.links.upf.protocol.config import NODE_ID
from chute_ros.links.upf.protocol.definitions import PARACHUTE_STATUS, TRIGGER_STATUS
from chute_ros.model import LinkState
from chute_ros.protocol.dronecan.bus_node import NODE_STATUS
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack
from chute_ros.sim.can_faults import CanFaultKnobs

#: A bus that loses much needs limits to match.
FORGIVING = {
    "device_stale_after": 2.5,
    "device_lost_after": 5.0,
    "status_timeout": 2.5,
    "call_timeout": 0.2,
    "call_tries": 7,
    "effect_timeout": 2.0,
    "give_up_after": 15.0,
    "last_resort_after": 10.0,
}


class Spoiled:
    """Controller and trigger behind a faulty plug."""

    def __init__(self, bench, knobs):
        self.bench, self.network = bench, Network(bench, **FORGIVING)
        self.beats = bench.follow(LinkHeartbeat, "safety/heartbeat")
        self.statuses = bench.follow(ParachuteStatus, "parachute/status")
        self.controller, self.trigger = self.network.controller(), self.network.trigger()
        self.loop = self.network.plug(self.controller, self.trigger, knobs=knobs)
        bench.until(
            lambda: self.beats and self.beats[-1].link_state == LinkState.OK and self.statuses,
            "the controller is heard",
        )


def test_a_forced_deploy_gets_through_whatever_happens_to_frames(bench):
    """Each fault alone, in virtual time: protocol/test_upf_spoiled_bus.py."""
    knobs = CanFaultKnobs(
        loss=0.1, duplicate=0.1, reorder=0.1, corrupt=0.02, toggle=0.05, half=0.1, delay=0.005
    )
    spoiled = Spoiled(bench, knobs)
    answer = bench.call(Deploy, "upf_can/deploy", force=True, reason="a test")
    assert answer.success, answer.message
    assert spoiled.trigger.fired
    assert spoiled.network.node._loop_faults == 0, "no exception in the link's thread"


def test_duplicates_arm_and_deploy_once(bench):
    spoiled = Spoiled(bench, CanFaultKnobs(duplicate=1.0))
    assert bench.call(Arm, "upf_can/arm", arm=True).success
    answer = bench.call(Deploy, "upf_can/deploy", reason="a test")
    assert answer.success, answer.message
    assert spoiled.controller.came == ["TYPE_TAKEOFF", "TYPE_ARM", "TYPE_DEPLOY"]


# Floods


def noise(network, rng, count):
    """Frames of all kinds: none of them makes sense."""
    made = []
    for _ in range(count):
        kind = rng.randrange(4)
        data = rng.randbytes(rng.randrange(9))
        if kind == 0:
            made.append(pack(CanFrame(rng.getrandbits(29), data)))
        elif kind == 1:
            made.append(pack(CanFrame(rng.getrandbits(11), data, extended=False)))
        elif kind == 2:
            # A message that we listen to, with any payload.
            number = network.definitions.types.message(
                rng.choice((PARACHUTE_STATUS, TRIGGER_STATUS, NODE_STATUS))
            ).id
            identifier = 16 << 24 | number << 8 | rng.randrange(60, 64)
            made.append(pack(CanFrame(identifier, data)))
        else:
            # A request to us, of any service.
            identifier = 16 << 24 | rng.randrange(256) << 16 | 1 << 15 | NODE_ID << 8 | 1 << 7 | 60
            made.append(pack(CanFrame(identifier, data)))
    return made


@pytest.mark.parametrize("garbage", [False, True], ids=["valid frames", "garbage"])
def test_a_flood_keeps_neither_heartbeat_nor_status_nor_deploy(bench, garbage):
    network = Network(bench, **FORGIVING, controller_node_id=33, trigger_node_id=34)
    statuses = bench.follow(ParachuteStatus, "parachute/status")
    devices = Devices(network)
    party, rng = network.party(60), random.Random(7)

    def flood():
        if garbage:
            party.put(*noise(network, rng, 50))
        else:
            for _ in range(50):
                party.say(NODE_STATUS, uptime_sec=9)

    devices.beats.clear()
    statuses.clear()
    future = bench.ask(Deploy, "upf_can/deploy", force=True, reason="a test")

    def done():
        flood()
        return future.done() and len(devices.beats) >= 10 and len(statuses) >= 10

    bench.until(done, "all goes on")
    assert future.result().success, future.result().message
    assert devices.trigger.fired
    assert network.node._loop_faults == 0
    assert network.link.bus.endpoint.received_count > 0
