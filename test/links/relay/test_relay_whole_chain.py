"""Supervisor, mavlink_parachute, relay and the simulators: from the autopilot to the channel."""

import pytest
from chute_msgs.msg import SafetyState, VehicleState
from chute_msgs.srv import Arm, Deploy
from mavlink_bench import Autopilot, ChainFlight
from mavlink_bench import quick as quick_mavlink
from node_bench import LOCAL, port_of
from relay_bench import Board
from std_srvs.srv import Trigger

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

HEIGHT = 20.0  # m


class Flight(ChainFlight):
    """A vehicle whose autopilot speaks MAVLink and whose parachute hangs on a relay."""

    def __init__(self, bench, **supervisor):
        super().__init__(bench)
        self.vehicle = bench.follow(VehicleState, "vehicle/state")
        settings = {
            "startup_grace": 0.5,
            # All nodes share an executor: on a busy machine a heartbeat may come late.
            "max_clock_difference": 2.0,
            "required_links": ["mavlink_parachute", "relay"],
            "kill_links": ["mavlink_parachute"],
            "deploy_links": ["relay"],
            "unmonitored_links": ["relay"],
            "deploy_timeout": 1.0,
            **supervisor,
        }
        bench.add(SafetySupervisorNode, **settings)
        mavlink = bench.add(MavlinkParachuteNode, **quick_mavlink(expect_parachute=False))
        self.autopilot = Autopilot()
        self.autopilot.model.climb_speed = 40.0
        self.autopilot.loop = bench.simulate(
            self.autopilot, f"udpin:{LOCAL}:0", f"udpout:{LOCAL}:{port_of(mavlink.loop)}"
        )
        self.board = Board(bench)

    def take_off(self):
        self.board.plug_in()
        self.await_stage(SafetyState.READY)
        self.act("arm")
        self.act(f"takeoff={HEIGHT}")
        self.await_stage(SafetyState.IN_FLIGHT)
        self.bench.until(lambda: self.vehicle[-1].height > HEIGHT - 5.0, "it is up")


def test_a_deploy_stops_the_motors_fires_the_output_and_says_that_nothing_confirms_it(bench):
    flight = Flight(bench)
    flight.take_off()
    answer = bench.call(Deploy, "safety/deploy", reason="it falls")
    # The answer tells that it was sent; the board reads it when it has time to.
    bench.until(lambda: flight.board.deployed, "the output fires")
    assert not flight.autopilot.model.armed, "the motors are off"
    assert (answer.success, answer.accepted) == (False, False)
    assert "sent; a relay output confirms nothing" in answer.message
    flight.await_stage(SafetyState.FAULT)
    assert flight.board.commands_to_deploy() == 1


def test_a_release_by_hand_on_the_ground_blocks_flight_until_a_reset(bench):
    flight = Flight(bench)
    flight.board.plug_in()
    flight.await_stage(SafetyState.READY)
    bench.call(Deploy, "relay/deploy", force=True, reason="a test on the bench")
    flight.await_stage(SafetyState.BLOCKED)
    flight.bench.until(lambda: flight.safety[-1].block_reasons, "it is blocked")
    (reason,) = flight.safety[-1].block_reasons
    assert reason == (
        "relay output asks to block flight: its output was switched: repack or replace the "
        "parachute, then call safety/reset"
    )
    assert bench.call(Trigger, "safety/reset").success
    flight.await_stage(SafetyState.READY)


def test_nobody_flies_with_it_who_has_not_said_so(bench):
    flight = Flight(bench, unmonitored_links=[""])
    flight.board.plug_in()
    flight.await_stage(SafetyState.BLOCKED)
    text = "relay: UNMONITORED, its device never reports anything"
    bench.until(
        lambda: any(text in reason for reason in flight.safety[-1].block_reasons),
        "the reason is told",
    )


def test_arming_passes_and_disarming_says_what_a_person_must_do(bench):
    flight = Flight(bench)
    flight.board.plug_in()
    flight.await_stage(SafetyState.READY)
    answer = bench.call(Arm, "safety/arm", arm=True)
    assert answer.success, answer.message
    assert "has no arming" in answer.message
    answer = bench.call(Arm, "safety/arm", arm=False)
    assert not answer.success
    assert "disconnect or secure the parachute" in answer.message
    assert not flight.board.deployed


@pytest.mark.parametrize("away", [True, False])
def test_an_output_that_is_pulled_out_forbids_take_off(bench, away):
    flight = Flight(bench)
    if away:
        flight.board.plug_in()
        flight.await_stage(SafetyState.READY)
        flight.board.pull_out()
    flight.await_stage(SafetyState.BLOCKED)
    bench.until(
        lambda: any(
            "relay: its device is" in one or "nothing received from its device" in one
            for one in flight.safety[-1].block_reasons
        ),
        "the reason is told",
    )
