"""sim_bench: what can be done to a simulated vehicle, as services, with the real simulators."""

import subprocess
import sys
import threading

import pytest
from chute_msgs.msg import SafetyState
from command_bench import tool
from node_bench import bench  # noqa: F401
from std_srvs.srv import Trigger

from chute_ros.errors import ParameterError
from chute_ros.links.api import Sockets
from chute_ros.links.registered import vehicles
from chute_ros.ros import qos
from chute_ros.sim.bench_actions import actions_of
from chute_ros.tools.bench_node import BenchNode
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.tools.simulated_vehicle import SimulatedVehicle, simulator_module, simulators_of


class Vehicle:
    """The simulators of a vehicle as processes, and its sim_bench."""

    def __init__(self, bench, name):  # noqa: F811
        network, air, bus = free_udp_ports(3)
        local = "127.0.0.1"
        sockets = Sockets(
            f"{local}:{network}", f"{local}:{air}", f"mcast:0:{bus}", f"{bench.folder}/terminal"
        )
        vehicle = SimulatedVehicle(name, sockets, bench.folder)
        self.bench, self.lines = bench, []
        for _, (simulator, *arguments) in vehicle.simulators():
            process = subprocess.Popen(
                [sys.executable, "-m", simulator_module(simulator), *arguments],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            reader = threading.Thread(target=self._read, args=(process,))
            reader.start()
            bench.at_end.callback(self._end, process, reader)
        for simulator in simulators_of(name):
            path = bench.folder / f"{simulator}.sock"
            bench.until(path.is_socket, f"{simulator} has its control socket")
        bench.add(BenchNode, vehicle=name, folder=str(bench.folder))

    def _read(self, process):
        for line in process.stdout:
            self.lines.append(line)

    @staticmethod
    def _end(process, reader):
        process.terminate()
        process.wait(20.0)
        reader.join()
        process.stdout.close()

    def do(self, name):
        return self.bench.call(Trigger, f"sim/{name}")


@pytest.mark.parametrize("name", vehicles())
def test_each_action_of_each_vehicle_is_a_service_that_does_it(name, bench):  # noqa: F811
    vehicle = Vehicle(bench, name)
    offered = {
        service.rpartition("/")[2]
        for service, _ in bench.client.get_service_names_and_types()
        if service.startswith(f"{bench.namespace}/sim/")
    }
    actions = actions_of(simulators_of(name))
    assert offered == {one.name for one in actions}
    for action in actions:
        answer = vehicle.do(action.name)
        assert (answer.success, answer.message) == (True, action.effect)
        for _, what in action.orders:
            bench.until(
                lambda what=what: any(f"action {what}" in line for line in vehicle.lines),
                f"a simulator says that it does {what}",
            )


def test_a_take_off_is_refused_while_flight_is_blocked_with_the_reasons(bench):  # noqa: F811
    vehicle = Vehicle(bench, "mavlink")
    blocked = SafetyState(flight_blocked=True, block_reasons=["no parachute", "no vehicle"])
    bench.publish(blocked, "safety/state", qos.LATCHED)
    bench.until(
        lambda: not vehicle.do("take_off").success, "it has heard what the supervisor says"
    )
    answer = vehicle.do("take_off")
    assert answer.message == "the supervisor blocks flight: no parachute; no vehicle"
    assert vehicle.do("land").success, "what begins no flight is done all the same"
    bench.publish(SafetyState(), "safety/state", qos.LATCHED)
    bench.until(
        lambda: "blocks flight" not in vehicle.do("take_off").message, "it is not blocked now"
    )


def test_what_the_simulator_cannot_do_now_is_answered_with_its_reason(bench):  # noqa: F811
    vehicle = Vehicle(bench, "umbilical")
    assert vehicle.do("launch").success
    answer = vehicle.do("launch")
    assert not answer.success
    assert answer.message == "sim_flight_computer: it is in Ascent: need Startup or Standby"


def test_without_its_simulators_each_service_says_who_does_not_run(bench):  # noqa: F811
    bench.add(BenchNode, vehicle="both", folder=str(bench.folder))
    answer = bench.call(Trigger, "sim/restart_parachute")
    assert not answer.success
    for simulator in ("sim_mavlink_parachute", "sim_upf"):
        path = bench.folder / f"{simulator}.sock"
        assert f"{simulator}: the simulator does not run ({path}: " in answer.message


def test_a_vehicle_that_is_none_is_refused(bench):  # noqa: F811
    with pytest.raises(ParameterError, match=r"vehicle of .* is 'car': need one of "):
        bench.add(BenchNode, vehicle="car")
    code, _, err = tool("sim_bench", "--ros-args", "-p", "vehicle:=car")
    assert code == 2
    (line,) = err.splitlines()
    assert line.startswith("sim_bench: parameter vehicle of /sim_bench is 'car': need one of ")
