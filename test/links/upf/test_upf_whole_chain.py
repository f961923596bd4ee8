"""Supervisor, mavlink_parachute, upf_can and all simulators: from one wire to the other."""

from chute_msgs.msg import ParachuteStatus, SafetyState, VehicleState
from chute_msgs.srv import Arm, Deploy
from mavlink_bench import Autopilot, ChainFlight
from mavlink_bench import quick as quick_mavlink
from node_bench import LOCAL, port_of
from upf_bench import Network

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

LINKS = ["mavlink_parachute", "upf_can"]
HEIGHT = 20.0  # m


class Flight(ChainFlight):
    """A vehicle whose autopilot speaks MAVLink and whose parachute is a UPF."""

    def __init__(self, bench, kill_wait=10.0, **parameters):
        super().__init__(bench)
        self.vehicle = bench.follow(VehicleState, "vehicle/state")
        self.parachute = bench.follow(ParachuteStatus, "parachute/status")
        bench.add(
            SafetySupervisorNode,
            startup_grace=0.5,
            # All nodes share an executor: on a busy machine a heartbeat may come late.
            max_clock_difference=2.0,
            required_links=LINKS,
            kill_links=LINKS[:1],
            deploy_links=LINKS[1:],
        )
        mavlink = bench.add(MavlinkParachuteNode, **quick_mavlink(expect_parachute=False))
        self.autopilot = Autopilot()
        self.autopilot.model.climb_speed = 40.0
        self.autopilot.loop = bench.simulate(
            self.autopilot, f"udpin:{LOCAL}:0", f"udpout:{LOCAL}:{port_of(mavlink.loop)}"
        )
        limits = {"vehicle_service_timeout": 2.0, "give_up_after": 5.0}
        self.network = Network(bench, **(limits | parameters))
        self.controller = self.network.controller(kill_wait=kill_wait)
        self.trigger = self.network.trigger()
        self.loop = None

    def plug_parachute_in(self):
        self.loop = self.network.plug(self.controller, self.trigger)

    def device(self, action):
        self.bench.have(self.loop, lambda bus: bus.act(action))

    def await_said(self, text):
        self.bench.until(
            lambda: any(text in line for line in self.network.said), f"the device says {text!r}"
        )

    def take_off(self):
        self.plug_parachute_in()
        self.await_stage(SafetyState.READY)
        answer = self.bench.call(Arm, "safety/arm", arm=True)
        assert answer.success, answer.message
        self.act("arm")
        self.act(f"takeoff={HEIGHT}")
        self.await_stage(SafetyState.IN_FLIGHT)
        self.bench.until(lambda: self.vehicle[-1].height > HEIGHT - 5.0, "it is up")

    def when_said(self, text):
        """The place of a line among all that the devices said."""
        return next(place for place, line in enumerate(self.network.said) if text in line)


def test_a_kill_switch_on_the_bus_stops_the_motors_and_is_answered_after(bench):
    flight = Flight(bench)
    flight.take_off()
    assert flight.autopilot.model.armed
    flight.device("deploy")
    flight.await_said("TYPE_KILLSWITCH answered: SUCCESS")
    assert not flight.autopilot.model.armed, "the motors are off by then"
    assert flight.autopilot.forced
    flight.await_said("FIRED")
    assert flight.when_said("KILLSWITCH answered") < flight.when_said("FIRED")
    flight.await_stage(SafetyState.DEPLOYED)
    assert flight.controller.came.count("TYPE_DEPLOY_FORCE") == 0, "it deploys by itself"
    assert flight.parachute[-1].deployed or bench.until(
        lambda: flight.parachute[-1].deployed, "its status says so"
    )


def test_an_autopilot_that_takes_no_kill_is_told_to_the_device_as_a_failure(bench):
    flight = Flight(bench, kill_wait=60.0, vehicle_service_timeout=0.3)
    flight.take_off()
    flight.act("mute")
    flight.device("deploy")
    flight.await_said("TYPE_KILLSWITCH answered: FAILED")
    assert flight.autopilot.model.armed
    flight.await_said("FIRED")


def test_a_deploy_of_the_operator_stops_the_motors_first(bench):
    flight = Flight(bench, kill_wait=0.05)
    flight.take_off()
    answer = bench.call(Deploy, "safety/deploy", reason="it falls")
    assert answer.success, answer.message
    assert flight.trigger.fired
    assert not flight.autopilot.model.armed
    assert flight.autopilot.forced
    assert flight.controller.came[-1] == "TYPE_DEPLOY"
    flight.await_stage(SafetyState.DEPLOYED)


def test_a_controller_that_breaks_down_on_the_ground_blocks_flight_until_it_is_well(bench):
    flight = Flight(bench)
    flight.plug_parachute_in()
    flight.await_stage(SafetyState.READY)
    flight.device("error=IMU")
    flight.await_stage(SafetyState.BLOCKED)
    bench.until(lambda: "upf_can 33" in flight.safety[-1].device_blocks, "its block stands")
    flight.await_said("TYPE_FLIGHT_BLOCK answered: SUCCESS")
    flight.act("arm")
    bench.until(lambda: not flight.autopilot.model.armed, "arming is undone")
    flight.device("clear-errors")
    flight.await_stage(SafetyState.READY)
    assert flight.safety[-1].device_blocks == []
    flight.await_said("TYPE_FLIGHT_BLOCK_RELEASE answered: SUCCESS")


def test_a_controller_that_restarts_on_the_ground_blocks_flight_until_it_is_ready(bench):
    flight = Flight(bench)
    flight.controller.how = type(flight.controller.how)(flight.controller.how.node, self_test=1.0)
    flight.plug_parachute_in()
    flight.await_stage(SafetyState.READY)
    flight.device("reboot")
    flight.await_stage(SafetyState.BLOCKED)
    flight.await_stage(SafetyState.READY)
