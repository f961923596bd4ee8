"""Supervisor, mavlink_parachute and both simulators together: one flight, seen from the wire."""

import pytest
from chute_msgs.msg import ParachuteStatus, SafetyState, VehicleState
from chute_msgs.srv import Arm, Deploy
from mavlink_bench import Autopilot, ChainFlight, Module, do, quick
from node_bench import LOCAL, port_of

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteSettings
from chute_ros.model import DeploymentTrigger
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode
from chute_ros.sim.faults import FaultKnobs

NO_FAULTS = FaultKnobs()
#: High enough to fall and open, low enough not to wait for, m.
HEIGHT = 20.0


class Flight(ChainFlight):
    """One vehicle, from the ground up."""

    def __init__(self, bench, knobs=NO_FAULTS, height=HEIGHT, profile="by_hand", **parameters):
        super().__init__(bench)
        self.knobs, self.height = knobs, height
        self.vehicle = bench.follow(VehicleState, "vehicle/state")
        self.parachute = bench.follow(ParachuteStatus, "parachute/status")
        bench.add(SafetySupervisorNode, startup_grace=0.5, profile=profile)
        node = bench.add(MavlinkParachuteNode, **quick(**parameters))
        self.network = f"udpout:{LOCAL}:{port_of(node.loop)}"
        self.autopilot = Autopilot()
        self.autopilot.model.climb_speed, self.autopilot.model.canopy_speed = 40.0, 10.0
        self.autopilot.loop = bench.simulate(
            self.autopilot, f"udpin:{LOCAL}:0", self.network, knobs=knobs
        )
        self.module = Module(ParachuteSettings())  # on the ground until it hears of a height

    def plug_parachute_in(self):
        vehicle = f"udpout:{LOCAL}:{port_of(self.autopilot.loop)}"
        self.bench.simulate(self.module, self.network, vehicle, knobs=self.knobs)

    def await_vehicle(self, what, condition):
        self.bench.until(lambda: self.vehicle and condition(self.vehicle[-1]), what)

    def take_off(self):
        """Released, armed, and up."""
        self.plug_parachute_in()
        self.await_stage(SafetyState.READY)
        self.bench.until(
            lambda: not self.parachute[-1].safety_flags & ParachuteStatus.SAFETY_GROUND_CLEARED,
            "the parachute has heard of its height",
        )
        answer = self.bench.call(Arm, "safety/arm", arm=True)
        assert answer.success, answer.message
        self.act("arm")
        self.act(f"takeoff={self.height}")
        self.await_stage(SafetyState.IN_FLIGHT)
        self.await_vehicle("it is up", lambda v: v.height > self.height - 5.0)

    def fail_and_deploy(self):
        """A motor fails; the operator sees it fall and calls for the parachute."""
        self.act("fail-motor")
        self.await_vehicle("it falls", lambda v: v.vertical_speed < -3.0)
        return self.bench.call(Deploy, "safety/deploy", reason="it falls")

    def check_order_on_the_wire(self):
        """Seen by the devices themselves: first the kill, then the release."""
        kills, releases = self.autopilot.forced, self.module.releases
        assert kills
        assert releases
        assert kills[0][0] < releases[0][0]


def test_a_flight_from_its_block_to_the_ground_under_a_canopy(bench):
    flight = Flight(bench)
    flight.await_stage(SafetyState.BLOCKED)
    flight.await_vehicle("the autopilot is heard", lambda v: v.armed == VehicleState.DISARMED)
    flight.act("arm")
    bench.until(lambda: not flight.autopilot.model.armed, "arming is undone: no parachute yet")
    flight.take_off()
    assert flight.module.releases == []
    answer = flight.fail_and_deploy()
    assert answer.success, answer.message
    flight.check_order_on_the_wire()
    assert flight.module.deployment == DeploymentTrigger.DRONE
    flight.await_stage(SafetyState.DEPLOYED)
    bench.until(lambda: flight.parachute[-1].deployed, "its status says so")
    flight.await_vehicle("the motors are off", lambda v: v.armed == VehicleState.DISARMED)
    flight.await_vehicle("the canopy carries", lambda v: -11.0 < v.vertical_speed < -9.0)
    flight.await_vehicle("it has landed", lambda v: v.landed_state == 1)


@pytest.mark.parametrize("loss", [0.3])
def test_with_three_packets_of_ten_lost_each_way_it_still_deploys(bench, loss):
    flight = Flight(
        bench,
        FaultKnobs(loss=loss, duplicate=0.1, corrupt=0.05, delay=0.05),
        parachute_stale_after=2.5,
        parachute_lost_after=5.0,
        autopilot_stale_after=2.5,
        autopilot_lost_after=5.0,
        give_up_after=6.0,
        height=80.0,
    )
    flight.take_off()
    answer = flight.fail_and_deploy()
    assert answer.success, answer.message
    # Which of them arrives first is up to what is lost; that each arrives is not.
    assert flight.autopilot.forced
    assert flight.module.releases
    assert flight.module.deployment
    assert not flight.autopilot.model.armed


def test_nobody_has_to_call_for_it_the_rules_of_the_vehicle_see_the_fall(bench):
    flight = Flight(bench, profile="multirotor")
    flight.take_off()
    flight.act("fail-motor")
    flight.await_stage(SafetyState.DEPLOYED)
    flight.check_order_on_the_wire()
    assert flight.module.deployment == DeploymentTrigger.DRONE
    fallen = [rule for rule in flight.safety[-1].rules if rule.latched]
    assert "free fall" in {rule.name for rule in fallen}


def test_an_autopilot_that_takes_no_kill_does_not_keep_the_parachute_in(bench):
    flight = Flight(bench)
    flight.take_off()
    flight.act("mute")
    answer = flight.fail_and_deploy()
    assert answer.success, answer.message
    flight.check_order_on_the_wire()
    assert flight.module.deployment
    assert flight.autopilot.model.armed, "it never took the kill"


def test_a_parachute_that_falls_silent_on_the_ground_blocks_flight_again(bench):
    flight = Flight(bench)
    flight.plug_parachute_in()
    flight.await_stage(SafetyState.READY)
    bench.unplug(bench.loops[-1])
    flight.await_stage(SafetyState.BLOCKED)
    flight.act("arm")
    bench.until(lambda: not flight.autopilot.model.armed, "arming is undone")


def test_a_module_that_releases_by_itself_has_the_motors_stopped(bench):
    flight = Flight(bench)
    flight.take_off()
    do(bench, bench.loops[-1], lambda: flight.module.act("deploy=ATS"))
    bench.until(lambda: not flight.autopilot.model.armed, "the motors are stopped")
    assert flight.autopilot.forced
    assert flight.module.releases == []
    flight.await_stage(SafetyState.DEPLOYED)
