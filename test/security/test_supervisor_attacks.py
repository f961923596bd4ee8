"""Somebody speaks to the supervisor without SROS 2: what it stops all the same, and what not.

What it believes is written down as well: it is what SROS 2 is for.
"""

from __future__ import annotations

import json
import math

import pytest
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyRequest,
    SafetyState,
    SupervisorLease,
    VehicleState,
)
from chute_msgs.srv import Deploy
from node_bench import stamped
from std_srvs.srv import Trigger
from supervisor_bench import Scene

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.ros import qos
from chute_ros.supervisor import handover
from chute_ros.supervisor.epochs import LARGEST_EPOCH, epoch_above

LINK = "mavlink_parachute"
#: A forger speaks as often, s.
OFTEN = 0.02


def say(scene, message, topic, profile=qos.STATUS):
    scene.bench.publish(stamped(scene.bench.client, message), topic, profile)


def keep_saying(scene, message, topic, until):
    """Until that holds."""

    def look():
        say(scene, message, topic)
        scene.bench.turns(OFTEN)
        return until()

    scene.bench.until(look, f"it is believed on {topic}")


def ready(bench, **parameters):
    scene = Scene(bench, **({"profile": "by_hand"} | parameters))
    scene.await_stage(SafetyState.READY)
    return scene


def flying(bench, **parameters):
    scene = ready(bench, **({"profile": "multirotor"} | parameters))
    scene.link.flying = True
    scene.await_stage(SafetyState.IN_FLIGHT)
    return scene


# -- the lease -----------------------------------------------------------------------------------


def test_a_lease_claimed_with_a_huge_epoch_takes_nothing_over(bench):
    scene = ready(bench, hot_standby=True, rank=0, lease_listen=0.3)
    epoch = scene.supervisor.runtime.state.epoch
    for rank in (0, 1, 2, 3, 9):
        claim = SupervisorLease(name="liar", rank=rank, epoch=LARGEST_EPOCH, leading=True)
        for _ in range(3):
            say(scene, claim, "safety/lease")
    bench.turns(1.0)
    assert scene.supervisor.runtime.lease.leading
    assert scene.supervisor.runtime.state.epoch == epoch


@pytest.mark.parametrize("hot_standby", [False, True])
@pytest.mark.parametrize("field", [{"epoch": 2**70}, {"epoch": -5}, {"next_id": 2**70}], ids=str)
def test_a_state_in_a_lease_that_nobody_can_have_is_not_followed(bench, hot_standby, field):
    """The forged claim is believed while it is told, and no longer."""
    scene = ready(bench, hot_standby=hot_standby, rank=0, lease_listen=0.3)
    supervisor = scene.supervisor.runtime
    before = supervisor.state.epoch
    claim = SupervisorLease(
        name="liar",
        rank=1,
        epoch=epoch_above(before, 1),
        leading=True,
        state=json.dumps(json.loads(handover.told(supervisor.state, 0.0)) | field),
    )
    keep_saying(scene, claim, "safety/lease", lambda: not supervisor.lease.leading)
    assert supervisor.state.epoch == before
    assert supervisor.state.next_id < 100
    bench.until(lambda: supervisor.lease.leading, "it leads again")
    assert before < supervisor.state.epoch < before + 10
    scene.await_stage(SafetyState.READY)


# -- what is told on behalf of others ------------------------------------------------------------


def test_without_sros_a_forged_kill_request_stops_the_motors_and_deploys_nothing(bench):
    scene = flying(bench)
    request = SafetyRequest(link=LINK, device="9", request=SafetyRequest.KILL, reason="forged")
    say(scene, request, "safety/request")
    scene.await_decision(Action.KILL)
    scene.await_stage(SafetyState.KILLING)
    bench.turns(0.5)
    assert scene.decided(Action.DEPLOY) == []


def test_without_sros_a_forged_flight_block_stays_until_a_reset(bench):
    scene = ready(bench)
    block = SafetyRequest.FLIGHT_BLOCK
    say(scene, SafetyRequest(link=LINK, device="9", request=block, reason="x"), "safety/request")
    scene.await_stage(SafetyState.BLOCKED)
    bench.turns(1.0)
    assert scene.states[-1].device_blocks == [f"{LINK} 9"]
    assert scene.call(Trigger, "reset").success
    scene.await_stage(SafetyState.READY)


def test_without_sros_a_forged_heartbeat_hides_a_dead_node_while_it_is_told(bench):
    scene = ready(bench)
    scene.link.beating = False
    healthy = LinkHeartbeat(link=LINK, link_state=int(LinkState.OK), device_healthy=True)
    for healthy.seq in range(1000, 1100):
        say(scene, healthy, "safety/heartbeat")
        bench.turns(OFTEN)
    assert scene.states[-1].state == SafetyState.READY
    scene.await_stage(SafetyState.BLOCKED)


def test_without_sros_a_forged_confirmation_passes_for_a_deploy(bench):
    """Whoever asked is told that the parachute is out, and nothing was fired."""
    scene = flying(bench)
    scene.link.outcomes = [Outcome.SENT]
    answer = bench.ask(Deploy, "safety/deploy", reason="it falls")
    for action in (Action.KILL, Action.DEPLOY):
        decision = scene.await_decision(action)
        forged = ActionReport(
            epoch=decision.epoch,
            id=decision.id,
            action=int(action),
            link=LINK,
            outcome=int(Outcome.CONFIRMED),
            newest_epoch=decision.epoch,
        )
        say(scene, forged, "safety/action", qos.DECISION)
    bench.until(answer.done, "safety/deploy answers")
    assert answer.result().success


# -- pictures ------------------------------------------------------------------------------------


def picture(**fields):
    """What a vehicle tells, all of it young."""
    ages = ("armed", "landed_state", "height", "vertical_speed", "attitude", "acceleration")
    values = {f"{name}_age": 0.0 for name in ages} | fields
    return VehicleState(source="9/9", link_state=int(LinkState.OK), **values)


def test_a_forged_fall_fires_nothing_while_it_says_that_it_stands(bench):
    scene = ready(bench, profile="multirotor")
    falling = picture(
        armed=VehicleState.DISARMED,
        landed_state=VehicleState.ON_GROUND,
        height=100.0,
        vertical_speed=-40.0,
    )
    for _ in range(100):
        say(scene, falling, "vehicle/state")
        bench.turns(OFTEN)
    assert scene.decided(Action.DEPLOY) == []
    assert scene.decided(Action.KILL) == []


def test_without_sros_a_forged_flight_that_ends_in_a_fall_kills_and_deploys(bench):
    """Although the true node goes on saying that it stands."""
    scene = ready(bench, profile="multirotor")
    up = {"armed": VehicleState.ARMED, "landed_state": VehicleState.IN_AIR, "height": 60.0}
    climbing = picture(**up, vertical_speed=3.0, tilt=0.0, acceleration=9.8)
    keep_saying(
        scene,
        climbing,
        "vehicle/state",
        lambda: scene.states[-1].state == SafetyState.IN_FLIGHT,
    )
    falling = picture(**up, vertical_speed=-15.0, tilt=math.radians(143.0), acceleration=0.5)
    keep_saying(scene, falling, "vehicle/state", lambda: scene.decided(Action.DEPLOY))
    assert scene.decided(Action.KILL)


def test_without_sros_a_forged_deployed_stops_the_motors_in_flight(bench):
    scene = flying(bench)
    out = ParachuteStatus(
        link=LINK, device="1/161", link_state=int(LinkState.OK), deployed=True, age=0.0
    )
    say(scene, out, "parachute/status")
    assert scene.await_decision(Action.KILL).rule == "parachute open"
    bench.turns(0.5)
    assert scene.decided(Action.DEPLOY) == []
